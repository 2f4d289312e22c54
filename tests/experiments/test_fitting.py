"""Options that a test does not write follow from its bench: its plan then breaks no limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.experiments import experiments
from campaign.experiments.fitting import nice
from campaign.experiments.rig import Rig
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.limits import margins, worst_friction
from campaign.protocol.bench_file import load_bench
from campaign.trial import TrialRequest
from tests.physics.random_benches import Draw, random_bench

KINDS = ("velocity_map", "breakaway", "frequency_response", "stabilization", "step_response")
DEG = math.pi / 180


def fitted(kind: str, bench: Bench, **written: object) -> tuple[Options, dict[str, str]]:
    """Options of a test that writes `written` alone, as a plan has them, and the reasons."""
    experiment = experiments()[kind]
    assert experiment.fit is not None
    options = experiment.options.model_validate(written)
    chosen = experiment.fit(options, bench)
    values = {name: choice.value for name, choice in chosen.items()}
    return options.model_copy(update=values), {n: c.reason for n, c in chosen.items()}


def requests(kind: str, bench: Bench, **written: object) -> list[TrialRequest]:
    return list(experiments()[kind].trials(fitted(kind, bench, **written)[0], bench))


def limited(seed: int) -> Bench:
    """A random bench with limits as laboratories have them, around what its friction asks."""
    bench, _ = random_bench(seed, extreme=False)
    draw, rig = Draw(77, seed), Rig(bench)
    assert rig.stribeck_velocity is not None
    rate = rig.stribeck_velocity * draw.log(20, 500)
    torque = worst_friction(bench, rate) * draw.log(2.0, 20.0)
    limits = bench.limits.model_copy(
        update={
            "angle": draw.log(3.0, 170.0) * DEG,
            "rate": rate,
            "acceleration": torque / bench.axis.inertia * draw.log(0.3, 2.0),
            "torque": torque,
            "current": torque / bench.torque_per_current * draw.log(0.8, 2.0),
            "duration": draw.log(150.0, 3600.0),
        }
    )
    return bench.model_copy(update={"limits": limits})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(12))
def test_what_is_chosen_breaks_no_limit(kind: str, seed: int) -> None:
    bench = limited(seed)
    asked = requests(kind, bench)
    assert asked
    for request in asked:
        broken = [margin for margin in margins(bench, request.task) if margin.broken]
        assert not broken, (request.point, broken)


@pytest.mark.parametrize("kind", KINDS)
def test_friction_that_is_not_described_is_told(kind: str) -> None:
    bench = limited(3).with_friction({})
    for request in requests(kind, bench):
        assert not [margin for margin in margins(bench, request.task) if margin.broken]


def test_a_map_waits_for_frictions_own_memory() -> None:
    """Ts / sigma0 of 0.153 deg: with the 0.75 deg of another bench Ts was nine deviations off."""
    bench = load_bench("simulink")
    static = bench.friction["load"].static_torque
    soft = bench.friction["load"].model_copy(
        update={"bristle_stiffness": static / (0.153 * DEG), "ripple": _none(bench)}
    )
    options, reasons = fitted("velocity_map", bench.with_friction({"load": soft}))
    assert options.settle_angle == pytest.approx(1.5 * DEG)  # ten times, to two digits
    assert "0.15 deg" in reasons["settle_angle"]


def _none(bench: Bench) -> object:
    return bench.friction["load"].ripple.model_copy(update={"amplitude": 0.0})


def test_what_a_test_writes_stays() -> None:
    bench = limited(5)
    written = {"peak_torque": "0.5 N m", "positions": ["0 deg"]}
    options, reasons = fitted("breakaway", bench, **written)
    assert (options.peak_torque, options.positions) == (0.5, (0.0,))
    assert not {"peak_torque", "positions"} & reasons.keys()
    own, reasons = fitted("frequency_response", bench, frequencies=["3 Hz"])
    assert own.frequencies == (3.0,)
    assert "frequencies" not in reasons


def test_a_noisy_gyro_raises_what_counts_as_sliding() -> None:
    bench = limited(1)
    gyro = bench.sensors.gyro.model_copy(update={"noise": bench.limits.rate / 100})
    noisy = bench.model_copy(update={"sensors": bench.sensors.model_copy(update={"gyro": gyro})})
    options, reasons = fitted("breakaway", noisy)
    assert options.sliding_rate >= 6 * gyro.noise
    assert "noise" in reasons["sliding_rate"]


@pytest.mark.parametrize(
    ("value", "unit", "up", "expected"),
    [
        (0.0123456, "N m", False, 0.012),
        (0.0123456, "N m", True, 0.013),
        (-0.98765, "N m", False, -0.98),
        (0.012, "N m", True, 0.012),
        (1.0, "deg", False, 57 * DEG),
    ],
)
def test_few_digits_towards_the_safe_side(
    value: float, unit: str, up: bool, expected: float
) -> None:
    assert nice(value, unit, up=up) == pytest.approx(expected, rel=1e-12)


def test_speeds_between_slowest_and_fastest() -> None:
    speeds = [r.point["speed"] for r in requests("velocity_map", limited(2)) if r.point]
    steps = np.diff(np.log(np.array(speeds[1:], dtype=float)))
    assert np.allclose(steps, steps[0])


def test_a_drive_that_cannot_overcome_friction_is_told() -> None:
    bench = limited(4)
    weak = bench.limits.model_copy(update={"torque": 0.5 * float(Rig(bench).static_torque or 0)})
    for kind in ("velocity_map", "breakaway"):
        with pytest.raises(ValueError, match="nothing would move"):
            fitted(kind, bench.model_copy(update={"limits": weak}))
