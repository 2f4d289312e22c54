"""A trial's samples do not depend on its company: to the bit, whatever runs beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from campaign.physics.lanes import Lane
from campaign.physics.rows import OUTPUTS
from campaign.physics.simulate import simulate, simulate_together
from campaign.physics.vector import LANES
from campaign.signals import Polyline, Sine
from campaign.trial import Task
from tests.physics.benches import Tree, bench, stribeck, task

STEP = 0.25e-3
SWING = {"base_acceleration": Sine(amplitude=1.5, frequency=1.0)}
PUSH = Polyline(times=(0.0, 0.3), values=(0.0, 60.0))
TURN = Polyline(times=(0.0, 0.1, 0.3), values=(0.0, 0.2, -0.2))


def rippled(tree: Tree) -> None:
    tree["friction"]["load"]["ripple"] = {"amplitude": 0.2, "periods": 67, "phase": "0.3 rad"}


def another_exponent(tree: Tree) -> None:
    tree["friction"]["load"]["stribeck_exponent"] = 1.3
    tree["friction"]["motor"]["negative"] = {"stribeck_exponent": 0.7}


def filtered(tree: Tree) -> None:
    tree["controller"]["relative_rate_filter"] = "2 ms"


def dry(tree: Tree) -> None:
    tree["friction"] = {"load": stribeck(32.0, 26.0, 4.0)}


def dry_and_rippled(tree: Tree) -> None:
    dry(tree)
    tree["friction"]["load"]["ripple"] = {"amplitude": 0.2, "periods": 67, "phase": "0.3 rad"}
    tree["friction"]["load"]["stribeck_exponent"] = 1.3
    tree["controller"]["relative_rate_filter"] = "2 ms"


def dry_and_bristles(tree: Tree) -> None:
    motor = tree["friction"]["motor"]
    dry(tree)
    tree["friction"]["motor"] = motor


def elastic(tree: Tree) -> None:
    tree["appendage"] = {"inertia": "3 kg m^2", "frequency": "12 Hz", "damping_ratio": 0.02}


def sampled(tree: Tree) -> None:
    tree["controller"] |= {"sample_rate": "1 kHz", "delay": "0.4 ms"}
    tree["sensors"] = {
        "gyro": {"noise": "1e-4 rad/s", "delay": "1 ms"},
        "encoder": {"resolution": "1e-6 rad", "noise": "2e-6 rad"},
    }


CASES: dict[str, tuple[Callable[[Tree], object] | None, dict[str, object]]] = {
    "none": (None, SWING),
    "lugre": (None, {**SWING, "compensation": "lugre"}),
    "static": (None, {**SWING, "compensation": "static"}),
    "observer": (None, {**SWING, "compensation": "observer"}),
    "filtered": (filtered, {**SWING, "compensation": "lugre"}),
    "rippled": (rippled, SWING),
    "another exponent": (another_exponent, SWING),
    "dry": (dry, SWING),
    "dry, static": (dry, {**SWING, "compensation": "static"}),
    "dry, rippled, lugre, filtered": (dry_and_rippled, {**SWING, "compensation": "lugre"}),
    "dry, rippled, static, filtered": (dry_and_rippled, {**SWING, "compensation": "static"}),
    "dry and bristles": (dry_and_bristles, SWING),
    "dry, sampled": (lambda tree: (dry(tree), sampled(tree)), SWING),
    "dry, spring": (dry, {"mode": "spring", "command": PUSH, "spring_stiffness": 900.0}),
    "elastic": (elastic, SWING),
    "sampled": (sampled, {**SWING, "command": TURN}),
    "sampled, static": (sampled, {**SWING, "compensation": "static"}),
    "sampled, lugre": (sampled, {**SWING, "compensation": "lugre"}),
    "torque": (None, {"mode": "torque", "command": PUSH, "disturbance": TURN}),
    "prescribed": (rippled, {"mode": "prescribed", "command": TURN, "compensation": "lugre"}),
    "spring": (None, {"mode": "spring", "command": PUSH, "spring_stiffness": 900.0}),
}


def trials(case: str, count: int) -> list[Lane]:
    """Trials of one structure, each with an inertia, a friction, a length and a seed of its own."""
    edit, fields = CASES[case]

    def one(number: int) -> Lane:
        def own(tree: Tree) -> None:
            if edit is not None:
                edit(tree)
            tree["axis"]["inertia"] = f"{35.0 + number} kg m^2"
            tree["friction"]["load"]["static_torque"] = f"{32.0 + 0.3 * number!r} N m"

        on = task(**{"duration": 0.2 + 0.01 * (number % 7), **fields})
        return Lane.of(bench(own), on, seed=number, longest_step=STEP)

    return [one(number) for number in range(count)]


def outputs(together: Sequence[Lane]) -> list[np.ndarray]:
    """Of each trial, shape (8, n)."""
    blocks = [out for _, out in simulate_together(together)]
    return [np.hstack(own) for own in zip(*blocks, strict=True)]


@pytest.mark.parametrize("case", CASES)
def test_samples_are_the_same_to_the_bit_in_any_company(case: str) -> None:
    lanes = trials(case, LANES)
    alone = [outputs([lane])[0] for lane in lanes]
    assert len({out.tobytes() for out in alone}) == LANES  # no two are alike
    assert np.ptp(alone[0][OUTPUTS.index("friction_torque")]) > 0.0
    random = np.random.default_rng(7)
    for count in (2, 3, LANES - 1, LANES):
        chosen = [int(number) for number in random.permutation(LANES)[:count]]
        for number, out in zip(chosen, outputs([lanes[n] for n in chosen]), strict=True):
            assert out.tobytes() == alone[number].tobytes(), f"{number} in {chosen}"


def test_alone_is_what_simulate_gives() -> None:
    (lane,) = trials("lugre", 1)
    blocks = list(simulate(lane.bench, lane.task, lane.seed, STEP))
    assert np.hstack([out for _, out in blocks]).tobytes() == outputs([lane])[0].tobytes()


@pytest.mark.parametrize("case", ["sampled", "dry, sampled"])
def test_a_trial_that_diverges_changes_no_neighbour(case: str) -> None:
    """It goes on as numbers that are none, in its own lane."""

    def unstable(tree: Tree) -> None:
        CASES[case][0](tree)  # type: ignore[misc]
        tree["controller"]["rate"]["proportional"] = "3e9 A s/rad"

    lanes = trials(case, 4)
    wild = Lane.of(bench(unstable), lanes[0].task, seed=1, longest_step=STEP)
    before = outputs(lanes)
    with np.errstate(all="ignore"):
        *others, diverged = outputs([*lanes, wild])
    assert not np.isfinite(diverged).all()
    assert [out.tobytes() for out in others] == [out.tobytes() for out in before]


def test_each_ends_with_its_own_length() -> None:
    lanes = trials("none", 3)
    assert [out.shape for out in outputs(lanes)] == [
        (len(OUTPUTS), lane.grid.samples) for lane in lanes
    ]
    assert len({lane.grid.samples for lane in lanes}) == 3


@pytest.mark.parametrize("count", [0, LANES + 1])
def test_as_many_as_fit_go_together(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} trials cannot be simulated together"):
        list(simulate_together(trials("none", 1) * count))


def test_only_trials_of_one_structure_go_together() -> None:
    with pytest.raises(ValueError, match="one structure"):
        list(simulate_together([*trials("none", 1), *trials("lugre", 1)]))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("none", "filtered"), ("none", "another exponent"), ("none", "rippled"),
        ("none", "elastic"), ("none", "sampled"), ("lugre", "static"), ("none", "dry"),
    ],
)  # fmt: skip
def test_what_takes_other_code_is_another_structure(one: str, other: str) -> None:
    """Else a lane's last bits could depend on what its neighbours need."""
    (first,), (second,) = trials(one, 1), trials(other, 1)
    if one == "none" and other == "filtered":  # it matters to who compensates only
        first, second = trials("lugre", 1)[0], second
    assert first.structure != second.structure


def test_numbers_are_no_structure() -> None:
    assert len({lane.structure for lane in trials("sampled, lugre", 5)}) == 1


def test_only_noisy_sensors_draw() -> None:
    """So a sensor that is added without noise changes no trial."""

    def without(tree: Tree) -> None:
        sampled(tree)
        tree["sensors"]["current"] = {"delay": "1 ms"}

    def own(edit: Callable[[Tree], None]) -> np.ndarray:
        fields: Task = task(duration=0.1, **SWING)
        return outputs([Lane.of(bench(edit), fields, seed=3)])[0]

    gyro, load = OUTPUTS.index("gyro_rate"), OUTPUTS.index("load_rate")
    first, second = own(sampled), own(without)
    assert first[gyro].tobytes() == second[gyro].tobytes()
    assert math.isclose(first[load].std(), second[load].std())
