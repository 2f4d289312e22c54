"""Hull motion from a measured series: what was measured is met at every sample, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from campaign.experiments.shared.motion_series import MOST_ROWS, kind_of, motion_signal
from campaign.experiments.stabilization.experiment import EXPERIMENT, StabilizationOptions
from campaign.experiments.stabilization.hull_motion import SeriesMotion
from campaign.options import TextFile
from campaign.physics.base_motion import base_rate
from tests.experiments.laboratory import analyse, execute, finding, table, trials
from tests.physics.benches import bench

RANDOM = np.random.default_rng(7)
TIME = np.concatenate([[0.0], np.cumsum(RANDOM.uniform(0.05, 0.15, 80))])  # s, uneven
VALUE = np.cumsum(RANDOM.standard_normal(81)) * 0.02


def rate_of(kind, lead_in=0.7):
    """Rate of the hull at the samples of the series and finely between them (rad/s)."""
    signal = motion_signal(TIME, VALUE, kind, lead_in)
    fine = np.linspace(0.0, TIME[-1], 200_001)
    return base_rate(signal, lead_in + TIME), base_rate(signal, lead_in + fine), fine


def test_a_rate_is_met_at_every_sample() -> None:
    at_samples, between, fine = rate_of("rate")
    np.testing.assert_allclose(at_samples, VALUE, atol=1e-12)
    np.testing.assert_allclose(between, np.interp(fine, TIME, VALUE), atol=1e-12)


def test_an_angle_is_met_at_every_sample() -> None:
    _, between, fine = rate_of("angle")
    angle = VALUE[0] + cumulative_trapezoid(between, fine, initial=0.0)
    np.testing.assert_allclose(np.interp(TIME, fine, angle), VALUE, atol=1e-6)


def test_an_acceleration_is_met_at_every_sample_and_its_rate_averages_zero() -> None:
    signal = motion_signal(TIME, VALUE, "acceleration", 0.7)
    np.testing.assert_allclose(signal.sample(0.7 + TIME[1:]), VALUE[1:], atol=1e-12)
    _, between, fine = rate_of("acceleration")
    assert np.trapezoid(between, fine) / fine[-1] == pytest.approx(0.0, abs=1e-8)


def test_the_hull_comes_from_rest() -> None:
    signal = motion_signal(TIME, VALUE + 0.3, "rate", 0.5)
    ramp = base_rate(signal, np.array([0.0, 0.25, 0.5]))
    np.testing.assert_allclose(ramp, np.array([0.0, 0.5, 1.0]) * (VALUE[0] + 0.3), atol=1e-12)


def series(text: str, **options: str) -> SeriesMotion:
    file = TextFile("a.csv", text)
    settings = {"kind": "series", "file": file, "value": "deg/s", "settle": "0 s", **options}
    return SeriesMotion.model_validate(settings)


def test_reading_units_comments_and_columns() -> None:
    text = "# logger 7\n\nt ; roll;x\n10;180;0\n20;-90;1\n\n40;0;2\n"
    time, value = series(text, time="ms", time_column="t", value_column="roll").samples()
    np.testing.assert_allclose(time, [0.0, 0.010, 0.030])
    np.testing.assert_allclose(value, [np.pi, -np.pi / 2, 0.0])


@pytest.mark.parametrize(
    ("unit", "kind"),
    [("deg", "angle"), ("mrad", "angle"), ("rpm", "rate"), ("deg/s^2", "acceleration")],
)
def test_the_unit_says_what_was_measured(unit: str, kind: str) -> None:
    assert kind_of(unit) == kind


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,value\n0,1\n1,x\n", r"a\.csv:3: 'x' is not a number"),
        ("time,value\n0,1\n1,nan\n", r"a\.csv:3: 'nan' is not a finite number"),
        ("time,value\n0,1\n1\n", r"a\.csv:3: 1 values under 2 columns"),
        ("time,value\n0,1\n0,2\n", r"a\.csv:3: the time 0 does not come after 0"),
        ("time,rate\n0,1\n1,2\n", r"a\.csv:1: no column 'value'; the columns are time, rate"),
        ("time,value,value\n0,1,2\n", r"a\.csv:1: more than one column 'value'"),
        ("time,value\n0,1\n", r"a\.csv: a series needs at least two rows"),
        ("", r"a\.csv:1: no column 'time'; the columns are none"),
        ('time,value\n0,"1\n', r"a\.csv:2: not readable as CSV"),
    ],
)
def test_a_bad_row_is_named(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        series(text)


def test_a_series_is_of_bounded_size() -> None:
    rows = "".join(f"{i},0\n" for i in range(MOST_ROWS + 1))
    with pytest.raises(ValueError, match=f"a.csv:{MOST_ROWS + 2}: more than"):
        series("time,value\n" + rows)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"value": "kg"}, "'kg' is no unit of a motion; allowed are angle: deg"),
        ({"time": "deg"}, "not a unit of time"),
        ({"settle": "1 min"}, "the series lasts 3 s, no longer than settle"),
    ],
)
def test_options_of_a_series_are_checked(change: dict[str, str], said: str) -> None:
    file = TextFile("a.csv", "time,value\n0,1\n3,2\n")
    with pytest.raises(ValueError, match=said):
        SeriesMotion.model_validate({"kind": "series", "file": file, "value": "deg", **change})


SERIES = "time,value\n" + "".join(
    f"{t:.2f},{6 * np.sin(2 * np.pi * 0.25 * t):.6f}\n" for t in np.arange(0.0, 12.001, 0.02)
)


def test_a_stabilization_under_a_series_is_that_under_the_sine_it_is() -> None:
    """6 deg/s at 0.25 Hz, sampled at 50 Hz: 1.5 pi deg/s^2 per deg/s gives the sine of the test."""
    motion = {
        "kind": "series",
        "file": TextFile("a.csv", SERIES),
        "value": "deg/s",
        "settle": "4 s",
    }
    planned = trials("stabilization", bench(), {"motion": motion})
    (trial,) = planned
    assert trial.task.window == (5.0, 13.0)  # lead-in 1 s, then 4 of 12 s unmeasured
    assert trial.options["motion"]["file"].startswith("a.csv (SHA-256 ")
    result = analyse("stabilization", execute(planned))
    found = finding(result, "stabilization_error", motion="series")
    assert not {"frequency", "acceleration"} & set(found.conditions)
    sine = {"frequency": "0.25 Hz", "acceleration": f"{6 * 2 * np.pi * 0.25} deg/s^2", "cycles": 2}
    expected = finding(
        analyse("stabilization", execute(trials("stabilization", bench(), sine))),
        "stabilization_error",
    )
    assert found.value == pytest.approx(expected.value, rel=2e-3)
    assert "motion" not in expected.conditions
    assert [c.name for c in table(result, "stabilization-error").columns][:2] == [
        "compensation",
        "motion",
    ]


def test_a_ship_s_roll_is_measured_over_its_whole_window() -> None:
    motion = {"kind": "ship", "settle": "5 s", "duration": "10 s"}
    done = execute(trials("stabilization", bench(), {"motion": motion}))
    result = analyse("stabilization", done)
    found = finding(result, "stabilization_error", motion="ship").value
    cut = done[0].samples["pointing_error"][5000:15000]
    assert found == pytest.approx(np.std(cut), rel=1e-12)


def test_a_sine_s_options_do_not_go_with_another_motion() -> None:
    options = StabilizationOptions.model_validate({"motion": {"kind": "ship"}, "cycles": 2})
    with pytest.raises(ValueError, match="cycles: for a sinusoidal motion only"):
        list(EXPERIMENT.trials(options, bench()))
