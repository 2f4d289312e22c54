"""Figures of the friction experiments: their captions are true of what they show."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin, Systematic
from campaign.experiments.shared.captions import amount, listed, setting, surely_above
from campaign.physics.bench import Bench
from campaign.published.values import thesis
from campaign.report.drawing.published_marks import PublishedBeside
from campaign.result import Array, Curve, Figure, Panel, Result
from tests.experiments.laboratory import MADE_UP, Done, analyse, execute, finding, trials
from tests.physics.benches import bench, stribeck

SPECIMEN = Path(__file__).parents[2] / "protocols" / "benches" / "specimen-lugre-1995.toml"
QUICK_MAP = {
    "slowest": "0.1 deg/s",
    "fastest": "60 deg/s",
    "points": 12,
    "warm_up_cycles": 0,
    "max_time": "8 s",
}


def specimen() -> Bench:
    return Bench.model_validate(tomllib.loads(SPECIMEN.read_text(encoding="utf-8")))


def figure(result: Result, key: str) -> Figure:
    return next(each for each in result.figures if each.key == key)


def curves_of(shown: Figure) -> Iterator[Curve]:
    return (curve for panel in shown.panels for curve in panel.curves)


def of_specimen(kind: str, **options: Any) -> tuple[Result, tuple[Done, ...]]:
    done = execute(trials(kind, specimen(), options))
    return analyse(kind, done), done


def rub(static: float, coulomb: float, viscous: float) -> Bench:
    """A bench with one friction, at the load."""

    def edit(tree: dict[str, Any]) -> None:
        tree["friction"] = {"load": stribeck(static, coulomb, viscous)}
        tree.pop("compensation", None)

    return bench(edit)


# Friction maps


def map_of(on: Bench) -> Result:
    return analyse("velocity_map", execute(trials("velocity_map", on, QUICK_MAP)))


@pytest.fixture(scope="module")
def falling() -> Result:
    return map_of(rub(33.9, 26.0, 4.07))


def test_a_map_tells_of_the_stribeck_effect_that_it_shows(falling: Result) -> None:
    """Least friction of 26 + 7.9 exp(-(v/0.03)^2) + 4.07 v: where its slope is zero."""
    shown = figure(falling, "map")
    assert shown.caption.startswith(
        "Friction falls as sliding becomes faster (Stribeck effect) and then rises with viscous"
    )
    fine = np.linspace(0.03, 0.2, 200_001)
    torque = 26.0 + 7.9 * np.exp(-((fine / 0.03) ** 2)) + 4.07 * fine
    least = fine[np.argmin(torque)]
    marks = [mark for panel in shown.panels for mark in panel.marks]
    assert [mark.series for mark in marks] == ["negative", "positive"]
    for mark in marks:
        assert mark.x == pytest.approx(least, rel=0.05)
        assert mark.y == pytest.approx(torque.min(), rel=2e-3)


def test_a_map_without_a_stribeck_effect_tells_of_none() -> None:
    shown = figure(map_of(rub(26.0, 26.0, 4.07)), "map")
    assert "no stribeck effect shows" in shown.caption.lower()
    assert "friction falls" not in shown.caption.lower()
    assert "rises with viscous friction" in shown.caption
    assert not any(panel.marks for panel in shown.panels)


def test_a_map_is_shown_where_half_of_its_runs_crowd(falling: Result) -> None:
    shown = figure(falling, "map")
    _, panel = shown.panels
    assert panel.x.scale == "log"
    dots = [curve for curve in panel.curves if curve.style == "points"]
    assert {curve.series for curve in dots} == {"negative", "positive"}
    for curve in dots:  # the middle of the runs is near the middle of the panel
        first, middle, last = np.log(np.quantile(curve.x, (0.0, 0.5, 1.0)))
        assert 0.25 < (middle - first) / (last - first) < 0.75


def test_a_peak_at_the_start_is_cut_off_and_said_to_be(falling: Result) -> None:
    shown = figure(falling, "one-point")
    _, torque, stretch = shown.panels
    peak, level = np.max(torque.curves[0].y), np.mean(stretch.curves[0].y)
    assert torque.y.limits is not None
    assert level < torque.y.limits[1] < peak
    assert f"The peak of {amount(float(peak), 'N m')} at the start is cut off." in shown.caption


def test_friction_that_does_not_rise_is_not_told_to() -> None:
    assert "rises" not in figure(map_of(rub(33.9, 26.0, 0.0)), "map").caption


def test_a_direction_looks_the_same_in_every_figure_of_a_map(falling: Result) -> None:
    for key in ("map", "fit"):
        points = [curve for curve in curves_of(figure(falling, key)) if curve.style == "points"]
        assert {(curve.label, curve.series) for curve in points} == {
            ("positive direction", "positive"),
            ("negative direction", "negative"),
        }


def test_the_published_curve_is_that_of_the_published_parameters(falling: Result) -> None:
    """Table 4.3, positive: 25.3 + 7.4 exp(-(v/0.0271)^0.96) + 3.87 v."""
    beside = PublishedBeside.of(thesis(), ["4.3"], {"domain": "hardware"})
    shown = figure(falling, "fit")
    marks = beside.marks(shown)
    places = {
        (place, shown.panels[place].curves[number].series): each[0]
        for (place, number), each in marks.items()
    }
    assert {series for _, series in places} == {"fit"}
    first = places[0, "fit"]
    fall = np.exp(-((first.x / 0.0271) ** 0.96))
    expected = 25.3 + 7.4 * fall + 3.87 * first.x
    assert first.y == pytest.approx(expected)
    assert first.doubtful  # Table 4.4 prints it under the opposite direction
    own = shown.panels[2].curves[0]
    fitted = shown.panels[0].curves[1]
    assert own.x.min() == pytest.approx(fitted.x.min())
    less = places[2, "fit"].y - expected
    assert -less == pytest.approx(np.interp(first.x, fitted.x, fitted.y), rel=1e-4)


# Readings


def test_published_readings_stand_at_their_numbers_and_the_mean_behind_them() -> None:
    options = {"components": ["motor", "load"], "measurements": 3}
    result = analyse("component_friction", execute(trials("component_friction", bench(), options)))
    shown = figure(result, "component-friction")
    beside = PublishedBeside.of(thesis(), ["4.1"], {"domain": "hardware"})
    found = {
        (curve.series, len(curve.x)): beside.marks(shown)[place, number][0]
        for place, panel in enumerate(shown.panels[1:], start=1)
        for number, curve in enumerate(panel.curves)
    }
    assert [panel.title for panel in shown.panels[1:]] == ["Motor", "Load"]
    assert found["motor", 3].x.tolist() == list(range(1, 11))
    assert found["motor", 3].y[:5].tolist() == [5.60, 5.60, 5.60, 4.20, 4.20]
    assert found["load", 3].y[0] == 23.53
    last = dict(shown.panels[1].x.places)
    assert last[found["load", 1].x[0]] == "mean"
    assert found["load", 1].y.tolist() == [21.60]
    load = finding(result, "breakaway_torque", component="load", statistic="mean").value
    assert f"load {amount(load, 'N m')}" in shown.caption


@pytest.mark.parametrize(("resolution", "told"), [("0.01 N m", True), ("0 N m", False)])
def test_steps_are_told_where_readings_have_any(resolution: str, told: bool) -> None:
    options = {"components": ["motor"], "measurements": 2, "sensor_resolution": resolution}
    result = analyse("component_friction", execute(trials("component_friction", bench(), options)))
    assert ("multiples" in figure(result, "component-friction").caption) is told


def test_independent_readings_are_not_joined() -> None:
    options = {"positions": ["-20 deg", "0 deg", "20 deg"], "directions": ["positive"]}
    done = execute(trials("breakaway", bench(), options))
    shown = figure(analyse("breakaway", done), "positions")
    assert {curve.style for curve in curves_of(shown)} == {"points"}
    assert [name for _, name in shown.panels[0].x.places] == ["−20°", "0°", "20°", "mean"]
    beside = PublishedBeside.of(thesis(), ["4.5"], {"domain": "hardware"})
    ((place, (mean,)),) = beside.marks(shown).items()
    assert place[0] == 1
    assert mean.y.tolist() == [15284.0]
    assert mean.x[0] == shown.panels[1].x.places[-1][0]
    assert shown.trials == tuple(each.trial.number for each in done)


# Behaviour


def test_friction_that_stays_is_not_told_to_fall() -> None:
    speeds = [f"{speed} rad/s" for speed in (0.001, 0.01, 0.1)]
    flat = rub(26.0, 26.0, 0.0)
    planned = trials("stribeck_curve", flat, {"speeds": speeds})
    shown = figure(analyse("stribeck_curve", execute(planned)), "stribeck-curve")
    assert "falls" not in shown.caption
    assert "rises" not in shown.caption
    assert "no other that the points show" in shown.caption
    assert not shown.panels[0].marks


def fitted(panel: Panel) -> tuple[Array, Array]:
    (curve,) = (curve for curve in panel.curves if curve.series == "fit")
    return curve.x, curve.y


def test_a_stribeck_curve_tells_where_it_is_least_in_each_direction() -> None:
    speeds = [f"{speed} mrad/s" for speed in (0.1, 1.0, 3.0, 100.0)]
    result, _ = of_specimen("stribeck_curve", speeds=speeds, settle_angle="0.3 mrad")
    shown = figure(result, "stribeck-curve")
    assert "falls to 1.00 N·m at 0.172 deg/s (velocity weakening)" in shown.caption
    assert [panel.title for panel in shown.panels] == ["Positive direction", "Negative direction"]
    for panel, series in zip(shown.panels, ("positive", "negative"), strict=True):
        (points,) = (curve for curve in panel.curves if curve.style == "points")
        assert points.series == series
        np.testing.assert_allclose(points.y, np.interp(points.x, *fitted(panel)), rtol=1e-3)
    (mark,) = shown.panels[0].marks
    fine = np.geomspace(1e-3, 1e-1, 200_001)
    torque = 1.0 + 0.5 * np.exp(-((fine / 1e-3) ** 2)) + 0.4 * fine
    assert mark.x == pytest.approx(fine[np.argmin(torque)], rel=0.02)


def test_only_a_model_whose_breakaway_falls_is_told_to_fall() -> None:
    rates = ["0.5 N m/s", "50 N m/s"]
    models = ["lugre", "stribeck"]
    result, done = of_specimen("force_rate", torque_rates=rates, peak_torque="4 N m", models=models)
    shown = figure(result, "force-rate")
    assert "LuGre model: breakaway falls from 1.4" in shown.caption
    assert "Static model: breakaway at 1.50 N·m, at 0.5 N·m/s as at 50 N·m/s." in shown.caption
    _, slow, fast = shown.panels
    assert (slow.title, fast.title) == ("Slowest ramp: 0.5 N·m/s", "Fastest ramp: 50 N·m/s")
    for panel in (slow, fast):  # no two curves of one look
        series = [curve.series for curve in panel.curves]
        assert len(series) == len(set(series)) == 3
    assert np.max(slow.curves[0].y) > 1.3 * np.max(fast.curves[0].y)
    assert shown.trials == tuple(each.trial.number for each in done)


def test_a_single_ramp_is_neither_slow_nor_fast() -> None:
    result, _ = of_specimen("force_rate", torque_rates=["5 N m/s"], peak_torque="4 N m")
    shown = figure(result, "force-rate")
    assert [panel.title for panel in shown.panels] == ["Breakaway", "Ramp: 5 N·m/s"]
    assert "during the only ramp" in shown.caption


def test_loops_are_closed_and_tell_their_energy() -> None:
    options = {"amplitudes": ["6 urad", "48 urad"], "models": ["stribeck"], "cycles": 2}
    result, _ = of_specimen("presliding_hysteresis", **options)
    shown = figure(result, "presliding-hysteresis")
    for curve in curves_of(shown):
        assert curve.style == "loop"
        assert (curve.x[0], curve.y[0]) == (curve.x[-1], curve.y[-1])
    whole, small = shown.panels
    assert [len(panel.curves) for panel in shown.panels] == [2, 1]
    assert small.curves[0].label == "± 6 µrad"
    assert np.max(np.abs(small.curves[0].x)) < 0.2 * np.max(np.abs(whole.curves[1].x))
    assert "Beside them those up to ± 6 µrad again." in shown.caption
    # A box: 4 Fs times the amplitude, and 4 / pi.
    assert "36.0 µJ a cycle at ± 6 µrad (loss factor 1.3)" in shown.caption
    assert "288 µJ a cycle at ± 48 µrad (loss factor 1.3)" in shown.caption


def test_only_friction_that_lags_has_loops_in_words() -> None:
    options = {
        "mean_rate": "1.3 mrad/s",
        "amplitude": "1.1 mrad/s",
        "frequencies": ["1.6 Hz"],
        "models": ["lugre", "stribeck"],
    }
    result, _ = of_specimen("friction_lag", **options)
    lugre, static = figure(result, "friction-lag").panels
    assert [panel.curves[0].style for panel in (lugre, static)] == ["loop", "line"]
    caption = figure(result, "friction-lag").caption
    width = finding(result, "friction_lag_width", model="lugre").value
    assert f"is higher than on the way down by {amount(width, 'N m', digits=2)}" in caption
    assert "Static model: no loop shows" in caption


@pytest.mark.parametrize(("duration", "slips"), [("5 s", 0), ("35 s", 5)])
def test_a_load_that_does_not_slip_is_not_told_to(duration: str, slips: int) -> None:
    options = {"stiffness": "2 N m/rad", "pull_rate": "0.1 rad/s", "duration": duration}
    result, _ = of_specimen("stick_slip", **options)
    shown = figure(result, "stick-slip")
    assert "pulled at 0.1 rad/s through a spring of 2 N·m/rad" in shown.caption
    assert (f"{slips} slips" in shown.caption) is bool(slips)
    assert ("does not slip" in shown.caption) is not bool(slips)
    assert len(shown.panels[0].marks) == bool(slips)


# Words


@pytest.mark.parametrize(
    ("low", "high", "more", "sure"),
    [
        (0.5, 1.5, {}, True),
        (-0.1, 2.1, {}, False),
        (None, None, {"reason": MADE_UP()}, True),
        (0.5, 1.5, {"origin": Origin.NOT_DETERMINED}, False),
        (0.5, 1.5, {"systematic": (Systematic("inertia", 0.6),)}, False),
    ],
)
def test_more_is_said_of_a_whole_interval_only(
    low: float | None, high: float | None, more: dict[str, Any], sure: bool
) -> None:
    found = Estimate("x", 1.0, "N m", low, high, 0.95, **more)
    assert surely_above(found, 0.0) is sure
    assert not surely_above(found, 0.0, 1.5)
    assert not surely_above(found, 1.0)


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (amount(1.5, "N m"), "1.50 N·m"),
        (amount(-0.0321, "N m", digits=2), "−0.032 N·m"),
        (amount(15331.2, "N m/rad"), "15331 N·m/rad"),
        (amount(999.7, "N m"), "1000 N·m"),
        (amount(np.pi, "rad/s", "deg/s"), "180 deg/s"),
        (amount(3e-6, "rad", "urad"), "3.00 µrad"),
        (amount(np.nan, "N m"), "an unknown size"),
        (setting(0.1, "N m/s"), "0.1 N·m/s"),
        (setting(0.0, "rad", "deg"), "0 °"),
        (listed([]), ""),
        (listed(["a"]), "a"),
        (listed(["a", "b", "c"]), "a, b and c"),
    ],
)
def test_numbers_in_captions(told: str, expected: str) -> None:
    assert told == expected
