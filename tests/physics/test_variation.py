"""Friction that scatters from day to day and from trial to trial, and grows with the preload."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

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


def test_limits_know_day_and_preload() -> None:
    plain = worst_friction(bench(), 0.1)
    assert worst_friction(preloaded("50 N m"), 0.1) == pytest.approx(plain + 17.0)
    day = scattering(day=3)
    factor = ratios(of_its_day(day))
    static = (32 + 0.04 * RATIO) * factor["static_torque"]
    viscous = (4 + 0.001 * RATIO) * factor["viscous_friction"] * 0.1
    assert worst_friction(day, 0.1) == pytest.approx(static + viscous, rel=1e-9)
