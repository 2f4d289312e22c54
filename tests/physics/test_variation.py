"""Friction that scatters from day to day and from trial to trial, and grows with the preload."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from campaign.physics.bench import Bench
from campaign.physics.limits import worst_friction
from campaign.physics.variation import as_it_is, of_its_day
from tests.physics.benches import RATIO, Tree, bench

NAMES = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "viscous_friction",
    "bristle_stiffness",
)
SCATTER = dict(zip(NAMES, (0.02, 0.04, 0.06, 0.05, 0.03), strict=True))


def torques(relative: float) -> Tree:
    """One draw a trial of Coulomb and static torque together."""
    return {"torques": {"paths": list(NAMES[:2]), "relative": relative}}


def scattering(day: int = 1, seed: int = 5, trial: float = 0.0, **also: Any) -> Bench:
    def edit(tree: Tree) -> None:
        tree["variation"] = {
            "seed": seed, "day": day, "day_to_day": SCATTER, "trial_to_trial": torques(trial),
        }  # fmt: skip
        tree["friction"]["load"].update(also)

    return bench(edit)


def preloaded(
    torque: str, edit: Callable[[Tree], object] = lambda tree: None, **shares: float
) -> Bench:
    def change(tree: Tree) -> None:
        tree["gear"]["preload"] = {"torque": torque, "nominal": "33 N m"}
        if shares:
            tree["gear"]["preload"]["shares"] = shares
        edit(tree)

    return bench(change)


def ratios(changed: Bench, name: str = "load") -> dict[str, float]:
    plain = bench().friction[name]
    return {p: getattr(changed.friction[name], p) / getattr(plain, p) for p in NAMES}


def test_nothing_changes_where_nothing_scatters() -> None:
    assert as_it_is(bench(), 3) == bench()
    assert set(ratios(as_it_is(scattering(day=0), 3)).values()) == {1.0}
    assert preloaded("33 N m").friction == as_it_is(preloaded("33 N m"), 1).friction


def test_a_day_has_its_friction_and_another_day_another() -> None:
    first, again = (as_it_is(scattering(day=3), seed) for seed in (1, 2))
    assert first == again  # whatever the trial: only `trial` scatters from trial to trial
    assert ratios(first) != ratios(as_it_is(scattering(day=4), 1))
    assert ratios(first) != ratios(as_it_is(scattering(day=3, seed=6), 1))
    assert ratios(first) == pytest.approx(ratios(first, "motor"))  # one oil, one temperature
    assert first.friction["load"].bristle_damping == bench().friction["load"].bristle_damping


def test_days_scatter_as_much_as_the_bench_says() -> None:
    draws = [ratios(of_its_day(scattering(day=day))) for day in range(1, 401)]
    for name, expected in SCATTER.items():
        values = np.array([draw[name] for draw in draws])
        # 400 draws: four standard errors of the mean and of the deviation.
        assert abs(values.mean() - 1.0) < 4 * expected / 20
        assert values.std() == pytest.approx(expected, rel=4 / np.sqrt(800))
    torques = np.array([[d["coulomb_torque"], d["static_torque"]] for d in draws])
    assert abs(np.corrcoef(torques.T)[0, 1]) < 0.2  # drawn one by one


def test_trials_scatter_in_torque_only_and_depend_on_their_seed() -> None:
    one, same, other = (as_it_is(scattering(day=0, trial=0.1), seed) for seed in (1, 1, 2))
    assert one == same
    assert ratios(one) != ratios(other)
    found = ratios(one)
    assert found["coulomb_torque"] == pytest.approx(found["static_torque"])
    assert found["coulomb_torque"] != 1.0
    assert all(found[name] == 1.0 for name in NAMES[2:])
    # A trial's draw does not repeat a day's of the same number.
    day = as_it_is(scattering(day=1), 1)
    assert (found["coulomb_torque"] - 1) / 0.1 != pytest.approx(
        (ratios(day)["coulomb_torque"] - 1) / SCATTER["coulomb_torque"]
    )


def test_lines_that_scatter_one_parameter_multiply() -> None:
    lines = {
        "oil": {"paths": ["coulomb_torque", "viscous_friction"], "relative": 0.1},
        "wear": {"paths": ["coulomb_torque"], "relative": 0.2},
    }

    def torque(*names: str) -> float:
        days = {name: lines[name] for name in names}
        day = {"seed": 5, "day": 1, "day_to_day": days}
        return ratios(of_its_day(bench(lambda tree: tree.update(variation=day))))["coulomb_torque"]

    oil, wear = torque("oil"), torque("wear")
    assert 1.0 not in (oil, wear)
    assert torque("oil", "wear") == pytest.approx(oil * wear, rel=1e-15)


def test_both_directions_scatter_together() -> None:
    changed = as_it_is(scattering(day=2, negative={"coulomb_torque": "28 N m"}), 1)
    load = changed.friction["load"]
    assert load.negative.coulomb_torque / 28.0 == pytest.approx(load.coulomb_torque / 26.0)
    assert load.negative.static_torque is None  # as in the positive direction


def test_the_widest_scatter_leaves_friction() -> None:
    def wild(tree: Tree) -> None:
        days = {"viscous_friction": 0.3}
        tree["variation"] = {"day": 1, "day_to_day": days, "trial_to_trial": torques(0.3)}

    # About one in 1300 is beyond 3.2 sigma, where nothing would be left of 26 N m.
    on = bench(wild)
    found = [as_it_is(on, seed).friction["load"].coulomb_torque for seed in range(4000)]
    assert min(found) == pytest.approx(0.05 * 26.0)


def test_a_preload_raises_the_breakaway_torque_of_the_axis() -> None:
    """By what it says, over all interfaces together: 50 N m instead of 33 is 17 N m more."""

    def at_load(on: Bench, name: str) -> float:
        load, motor = on.friction["load"], on.friction["motor"]
        return float(getattr(load, name) + RATIO * getattr(motor, name))

    changed = as_it_is(preloaded("50 N m", static_torque=1.0, coulomb_torque=0.5), 1)
    gain = at_load(changed, "static_torque") - at_load(bench(), "static_torque")
    assert gain == pytest.approx(17.0)
    gain = at_load(changed, "coulomb_torque") - at_load(bench(), "coulomb_torque")
    assert gain == pytest.approx(8.5)
    more = [changed.friction[n].static_torque / bench().friction[n].static_torque
            for n in ("load", "motor")]  # fmt: skip
    assert more[0] == pytest.approx(more[1])
    assert changed.friction["load"].viscous_friction == 4.0


def test_an_interface_can_be_spared_from_the_preload() -> None:
    def spare(tree: Tree) -> None:
        tree["friction"]["motor"]["preloaded"] = False
        tree["friction"]["load"]["negative"] = {"static_torque": "35 N m"}

    changed = as_it_is(preloaded("50 N m", spare), 1)
    assert changed.friction["motor"].static_torque == 0.04
    assert changed.friction["load"].static_torque == pytest.approx(32.0 + 17.0)
    assert changed.friction["load"].negative.static_torque == pytest.approx(35.0 + 17.0)


def test_a_preload_that_takes_all_friction_away_is_refused() -> None:
    with pytest.raises(ValidationError, match=r"leaves friction\.load with a coulomb_torque of -"):
        preloaded("1 N m", static_torque=0.5, coulomb_torque=1.0)


def test_limits_know_day_preload_and_position() -> None:
    plain = worst_friction(bench(), 0.1)
    assert worst_friction(preloaded("50 N m"), 0.1) == pytest.approx(plain + 17.0)

    def rippled(tree: Tree) -> None:
        tree["friction"]["load"]["ripple"] = {"amplitude": 0.1}

    assert worst_friction(bench(rippled), 0.1) == pytest.approx(plain + 3.2)
    day = scattering(day=3)
    factor = ratios(of_its_day(day))
    static = (32 + 0.04 * RATIO) * factor["static_torque"]
    viscous = (4 + 0.001 * RATIO) * factor["viscous_friction"] * 0.1
    assert worst_friction(day, 0.1) == pytest.approx(static + viscous, rel=1e-9)
