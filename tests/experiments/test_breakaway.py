"""Breakaway ramps on a bench whose bristles are known."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from campaign.channels import GYRO_RATE
from campaign.estimate import OF_ONE_TRIAL, Estimate, Kind, Origin, Systematic
from campaign.estimation.intervals import with_error
from campaign.experiments import experiments
from campaign.experiments.breakaway.experiment import _damping, default_positions
from campaign.experiments.breakaway.figures import DOTS, _what_shows
from campaign.experiments.breakaway.means import Ramps, _between, _shift, mean
from campaign.physics.bench import Bench
from campaign.result import Result
from tests.estimation.coverage import holds, rejected
from tests.experiments.laboratory import (
    MADE_UP,
    Done,
    analyse,
    execute,
    failed,
    finding,
    table,
    trials,
)
from tests.physics.benches import SIMULINK, bench

PLATFORM = SIMULINK.with_name("platform.toml")

RATIO = 141.176
TWO = {
    "positions": ["-20 deg", "10 deg"],
    "torque_rate": "2 N m/s",
    "directions": ["positive"],
}


OFF = np.array([-1.0, 0.0, 1.0])


def load_only(tree: dict[str, Any]) -> None:
    del tree["friction"]["motor"]


def result_of(edit: Any = None, options: dict[str, Any] = TWO) -> Result:
    return analyse("breakaway", execute(trials("breakaway", bench(edit), options)))


def test_stiffness_of_the_load_side_alone() -> None:
    result = result_of(load_only)
    mean = finding(result, "bristle_stiffness", statistic="mean")
    assert mean.value == pytest.approx(18000.0, rel=0.02)
    (first, *_) = table(result, "presliding").rows
    assert first["interfaces"] == 1
    assert float(str(first["chord"])) < 0.7 * 18000.0
    # The slow ramp breaks away just below Ts, and never above.
    assert 0.97 * 32.0 < float(str(first["breakaway_torque"])) <= 32.0


def test_with_both_interfaces_the_stiffnesses_add_until_the_motor_side_slips() -> None:
    result = result_of()
    after = finding(result, "bristle_stiffness", statistic="mean")
    at_rest = finding(result, "stiffness_at_rest", statistic="mean")
    assert after.value == pytest.approx(18000.0, rel=0.02)
    assert at_rest.value == pytest.approx(18000.0 + RATIO * 1000.0, rel=0.02)
    assert any("two slopes" in note for note in result.notes)


def test_damping_is_assumed_and_says_so() -> None:
    """2 zeta sqrt(sigma0 J) - sigma2, with the stiffness that was found."""
    result = result_of(load_only)
    stiffness = finding(result, "bristle_stiffness", statistic="mean").value
    damping = finding(result, "bristle_damping", statistic="mean").value
    assert damping == pytest.approx(1.6 * np.sqrt(stiffness * 35.0) - 4.0, rel=1e-6)
    assert any("assumed" in note for note in result.notes)
    columns = {column.name: column.label for column in table(result, "presliding").columns}
    assert "assumed" in columns["bristle_damping"]


def test_damping_carries_the_interval_of_the_stiffness() -> None:
    """d sigma1 / d sigma0 = zeta sqrt(J / sigma0); three ramps, t(2) = 4.303."""
    stiffness = with_error("bristle_stiffness", 15000.0, "N m/rad", 300.0, 20.0, "", systematic=())
    slope = 0.8 * np.sqrt(35.0 / 15000.0)
    one = _damping(stiffness, 1150.0, slope)
    assert one.half_width == pytest.approx(slope * stiffness.half_width)
    assert one.origin is Origin.ASSUMED
    places = [slope * x for x in (-600.0, 0.0, 600.0)]
    bare = Estimate("bristle_stiffness", 15000.0, "N m/rad")
    rule = [_damping(bare, 1150.0 + x, slope) for x in places]
    assert not mean("bristle_damping", rule).has_interval
    known = [replace(one, value=1150.0 + x, low=1140.0 + x, high=1160.0 + x) for x in places]
    found = mean("bristle_damping", known)
    assert found.half_width == pytest.approx(4.303 * slope * 600.0 / np.sqrt(3.0), rel=1e-3)
    assert (found.origin, found.reason) == (one.origin, one.reason)


def test_the_window_matters_little_and_is_reported() -> None:
    window = table(result_of(load_only), "window")
    rows = window.rows
    assert "scatter between ramps alone" in window.note  # the same mean has another interval above
    assert [row["share"] for row in rows] == [0.5, 0.65, 0.8, 0.9]
    for row in rows:
        assert row["mean"] == pytest.approx(18000.0, rel=0.03)


def test_the_ramp_may_begin_at_once() -> None:
    """Without a rest the angle still counts from where the ramp began, not from zero."""
    options = {**TWO, "positions": ["10 deg"], "rest": "0 s"}
    result = result_of(load_only, options)
    found = finding(result, "bristle_stiffness", statistic="mean")
    assert found.value == pytest.approx(18000.0, rel=0.02)


def test_ten_positions() -> None:
    positions = np.rad2deg(default_positions())
    np.testing.assert_allclose(positions, np.linspace(-45.0, 45.0, 10))
    planned = trials("breakaway", bench(), {})
    assert [trial.task.start_angle for trial in planned] == 2 * list(default_positions())
    assert [trial.point["direction"] for trial in planned] == 10 * ["positive"] + 10 * ["negative"]


def test_a_ramp_that_ends_below_breakaway_is_told() -> None:
    result = result_of(load_only, {**TWO, "peak_torque": "20 N m"})
    assert result.tables == ()
    assert ["below breakaway" in each.reason.text for each in result.left_out] == [True, True]


def test_failed_trials_and_empty_tests() -> None:
    done = list(execute(trials("breakaway", bench(load_only), TWO)))
    result = analyse("breakaway", [failed(done[0]), done[1]])
    assert len(table(result, "presliding").rows) == 2  # one measurement and the mean
    assert any("1 of 2 trials" in note for note in result.notes)
    assert analyse("breakaway", [failed(item) for item in done]).findings == ()
    assert analyse("breakaway", ()).tables == ()


def platform(edit: Any = None) -> Bench:
    tree = tomllib.loads(PLATFORM.read_text(encoding="utf-8"))
    del tree["known"]  # an edited bench is another
    if edit is not None:
        edit(tree)
    return Bench.model_validate(tree)


def small(tree: dict[str, Any]) -> None:
    """A direct drive of 0.02 kg m^2 with a 12-bit encoder: presliding spans 1.7 of its counts."""
    for name in ("variation", "appendage"):
        del tree[name]
    tree["compensation"] = {}
    tree["axis"]["inertia"] = "0.02 kg m^2"
    tree["gear"] = {"ratio": 1.0}
    tree["motor"] |= {"torque_constant": "0.05 N m/A", "back_emf_constant": "0.05 V s/rad"}
    tree["motor"] |= {"resistance": "1 ohm", "inductance": "1 mH"}
    tree["friction"] = {
        "load": {
            "model": "lugre",
            "static_torque": "0.16 N m",
            "coulomb_torque": "0.12 N m",
            "stribeck_velocity": "0.05 rad/s",
            "stribeck_exponent": 1.2,
            "viscous_friction": "0.02 N m s/rad",
            "bristle_stiffness": "60 N m/rad",
            "bristle_damping": "0.3 N m s/rad",
        }
    }
    tree["controller"] |= {
        "sample_rate": "2 kHz",
        "rate": {"form": "parallel", "proportional": "5 A s/rad", "integral": "20 A/rad"},
        "current": {"form": "parallel", "proportional": "2 V/A", "integral": "2000 V/(A s)"},
    }
    tree["sensors"] = {
        "gyro": {"noise": "0.02 deg/s", "resolution": "0.001 deg/s"},
        "encoder": {"resolution": f"{360 / 4096} deg"},
        "current": {"noise": "2 mA", "resolution": "1 mA"},
    }
    tree["limits"] |= {"torque": "2 N m", "current": "20 A"}


SMALL = {
    "positions": ["0 deg"],
    "torque_rate": "0.02 N m/s",
    "peak_torque": "0.4 N m",
    "sliding_rate": "0.02 rad/s",
    "rest": "2.5 s",
}


def test_both_directions_have_means_of_their_own_and_a_nominal_one() -> None:
    options = {"positions": ["-20 deg", "0 deg", "20 deg"], "rest": "5 s"}
    result = analyse("breakaway", execute(trials("breakaway", platform(), options)))
    means = {
        direction: finding(result, "breakaway_torque", statistic="mean", direction=direction)
        for direction in ("positive", "negative", "both")
    }
    # Ts of load, motor, gearbox and mesh; a ramp of 1 N m/s breaks away a few percent below.
    assert 0.95 * 32.7 < means["positive"].value < 32.7
    assert 0.95 * 35.1 < means["negative"].value < 35.1
    one, other = means["positive"].estimate, means["negative"].estimate
    nominal = means["both"].estimate
    assert one is not None
    assert other is not None
    assert nominal is not None
    assert nominal.value == pytest.approx(0.5 * (one.value + other.value))
    assert nominal.standard_error == pytest.approx(
        0.5 * np.hypot(one.standard_error, other.standard_error)
    )
    rows = table(result, "presliding").rows
    assert [row["direction"] for row in rows] == (
        3 * ["positive"] + 3 * ["negative"] + ["both", "positive", "negative"]
    )
    *directions, whole = result.figures[-1].panels[0].curves
    assert [curve.series for curve in directions] == ["positive", "negative"]
    assert whole.y.tolist() == [finding(result, "breakaway_torque", direction="both").value]


def test_every_number_has_an_interval_or_says_why() -> None:
    for planned in (
        trials("breakaway", platform(), {"positions": ["0 deg", "10 deg", "20 deg"]}),
        trials("breakaway", bench(), TWO),
    ):
        result = analyse("breakaway", execute(planned))
        assert all(found.estimate is not None for found in result.findings)
        assert all(found.known.says_enough for found in result.findings)
        for told in result.tables:
            for column in told.columns:
                cells = [row.get(column.name) for row in told.rows]
                told_apart = column.exact or column.reason
                assert told_apart or all(
                    cell is None or isinstance(cell, str | Estimate) for cell in cells
                ), column.name


def test_the_sweep_of_ramp_rate_and_dwell_shows_what_they_shift() -> None:
    """LuGre's breakaway torque falls with the rate; a longer standstill changes nothing in it."""
    options = {"positions": ["-20 deg", "20 deg"], "directions": ["positive"]}
    matrix = [{"torque_rate": "1 N m/s"}, {"torque_rate": "4 N m/s"}]

    def exact(tree: dict[str, Any]) -> None:
        del tree["variation"], tree["friction"]["load"]["ripple"]

    done = execute(trials("breakaway", platform(exact), options, matrix))
    result = analyse("breakaway", done)
    slow, fast = (
        found
        for found in result.findings
        if found.quantity == "breakaway_torque" and "statistic" in found.conditions
    )
    assert slow.estimate is not None
    assert fast.estimate is not None
    shift = slow.value - fast.value
    assert shift > 0.3
    parts = {part.source: part.standard_uncertainty for part in slow.estimate.systematic}
    assert parts["ramp rate"] == pytest.approx(shift / 3.0 / np.sqrt(3.0))  # on to the rate zero
    assert parts["dwell"] is None
    parts = {part.source: part.standard_uncertainty for part in fast.estimate.systematic}
    assert parts["ramp rate"] == pytest.approx(shift * 4.0 / 3.0 / np.sqrt(3.0))


@pytest.mark.parametrize("error", [0.0, None])
def test_a_shift_by_ramp_rate_reaches_to_rate_zero_without_scatter(error: float | None) -> None:
    def one(rate: float, torque: float) -> Ramps:
        found = Estimate("breakaway_torque", torque, "N m", reason=MADE_UP())
        if error is not None:
            found = with_error("breakaway_torque", torque, "N m", error, 200.0, "")
        trial = SimpleNamespace(trial=SimpleNamespace(options={"torque_rate": rate}))
        return Ramps((trial,), ({"direction": "positive"},), ({"breakaway_torque": found},))

    slow, fast = one(1.0, 31.0), one(4.0, 30.4)
    shift = _shift(slow, [slow, fast], "breakaway_torque", "ramp rate")
    assert shift == pytest.approx(0.6 / 3.0 / np.sqrt(3.0))


def ramp(value: float, error: float, **more: Any) -> Estimate:
    return with_error("bristle_stiffness", value, "N m/rad", error, 200.0, "", **more)


def test_a_mean_is_never_narrower_than_its_ramps() -> None:
    """Ramps that agree by chance promise no more than their own errors; others scatter."""
    agreeing = mean("bristle_stiffness", [ramp(100.0, 3.0), ramp(100.1, 3.0), ramp(99.9, 3.0)])
    assert agreeing.value == pytest.approx(100.0)
    assert agreeing.half_width == pytest.approx(1.96 * 3.0 / np.sqrt(3.0), rel=0.01)
    scattered = mean("bristle_stiffness", [ramp(90.0, 0.1), ramp(100.0, 0.1), ramp(110.0, 0.1)])
    assert scattered.half_width == pytest.approx(4.303 * 10.0 / np.sqrt(3.0), rel=1e-3)
    alone = mean("bristle_stiffness", [ramp(100.0, 3.0)])
    assert alone.half_width == pytest.approx(1.972 * 3.0, rel=1e-3)


def test_a_mean_of_ramps_without_intervals_has_one_only_where_they_scatter() -> None:
    def without(value: float) -> Estimate:
        return replace(ramp(value, 1.0), low=None, high=None, reason=MADE_UP())

    assert mean("bristle_stiffness", [without(100.0), without(100.2)]).reason in MADE_UP
    scattered = mean("bristle_stiffness", [without(90.0), without(110.0), without(100.0)])
    assert scattered.has_interval


def test_a_systematic_part_does_not_shrink_with_the_number_of_ramps() -> None:
    parts = (Systematic("window", 2.0), Systematic("inertia"))
    found = mean(
        "bristle_stiffness", [ramp(v, 0.1, systematic=parts) for v in (99.0, 100.0, 101.0)]
    )
    assert found.systematic == parts


@pytest.mark.parametrize(("kind", "side"), [("at least", -1.0), ("at most", 1.0)])
def test_a_mean_with_a_bound_among_its_ramps_is_a_bound_of_their_ends(
    kind: Kind, side: float
) -> None:
    """Numbers count with the end of their interval: with their values it would bound nothing."""
    half = 1.972 * 3.0
    bound = replace(
        ramp(100.0 + side * half, 3.0), low=None, high=None, kind=kind, reason=MADE_UP()
    )
    for ramps in ([bound, ramp(100.0, 3.0)], [ramp(100.0, 3.0), bound]):
        found = mean("bristle_stiffness", ramps)
        assert (found.kind, found.has_interval) == (kind, False)
        assert found.value == pytest.approx(100.0 + side * half, rel=1e-3)


@pytest.mark.parametrize("order", [1, -1])
def test_a_ramp_without_an_interval_leaves_a_mean_with_a_bound_open(order: int) -> None:
    bound = replace(ramp(130.0, 3.0), low=None, high=None, kind="at most", reason=MADE_UP())
    lost = Estimate.without_interval("bristle_stiffness", 50.0, "N m/rad", MADE_UP())
    for found in (
        mean("bristle_stiffness", [bound, lost][::order]),
        _between(*[bound, lost][::order]),
    ):
        assert (found.kind, found.has_interval) == ("number", False)
        assert found.reason in MADE_UP


def noisy(tree: dict[str, Any]) -> None:
    """The small drive with a gyro seven times as noisy."""
    small(tree)
    tree["sensors"]["gyro"]["noise"] = "0.15 deg/s"


def test_what_noise_may_hide_is_told_with_a_remedy_that_helps() -> None:
    def shown(rate: float) -> tuple[list[Estimate], list[str]]:
        options = {**SMALL, "rest": "3 s", "torque_rate": f"{rate} N m/s"}
        result = analyse("breakaway", execute(trials("breakaway", platform(noisy), options)))
        notes = [note for note in result.notes if "may hide a stiffer interface" in note]
        found = [each.known for each in result.findings if each.quantity == "stiffness_at_rest"]
        return found, notes

    rate, (found, notes) = 0.02, shown(0.02)
    assert {each.kind for each in found} == {"at least"}
    assert all(each.value < 60.0 for each in found)
    for _ in range(2):  # as the note says, and says again
        rate = float(notes[0].split("torque_rate of ")[1].split()[0])
        found, notes = shown(rate)
    assert rate == 16.0 * 0.02
    assert {each.kind for each in found} == {"number"}
    assert all(holds(each, 60.0) for each in found)


def test_what_a_recording_of_an_older_plan_says() -> None:
    """It names no windows and no direction; its numbers are the same."""
    (item,) = execute(trials("breakaway", platform(), {**TWO, "positions": ["0 deg"]}))
    point = {name: item.trial.point[name] for name in ("measurement", "position")}
    options = {k: v for k, v in item.trial.options.items() if k != "directions"}
    older = item.trial.model_copy(update={"windows": (), "point": point, "options": options})
    now, then = (
        analyse("breakaway", [each]).findings for each in (item, replace(item, trial=older))
    )
    assert [found.estimate for found in now] == [found.estimate for found in then]


def test_archived_metrics_are_used_and_no_sample_is_read_for_them() -> None:
    done = execute(trials("breakaway", platform(), {**TWO, "positions": ["0 deg"]}))
    measure = experiments()["breakaway"].measure
    assert measure is not None
    metrics = tuple(measure(done[0]))
    assert len({metric.name for metric in metrics}) == len(metrics)
    assert all(np.isfinite(metric.value) for metric in metrics)
    moved = tuple(
        replace(metric, value=1.01 * metric.value, low=None, high=None)
        if metric.name == "breakaway_torque"
        else metric
        for metric in metrics
    )
    result = analyse("breakaway", [replace(done[0], estimates=moved)])
    found = finding(result, "breakaway_torque", statistic="mean")
    assert found.value == pytest.approx(1.01 * metrics[0].value)


def test_what_a_coarse_bench_is_told() -> None:
    options = {**SMALL, "rest": "0.1 s", "sliding_rate": "0.001 rad/s"}
    result = analyse("breakaway", execute(trials("breakaway", platform(small), options)))
    (counts,) = [note for note in result.notes if "counts of the encoder" in note]
    assert 1.5 < float(counts.split("spans ")[1].split()[0]) < 1.9  # 0.153 deg of 0.088 deg
    assert any("rest 2." in note for note in result.notes)
    assert any("sliding_rate of" in note for note in result.notes)
    torque = finding(result, "breakaway_torque", measurement=1)
    assert torque.lower_bound
    assert torque.value < 0.16


def coverage(draws: int, seed: int, of: Bench, options: dict[str, Any], truth: float) -> None:
    """Of σ0 and of the largest friction that the simulator knows of, on ramps with other noise."""
    held: dict[str, list[bool]] = {"bristle_stiffness": [], "breakaway_torque": []}
    planned = trials("breakaway", of, options)
    seeds = np.random.default_rng(seed).integers(2**31, size=draws)
    repeated = [trial.model_copy(update={"seed": int(each)}) for each in seeds for trial in planned]
    measure = experiments()["breakaway"].measure
    assert measure is not None
    for item in execute(repeated):
        found = {metric.name: metric for metric in measure(item)}
        friction = float(np.max(np.abs(item.samples["friction_torque"])))
        for name, true in (("bristle_stiffness", truth), ("breakaway_torque", friction)):
            if found[name].has_interval:
                held[name].append(holds(found[name], true))
    assert all(len(each) >= 0.9 * len(repeated) for each in held.values())
    assert not rejected(held, "less")


def still(tree: dict[str, Any]) -> None:
    """What scatters has no one truth."""
    del tree["variation"]


ENDS = {
    "platform": (platform(still), {"positions": ["0 deg"], "rest": "5 s"}, 15284.0),
    "platform, 4 N m/s": (
        platform(still),
        {"positions": ["0 deg"], "rest": "2 s", "torque_rate": "4 N m/s"},
        15284.0,
    ),
    "small": (platform(small), SMALL, 60.0),
}


@pytest.mark.parametrize("case", ENDS)
def test_intervals_hold(case: str) -> None:
    coverage(4, 31, *ENDS[case])


@pytest.mark.statistics
@pytest.mark.parametrize("case", ENDS)
def test_intervals_hold_often(case: str) -> None:
    coverage(1000, 32, *ENDS[case])


def test_several_quantities_share_the_chance_of_being_wrong() -> None:
    """Chi-square of 6.6 with two degrees of freedom: beyond 5.99 for one test, within 7.38."""
    spread = np.sqrt(0.5 * 6.6)
    ramps = [with_error("torque", value, "N m", 1.0, np.inf, "made up") for value in spread * OFF]
    assert "differ by more than their own intervals" in _what_shows(ramps, "torque", 1)
    assert "show no difference" in _what_shows(ramps, "torque", 2)


def test_a_ramp_is_dots_beside_its_fit_and_a_difference_of_its_own() -> None:
    done = execute(trials("breakaway", bench(load_only), TWO))
    shown = next(f for f in analyse("breakaway", done).figures if f.key == "ramp")
    *_, curve, rest = shown.panels
    dots, fit = curve.curves[:2]
    assert dots.style == "points"
    assert len(dots.x) <= DOTS
    # Evenly as it is seen: no step is much longer than the others.
    steps = np.hypot(np.diff(dots.x) / np.ptp(dots.x), np.diff(dots.y) / np.ptp(dots.y))
    assert steps.max() < 3.0 * np.median(steps)
    away = dots.y - np.interp(dots.x, fit.x, fit.y)
    on = np.interp(dots.x, rest.curves[0].x, rest.curves[0].y)
    np.testing.assert_allclose(away, on, atol=0.05)


def test_ramps_of_two_directions_stand_side_by_side() -> None:
    options = TWO | {"directions": ["positive", "negative"]}
    figures = result_of(load_only, options).figures
    panel = next(f for f in figures if f.key == "positions").panels[0]
    one, other, mean = panel.curves
    places = [place for place, _ in panel.x.places[:-1]]
    for curve in (one, other):
        np.testing.assert_array_equal(curve.x, places)
        assert 0.0 < abs(curve.aside) < 0.1 * np.diff(places).min()
    assert one.aside == -other.aside
    assert mean.aside == 0.0


def broke_away(samples: int) -> tuple[Any, ...]:
    """The ramps of `TWO`, with a load that was at rest and slides in the last of their samples."""

    def changed(item: Any) -> Any:
        gyro = item.samples.channels["gyro_rate"]
        rate = 1e-6 * np.random.default_rng(1).standard_normal(len(gyro.samples))
        rate[-samples:] += np.linspace(0.1, 1.0, samples)
        channels = {**item.samples.channels, "gyro_rate": replace(gyro, samples=rate)}
        return replace(item, samples=replace(item.samples, channels=channels))

    return tuple(map(changed, execute(trials("breakaway", bench(), TWO))))


def test_a_load_that_slid_too_fast_for_its_samples_is_not_said_to_have_stayed() -> None:
    result = analyse("breakaway", broke_away(3))
    assert any("too few for its torque; a higher sample_rate holds" in n for n in result.notes)
    assert result.key_numbers == ()
    short = execute(trials("breakaway", bench(), {**TWO, "peak_torque": "10 N m"}))
    stayed = analyse("breakaway", short)
    assert any("the rate never reached" in note for note in stayed.notes)
    assert not any("sample_rate" in note for note in stayed.notes)
    assert stayed.key_numbers == ()


def test_a_plan_tells_that_without_the_inertia_no_torque_will_be_told() -> None:
    experiment = experiments()["breakaway"]
    assert experiment.warnings is not None
    unknown = Bench.model_validate({"name": "rig", "axis": {"name": "azimuth"}})
    (told,) = experiment.warnings(experiment.options(), unknown)
    assert "axis.inertia" in told
    assert list(experiment.warnings(experiment.options(), bench())) == []


def with_a_dead_gyro(item: Done) -> Done:
    """The same ramp, of which the gyro shows nothing but noise before the load slides."""
    gyro = item.samples.channels[GYRO_RATE]
    noise = np.random.default_rng(1).standard_normal(len(gyro.samples))
    dead = np.where(np.abs(gyro.samples) < 0.004, 1e-9 * noise, gyro.samples)
    channels = {**item.samples.channels, GYRO_RATE: replace(gyro, samples=dead)}
    return replace(item, samples=replace(item.samples, channels=channels))


def test_a_ramp_that_tells_nothing_of_the_stiffness_leaves_the_mean_to_the_others() -> None:
    done = execute(trials("breakaway", bench(load_only), TWO))
    result = analyse("breakaway", (with_a_dead_gyro(done[0]), *done[1:]))
    known = finding(result, "bristle_stiffness", statistic="mean")
    assert known.value == pytest.approx(18000.0, rel=0.02)
    (note,) = (note for note in result.notes if "or too noisy" in note)
    assert note.startswith(done[0].trial.label)
    first, second, *_ = table(result, "presliding").rows
    assert first["breakaway_torque"] == pytest.approx(second["breakaway_torque"], rel=0.01)
    assert first["bristle_stiffness"] is None


def test_the_mean_of_one_ramp_is_of_one_trial() -> None:
    """How ramps scatter is not in its interval."""
    one = Estimate("breakaway_torque", 31.4, "N m", 31.3, 31.5, 0.95)
    told = mean("breakaway_torque", [one])
    assert (told.low, told.high) == (31.3, 31.5)
    assert told.reason in OF_ONE_TRIAL
