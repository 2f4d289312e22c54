"""Speeds that tell most: against brute force, and on the benches of the coverage tests."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.map_design import (
    COUNTED,
    RIDGE,
    WIDEST,
    curves_around,
    sensitivity,
    telling_speeds,
)
from campaign.estimation.stribeck import PARAMETERS, stribeck
from campaign.experiments import experiments
from campaign.experiments.friction_map.pilot import SPEEDS, pilot_speeds
from campaign.experiments.friction_map.runs import map_speeds
from campaign.physics.true_values import stribeck_parameters
from tests.coverage.benches import BENCHES, make_case

CURVE = {
    "viscous_friction": 4.0, "coulomb_torque": 26.0, "static_torque": 33.0,
    "stribeck_velocity": 0.03, "stribeck_exponent": 1.2,
}  # fmt: skip
BELOW = {**CURVE, "static_torque": 21.0, "stribeck_velocity": 0.05}
PILOT = np.geomspace(0.001, 1.0, 10)


def test_the_sensitivity_is_the_derivative() -> None:
    """By central differences; vs and delta by their logarithm."""
    speed = np.geomspace(1e-3, 1.0, 30)
    found = sensitivity(CURVE, speed)
    for column, name in enumerate(PARAMETERS):
        step = 1e-6 * CURVE[name]
        up, down = ({**CURVE, name: CURVE[name] + s} for s in (step, -step))
        slope = (stribeck(speed, up) - stribeck(speed, down)) / (2 * step)
        scale = CURVE[name] if name in ("stribeck_velocity", "stribeck_exponent") else 1.0
        expected = scale * slope / stribeck(speed, CURVE)
        assert found[:, column] == pytest.approx(expected, rel=1e-6, abs=1e-9), name


def deviations(curve: dict[str, float], speed: np.ndarray) -> np.ndarray:
    """Of the parameters, from points with a relative deviation of 1; by an SVD of the design."""
    _, size, turned = np.linalg.svd(sensitivity(curve, speed), full_matrices=False)
    return np.sqrt(np.sum((turned / size[:, None]) ** 2, axis=0))


@pytest.mark.parametrize("seed", range(20))
def test_each_speed_is_the_best_of_all_candidates(seed: int) -> None:
    """Brute force: the whole design is evaluated with each candidate in turn."""
    chance = np.random.default_rng(seed)
    pilot = 10.0 ** chance.uniform(-3.0, 0.0, 6)
    curves, candidates = (CURVE, BELOW), np.geomspace(0.0011, 0.97, 40)
    weight = np.array([COUNTED.get(name, 1.0) for name in PARAMETERS])
    expected: list[float] = []
    for _ in range(3):
        left = [speed for speed in candidates if speed not in expected]
        cost = [
            sum(weight @ np.log(deviations(c, np.array([*pilot, *expected, v]))) for c in curves)
            for v in left
        ]
        expected.append(left[int(np.argmin(cost))])
    found = telling_speeds(curves, pilot, candidates, 3)
    assert found.tolist() == sorted(expected)


def test_no_candidate_is_taken_twice() -> None:
    candidates = np.geomspace(0.01, 0.5, 6)
    assert telling_speeds([CURVE], PILOT, candidates, 9).tolist() == candidates.tolist()
    assert len(telling_speeds([CURVE], PILOT, candidates, 5)) == 5


def test_a_pilot_that_leaves_a_parameter_open_is_no_error() -> None:
    """Without a Stribeck effect vs and delta say nothing: their columns are zero."""
    flat = {**CURVE, "static_torque": 26.0}
    found = telling_speeds([flat], PILOT, np.geomspace(0.001, 1.0, 50), 10)
    assert len(found) == 10
    assert np.all(np.isfinite(found))
    assert RIDGE < 1e-6


def test_curves_around_what_was_found() -> None:
    """One relative deviation to both sides, and not beyond a factor of two."""
    found = list(curves_around(CURVE, 0.25, np.inf))
    assert [c["stribeck_velocity"] for c in found] == pytest.approx(
        [0.03, 0.0375, 0.024, 0.03, 0.03]
    )
    assert [c["stribeck_exponent"] for c in found] == pytest.approx(
        [1.2, 1.2, 1.2, 1.2 * WIDEST, 1.2 / WIDEST]
    )


SHAPE = ("static_torque", "stribeck_velocity", "stribeck_exponent")


def test_on_every_bench_all_is_known_better_than_from_even_speeds() -> None:
    """As many speeds in all: 10 of the plain map and 30 chosen, against its 40."""
    experiment, ratios = experiments()["velocity_map"], []
    for number in range(BENCHES):
        case = make_case(number)
        options = experiment.options()
        chosen = experiment.fit(options, case.stated)
        options = options.model_copy(update={name: c.value for name, c in chosen.items()})
        plain, pilot = np.array(map_speeds(options)), np.array(pilot_speeds(options))
        true = stribeck_parameters(case.truth, 1.0)
        offered = np.geomspace(plain[0], plain[-1], 121)[1:-1]
        curves = list(curves_around(true, 0.15, 0.2))
        speeds = telling_speeds(curves, pilot, offered, len(plain) - SPEEDS)
        both = np.concatenate([pilot, speeds])
        assert len(both) == len(plain)
        ratios.append(deviations(true, both) / deviations(true, plain))
    by_name = dict(zip(PARAMETERS, np.max(ratios, axis=0), strict=True))
    assert max(by_name[name] for name in SHAPE) <= 1.0, "on every bench"
    assert max(by_name.values()) <= 1.07, "and the others hardly less well on any"
    median = dict(zip(PARAMETERS, np.median(ratios, axis=0), strict=True))
    assert median["static_torque"] < 0.85
    assert median["stribeck_velocity"] < 0.85
