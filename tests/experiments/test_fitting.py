"""Options that a test does not write follow from its bench: its plan then breaks no limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.experiments import experiments
from campaign.experiments.friction_map.runs import plan_run
from campaign.experiments.shared.rig import Rig
from campaign.experiments.shared.rounded_choices import Choices, nice
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.limits import margins, worst_friction
from campaign.protocol.bench_file import load_bench
from campaign.trial import TrialRequest
from tests.coverage.benches import make_case
from tests.physics.random_benches import Draw, random_bench
from tests.physics.test_data_sheet import motor

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


def test_a_light_load_is_ramped_and_recorded_as_fast_as_it_slides_away() -> None:
    """J vs over the fall of friction to vs: 400 times that up to breakaway, 40 samples in it."""
    platform = load_bench("platform")
    slow, _ = fitted("breakaway", platform)
    controller = platform.controller.model_copy(update={"sample_rate": 1e4})
    axis = platform.axis.model_copy(update={"inertia": platform.axis.inertia / 100.0})
    light = platform.model_copy(update={"controller": controller, "axis": axis})
    options, reasons = fitted("breakaway", light)
    assert options.sample_rate == 1e4
    assert options.torque_rate > 10.0 * slow.torque_rate
    assert "e-fold" in reasons["torque_rate"]
    assert "e-fold" in reasons["sample_rate"]


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


@pytest.mark.parametrize("number", [1, 5, 12, 29])
def test_the_fastest_run_settles_before_it_is_measured(number: int) -> None:
    """Ten time constants of the loop, which are 1.8 to 2.2 s here, and half a second behind them.

    Half a second of settling left 0.6 % of viscous friction in the acceleration, which an inertia
    that is stated 40 % too small does not take out.
    """
    bench = make_case(number).stated
    options, _ = fitted("velocity_map", bench)
    run = plan_run(options.fastest, options)
    assert Rig(bench).loop_time > 1.0
    assert run.settle == pytest.approx(Rig(bench).loop_time, rel=0.1)
    assert run.window >= 0.45


def test_a_drive_that_cannot_overcome_friction_is_told() -> None:
    bench = limited(4)
    weak = bench.limits.model_copy(update={"torque": 0.5 * float(Rig(bench).static_torque or 0)})
    for kind in ("velocity_map", "breakaway"):
        with pytest.raises(ValueError, match="nothing would move"):
            fitted(kind, bench.model_copy(update={"limits": weak}))


def hurried(bench: Bench, duration: float) -> Bench:
    return bench.model_copy(
        update={"limits": bench.limits.model_copy(update={"duration": duration})}
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("duration", [3.0, 10.0, 20.0, 60.0])
@pytest.mark.parametrize("seed", range(6))
def test_short_trials_are_planned(kind: str, duration: float, seed: int) -> None:
    """A limit of duration costs cycles, low frequencies and slow speeds, and not the test."""
    bench = hurried(limited(seed).with_friction({}), duration)
    asked = requests(kind, bench)
    assert asked
    for request in asked:
        broken = [margin for margin in margins(bench, request.task) if margin.broken]
        assert not broken, (request.point, broken)


@pytest.mark.parametrize("duration", [1.5, 3.0, 20.0])
def test_a_sweep_begins_where_its_cycles_fit(duration: float) -> None:
    """19 cycles, or 16 and 0.3 s rounded up to whole ones, take nine tenths of the limit."""
    asked = requests("frequency_response", hurried(limited(1), duration))
    longest = max(request.task.duration for request in asked)
    assert 0.8 * duration < longest <= 0.9 * duration


def test_a_sweep_without_an_octave_is_told() -> None:
    """17 cycles and 0.3 s in 0.9 of 0.5 s are at 113 Hz, and the loop is swept to 100 Hz."""
    with pytest.raises(ValueError, match="a sweep would begin at 113 Hz"):
        fitted("frequency_response", hurried(load_bench("simulink"), 0.5))


def test_no_time_for_a_run_is_told() -> None:
    with pytest.raises(ValueError, match=r"the limit of duration, 1\.5 s, leaves no time"):
        fitted("velocity_map", hurried(limited(1), 1.5))


def test_a_sine_has_fewer_cycles_before_it_gets_faster() -> None:
    """8 cycles of 0.24 Hz take 33 s; 90 % of 20 s hold 4, and 90 % of 3 s three of 1.2 Hz."""
    slow, _ = fitted("stabilization", hurried(limited(1), 20.0))
    assert (slow.frequency, slow.settle_cycles, slow.cycles) == (0.24, 1, 3)
    fast, reasons = fitted("stabilization", hurried(limited(1), 3.0))
    assert (fast.frequency, fast.settle_cycles, fast.cycles) == (1.2, 1, 2)
    assert "duration" in reasons["frequency"]
    own, reasons = fitted("stabilization", hurried(limited(1), 3.0), frequency="0.24 Hz")
    assert own.frequency == 0.24
    assert "frequency" not in reasons


@pytest.mark.parametrize("kind", KINDS)
def test_a_telescopes_axis_is_planned(kind: str) -> None:
    """0.01 deg/s and 0.001 deg/s^2 at most, and nobody knows its friction."""
    bench = limited(2).with_friction({})
    limits = bench.limits.model_copy(
        update={"rate": 0.01 * DEG, "acceleration": 0.001 * DEG, "angle": 5 * DEG}
    )
    bench = bench.model_copy(
        update={"limits": limits, "sensors": type(bench.sensors)(), "appendage": None}
    )
    for request in requests(kind, bench):
        assert not [margin for margin in margins(bench, request.task) if margin.broken]
        if request.task.stop_rate is not None:
            assert request.task.stop_rate <= 0.4 * limits.rate * (1 + 1e-12)


def within(bench: Bench, **limits: float) -> Bench:
    return bench.model_copy(update={"limits": bench.limits.model_copy(update=limits)})


@pytest.mark.parametrize(
    ("kind", "limits"),
    [
        ("step_response", {"angle": 0.5 * DEG}),
        ("observer_gain", {"duration": 12.0}),
        ("observer_gain", {"duration": 30.0, "angle": 5.0 * DEG}),
    ],
)
def test_the_platform_with_narrower_limits_is_planned(kind: str, limits: dict[str, float]) -> None:
    bench = within(load_bench("platform"), **limits)
    for request in requests(kind, bench):
        assert not [margin for margin in margins(bench, request.task) if margin.broken]


@pytest.mark.parametrize("kind", ["step_response", "frequency_response"])
def test_no_room_to_move_is_told(kind: str) -> None:
    bench = within(load_bench("platform"), angle=10.0 * DEG)
    for position in ("10 deg", "-20 deg"):
        with pytest.raises(ValueError, match="no room to move: the position"):
            fitted(kind, bench, position=position)


def test_a_ramp_needs_room_for_what_creeps_before_it_gives_way() -> None:
    """Twice Ts / sigma0 in half of the angle: at less a load passes its limit before it slides."""
    bench = load_bench("simulink")
    creep = 2 * float(Rig(bench).presliding or 0.0)
    assert fitted("breakaway", within(bench, angle=2.01 * creep))
    with pytest.raises(ValueError, match=r"creeps .* before friction gives way"):
        fitted("breakaway", within(bench, angle=1.99 * creep))


def test_what_counts_as_sliding_stays_within_the_limits() -> None:
    """A tenth of the rate limit, and four seconds of it half of the angle; above the noise."""
    bench = load_bench("simulink").with_friction({})
    slow, reasons = fitted("breakaway", within(bench, rate=0.01 * DEG))
    assert slow.sliding_rate == pytest.approx(0.001 * DEG)
    assert "rate limit" in reasons["sliding_rate"]
    near, reasons = fitted("breakaway", within(bench, angle=0.08 * DEG))
    assert near.sliding_rate == pytest.approx(0.01 * DEG)
    assert "angle limit" in reasons["sliding_rate"]
    with pytest.raises(ValueError, match="six deviations of the gyro's noise"):
        fitted("breakaway", within(load_bench("platform"), rate=0.1 * DEG))
    own, _ = fitted(
        "breakaway", within(load_bench("platform"), rate=0.1 * DEG), sliding_rate="0.05 deg/s"
    )
    assert own.sliding_rate == pytest.approx(0.05 * DEG)


def bench_top() -> Bench:
    """A motor that turns for ever, without gear and gyro (`tests.physics.test_data_sheet`)."""
    tree = motor(sensors={"encoder": {"lines": 2000}})
    tree["controller"] |= {"sample_rate": "1 kHz", "rate_feedback": "encoder"}
    tree["limits"] = {**tree["limits"], "rate": "60 rad/s"}
    return Bench.model_validate(tree)


def test_speeds_of_a_map_follow_from_the_limits_of_its_rig() -> None:
    """A motor of 60 rad/s was mapped up to 1 % of that: its travel was a usual size, 60 deg."""
    options, reasons = fitted("velocity_map", bench_top())
    assert 0.6 * 60 < options.fastest < 60
    assert "rate limit" in reasons["fastest"]
    run = plan_run(options.fastest, options)
    assert run.settled >= options.window_time


def test_a_choice_that_equals_the_default_is_told_too() -> None:
    options = experiments()["velocity_map"].options()
    choices = Choices(options)
    assert choices.take("points", options.points, "why") == options.points
    assert choices.told["points"].reason == "why"


def test_an_amplitude_leaves_room_for_noise_and_overshoot() -> None:
    """The limit watch sees n Tc of an encoder's noise as sqrt(2) sigma / (n Tc); here 10 ms."""
    quiet = load_bench("platform")
    noise = 0.02 * DEG
    encoder = quiet.sensors.encoder.model_copy(update={"noise": noise, "resolution": 0.0})
    sensors = quiet.sensors.model_copy(update={"encoder": encoder})
    noisy = quiet.model_copy(update={"sensors": sensors})
    assert quiet.limits.rate - Rig(noisy).rate_left == pytest.approx(
        6 * math.sqrt(2) * noise / 0.01, rel=1e-9
    )
    slow = quiet.limits.model_copy(update={"rate": 20.0 * DEG})
    few, reasons = fitted("frequency_response", noisy.model_copy(update={"limits": slow}))
    left = (20.0 * DEG - 6 * math.sqrt(2) * noise / 0.01) / Rig(noisy).overshoot
    assert few.amplitude <= 0.7 * left
    assert "overshoots" in reasons["amplitude"]


def test_the_noise_of_a_rate_that_is_made_of_the_encoder() -> None:
    """Filtered differences of white noise, against their simulation."""
    bench = bench_top()
    controller = bench.controller.model_copy(update={"relative_rate_filter": 2e-3})
    rig = Rig(bench.model_copy(update={"controller": controller}))
    count = 2 * math.pi / 8000
    angle = np.random.default_rng(1).normal(0.0, count / math.sqrt(12), 200_000)
    pole, rate = math.exp(-0.5), np.zeros(len(angle))
    for k in range(1, len(angle)):
        rate[k] = pole * rate[k - 1] + (1 - pole) * (angle[k] - angle[k - 1]) / 1e-3
    assert rig.rate_noise == pytest.approx(float(np.std(rate)), rel=0.01)


@pytest.mark.parametrize("kind", ["velocity_map", "frequency_response"])
def test_a_loop_that_answers_one_count_with_all_of_its_torque_is_refused(kind: str) -> None:
    """One count is 45 mdeg in 1 ms: 0.79 rad/s, which a gain of 13 A s/rad makes 10 A of."""
    rig = bench_top()
    loud = rig.controller.rate.model_copy(update={"proportional": 14.0})
    controller = rig.controller.model_copy(update={"rate": loud})
    with pytest.raises(ValueError, match="answers one count of the rate's sensor"):
        fitted(kind, rig.model_copy(update={"controller": controller}))


def unbounded(bench: Bench) -> Bench:
    limits = bench.limits.model_copy(update={"angle": math.inf})
    return bench.model_copy(update={"limits": limits})


@pytest.mark.parametrize("endless", [False, True])
def test_starts_are_spread_over_half_of_the_limits_and_runs_end_within_it(endless: bool) -> None:
    """Fast runs that take the whole of max_travel began at one place: a ripple bent the curve."""
    bench = unbounded(load_bench("platform")) if endless else load_bench("platform")
    written = {"max_travel": "17 deg", "warm_up_cycles": 0}
    spread = requests("velocity_map", bench, spread_starts=True, **written)
    options, _ = fitted("velocity_map", bench, spread_starts=True, **written)
    half = 0.25 * math.pi if endless else 0.5 * bench.limits.angle
    assert half > 0.3
    places = [request.task.start_angle for request in spread]
    runs = [plan_run(float(str(request.point["speed"])), options) for request in spread]
    ends = [at + run.speed * (run.ramp + run.cruise) for at, run in zip(places, runs, strict=True)]
    assert min(places) >= -half - 1e-9
    assert max(ends) <= half + 1e-9
    room = [2.0 * half - end + at for at, end in zip(places, ends, strict=True)]
    shares = [(at + half) / left for at, left in zip(places, room, strict=True) if left > 0.1]
    assert np.max(np.diff(np.sort([0.0, *shares, 1.0]))) < 0.1, "and leave no gap between them"
    plain = requests("velocity_map", bench, **written)
    assert {request.task.start_angle for request in plain} == {-0.5 * options.max_travel}


def test_a_sweep_leaves_torque_for_friction_that_nobody_described() -> None:
    """Half of it; and friction's harmonics do not fold onto the sine."""
    bare = load_bench("platform").model_copy(update={"friction": {}})
    options, told = fitted("frequency_response", bare)
    rig = Rig(bare)
    largest = getattr(options, "max_acceleration")  # noqa: B009 - of its own options
    assert largest <= 0.5 * rig.accelerated_by(rig.torque)
    assert "unknown friction" in told["max_acceleration"] or largest <= bare.limits.acceleration
    assert getattr(options, "samples_per_cycle") == 100  # noqa: B009
