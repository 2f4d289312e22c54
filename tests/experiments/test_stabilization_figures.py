"""Figures of the stabilization test: what their captions say is what is in them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.experiments.stabilization.errors import MOST_PANELS, error_figures
from campaign.experiments.stabilization.figures import stabilization_figures
from campaign.experiments.stabilization.reversal_figures import HELD, can_be_shown, reversal
from campaign.recording import Channel, Ending, Outcome, Recording
from campaign.result import Figure, Panel
from campaign.trial import Trial
from tests.experiments.laboratory import MADE_UP, Done, analyse, execute, trials
from tests.physics.benches import bench

STEP = 1e-3
FREQUENCY = 0.24
LARGEST = np.deg2rad(12.0)
TIME = np.arange(round(1.5 / FREQUENCY / STEP)) * STEP
BASE = LARGEST * np.cos(2 * np.pi * FREQUENCY * TIME)
COUNT = np.deg2rad(0.0055)
MIDDLE = 0.75 / FREQUENCY
"""The middle one of the hull's three reversals: s."""
SLOWEST = 0.15 * float(np.abs(BASE[round((MIDDLE - 0.0133 * TIME[-1]) / STEP)]))
"""Rate (rad/s) below which a load is slow, by the zoom's height."""


def channel(name: str, samples: np.ndarray) -> Channel:
    unit = "rad" if "angle" in name or "error" in name else "rad/s"
    return Channel(name, unit, name, unit, samples)


def recording(relative: np.ndarray, count: float = 0.0, **more: np.ndarray) -> Recording:
    """Of a relative rate (rad/s), with an encoder of such a count; without a gyro."""
    angle = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (relative[1:] + relative[:-1]))])
    if count:
        angle = count * np.floor(angle / count)
        relative = np.gradient(angle, STEP)
    samples = {"base_rate": BASE, "relative_rate": relative, "relative_angle": angle, **more}
    channels = {name: channel(name, values) for name, values in samples.items()}
    return Recording(TIME, channels, (), Ending(Outcome.COMPLETED))


def stuck(duration: float) -> np.ndarray:
    """A load that stands still relative to the hull for so long (s) from each reversal on."""
    after = (TIME - MIDDLE + 0.25 / FREQUENCY) % (0.5 / FREQUENCY) - 0.25 / FREQUENCY
    return np.where((after >= 0) & (after < duration), 0.0, -BASE)


def zoom_of(panels: Sequence[Panel], title: str) -> Panel:
    return next(panel for panel in panels if panel.title.startswith(title))


def curve_of(panel: Panel, label: str) -> np.ndarray:
    return next(curve for curve in panel.curves if curve.label == label).y


# --- the reversal ---------------------------------------------------------------------------


@pytest.mark.parametrize("duration", [0.06, 0.1])
def test_the_zoom_shades_the_time_stuck(duration: float) -> None:
    """And the time before it in which the load is slow, as one held still is."""
    found = reversal({"none": recording(stuck(duration))})
    panel = zoom_of(found.panels, "no compensation")
    (mark,) = panel.marks
    assert panel.x.limits[0] < mark.x < MIDDLE < mark.until < panel.x.limits[1]
    slow = SLOWEST / (2 * np.pi * FREQUENCY * LARGEST)
    assert mark.until - mark.x == pytest.approx(duration + slow, abs=3 * STEP)
    assert mark.label == f"slow for {1e3 * (mark.until - mark.x):.3g} ms"
    assert mark.series == "none"


def test_the_zoom_widens_until_a_load_is_seen_to_break_loose() -> None:
    short, long = (reversal({"none": recording(stuck(t))}).panels[1] for t in (0.06, 0.5))
    (mark,) = long.marks
    assert long.x.limits[1] - long.x.limits[0] > 2 * (short.x.limits[1] - short.x.limits[0])
    assert mark.until == pytest.approx(MIDDLE + 0.5, abs=3 * STEP)
    assert "over" not in mark.label


def test_a_time_that_does_not_end_in_the_zoom_says_so() -> None:
    panel = reversal({"none": recording(stuck(1.9))}).panels[1]
    (mark,) = panel.marks
    assert mark.label.startswith("slow for over ")
    assert mark.until == pytest.approx(panel.x.limits[1], abs=2 * STEP)


def test_the_caption_says_how_long_a_load_held_still_is_slow() -> None:
    held = 2 * SLOWEST / (2 * np.pi * FREQUENCY * LARGEST)
    words = reversal({"none": recording(stuck(0.1))}).words
    told = re.search(r"slower than ([\d.]+) deg/s .* a load held still is for (\d+) ms", words)
    assert told is not None
    assert float(told[1]) == pytest.approx(np.rad2deg(SLOWEST), rel=0.06)
    assert float(told[2]) == pytest.approx(1e3 * held, abs=3)


def test_titles_say_how_far_off_the_load_gets() -> None:
    """A load that stands still 60 ms after the reversal is off by the hull's rate there."""
    panel = zoom_of(reversal({"none": recording(stuck(0.06))}).panels, "no compensation")
    off = np.max(np.abs(curve_of(panel, "no compensation") - curve_of(panel, HELD)))
    told = re.search(r": ([\d.]+) deg/s off", panel.title)
    assert told is not None
    assert float(told[1]) == pytest.approx(np.rad2deg(off), rel=0.06)
    assert off == pytest.approx(LARGEST * np.sin(2 * np.pi * FREQUENCY * 0.06), rel=0.05)


def test_there_is_a_zoom_for_each_method_at_the_same_place() -> None:
    cuts = {"none": recording(stuck(0.08)), "lugre": recording(stuck(0.01))}
    whole, *zooms, away = reversal(cuts).panels
    assert away.x.limits == zooms[0].x.limits
    for zoom, curve in zip(zooms, away.curves, strict=True):
        rest = curve_of(zoom, curve.label) - curve_of(zoom, HELD)
        np.testing.assert_allclose(curve.y, rest, atol=1e-12)
    assert [zoom.title.split(":")[0] for zoom in zooms] == ["no compensation", "LuGre model"]
    assert len({zoom.x.limits for zoom in zooms}) == len({zoom.y.limits for zoom in zooms}) == 1
    (mark,) = whole.marks
    assert (mark.x, mark.until) == zooms[0].x.limits


def test_a_sensor_without_counts_is_not_filtered_and_nothing_is_said_of_a_filter() -> None:
    found = reversal({"none": recording(stuck(0.06))})
    assert "line through" not in found.words
    assert "count" not in found.words
    np.testing.assert_array_equal(curve_of(found.panels[0], "no compensation"), stuck(0.06))


def test_counts_are_filtered_and_the_window_is_said() -> None:
    found = reversal({"none": recording(stuck(0.0), COUNT)})
    told = re.search(r"whole motion is the slope of a line through (\d+) ms", found.words)
    assert told is not None
    window = 1.5 * COUNT / (0.01 * LARGEST)
    assert float(told[1]) == pytest.approx(1e3 * window, abs=2)
    shown = curve_of(found.panels[0], "no compensation")
    known = np.isfinite(shown)
    assert np.max(np.abs((shown + BASE)[known])) < 0.01 * LARGEST, "as fine as it was to be"
    lost = np.flatnonzero(~known)
    assert len(lost) == pytest.approx(window / STEP, abs=2)


def test_where_the_hull_moves_by_less_than_a_count_it_is_said_that_nothing_is_seen() -> None:
    """From rest it moves by one count in sqrt(2 count / acceleration)."""
    found = reversal({"none": recording(stuck(0.02), COUNT)})
    acceleration = 2 * np.pi * FREQUENCY * LARGEST
    told = re.search(r"For (\d+) ms around the reversal .* cannot be seen", found.words)
    assert told is not None
    assert float(told[1]) == pytest.approx(2e3 * np.sqrt(2 * COUNT / acceleration), abs=3)
    assert not zoom_of(found.panels, "no compensation").marks
    assert "Shaded" not in found.words


def test_rates_in_space_show_what_counts_do_not() -> None:
    gyro = stuck(0.06) + BASE
    found = reversal({"none": recording(stuck(0.06), COUNT, gyro_rate=gyro)})
    panel = zoom_of(found.panels, "no compensation")
    np.testing.assert_allclose(
        curve_of(panel, "no compensation"),
        stuck(0.06)[(panel.x.limits[0] <= TIME) & (panel.x.limits[1] >= TIME)],
        atol=1e-12,
    )
    assert "The zooms are the difference of the rates of load and hull in space" in found.words
    assert "cannot be seen" not in found.words
    assert len(panel.marks) == 1


def test_what_has_no_rates_is_not_shown() -> None:
    whole = recording(stuck(0.0))
    without = {name: c for name, c in whole.channels.items() if name != "base_rate"}
    assert can_be_shown(whole)
    assert not can_be_shown(replace(whole, channels=without))
    still = recording(np.zeros_like(BASE), base_rate=np.zeros_like(BASE))
    assert not can_be_shown(still)


# --- errors by method -----------------------------------------------------------------------


def row(compensation: str, error: float, **told: object) -> dict[str, object]:
    estimate = Estimate("stabilization_error", error, "rad", 0.9 * error, 1.2 * error, 0.95, "m")
    return {
        "compensation": compensation,
        "frequency": 0.24,
        "acceleration": float(np.deg2rad(18.0)),
        **told,
        "error": estimate,
        "peak": None,
        "stuck": None,
        "repeats": 1,
    }


def a_trial() -> Trial:
    return trials("stabilization", bench(), {}, [{}])[0]


def errors(rows: list[dict[str, object]], *paths: str) -> list[Figure]:
    return list(error_figures(rows, paths, a_trial()))  # type: ignore[arg-type]


def test_methods_stand_side_by_side_with_their_intervals() -> None:
    (figure,) = errors([row("none", 5e-4), row("lugre", 1e-4)], "compensation")
    assert figure.key == "error-by-method"
    (panel,) = figure.panels
    assert panel.x.places == ((0.0, "none"), (1.0, "LuGre"))
    for place, (curve, error) in enumerate(zip(panel.curves, (5e-4, 1e-4), strict=True)):
        assert (curve.x[0], curve.y[0]) == (place, error)
        assert (curve.low[0], curve.high[0]) == pytest.approx((0.9 * error, 1.2 * error))
        assert (curve.quantity, curve.along) == ("stabilization_error", "")
        assert curve.conditions["compensation"] == curve.series
    assert "at 0.24 Hz and 18 deg/s², with its 95 % interval." in figure.caption


def test_errors_along_a_sweep_know_what_they_are() -> None:
    rows = [
        row(name, 1e-4 * f, frequency=f, acceleration=float(np.deg2rad(36.0)))
        for f in (2.0, 0.1, 0.5)
        for name in ("none", "static")
    ]
    (figure,) = errors(rows, "frequency", "compensation")
    assert figure.key == "error-over-frequency"
    (panel,) = figure.panels
    assert (panel.x.unit, panel.x.scale, panel.y.scale) == ("Hz", "log", "linear")
    for curve in panel.curves:
        np.testing.assert_allclose(curve.x, [0.1, 0.5, 2.0])
        np.testing.assert_allclose(curve.y, 1e-4 * curve.x)
        assert curve.along == "frequency"
        assert "frequency" not in curve.conditions
        assert curve.conditions["acceleration"] == pytest.approx(np.deg2rad(36.0))
    assert "at 36 deg/s²" in figure.caption


def test_two_values_of_the_bench_are_two_panels_in_a_readers_unit() -> None:
    path = "axis.inertia"
    rows = [
        row(name, 1e-4, **{f"bench.{path}": inertia})
        for inertia in (36.0, 40.0)
        for name in ("none", "static")
    ]
    (figure,) = errors(rows, f"bench.{path}", "compensation")
    assert [panel.title for panel in figure.panels] == [
        "Axis inertia 36 kg·m²",
        "Axis inertia 40 kg·m²",
    ]


def test_swept_angular_accelerations_are_in_degrees() -> None:
    rows = [row("none", 1e-4, acceleration=float(np.deg2rad(a))) for a in (10.0, 20.0, 40.0)]
    (figure,) = errors(rows, "acceleration")
    assert (figure.panels[0].x.unit, figure.panels[0].x.display) == ("rad/s^2", "deg/s^2")
    assert "at 0.24 Hz" in figure.caption
    assert "rad" not in figure.caption


def test_errors_of_different_size_have_a_logarithmic_axis() -> None:
    (figure,) = errors([row("none", 5e-4), row("lugre", 6e-7)], "compensation")
    assert figure.panels[0].y.scale == "log"


def test_nothing_is_drawn_of_what_was_not_found() -> None:
    lost = Estimate.without_interval("stabilization_error", float("nan"), "rad", MADE_UP())
    assert errors([{**row("none", 1.0), "error": lost}, row("lugre", 1e-4)], "compensation") == []
    found = [row("static", 2e-4), row("lugre", 1e-4), {**row("none", 1.0), "error": lost}]
    (figure,) = errors(found, "compensation")
    assert [name for _, name in figure.panels[0].x.places] == ["static", "LuGre"]


def test_further_panels_are_told() -> None:
    seeds = range(MOST_PANELS + 2)
    rows = [row(name, 1e-4, where=f"place {k}") for k in seeds for name in ("none", "static")]
    (figure,) = errors(rows, "where", "compensation")
    assert len(figure.panels) == MOST_PANELS
    assert f"the first {MOST_PANELS} of {MOST_PANELS + 2} conditions" in figure.caption


# --- the condition shown --------------------------------------------------------------------


def swept(*places: tuple[float, float, float], methods: tuple[str, ...] = ("none", "lugre")):  # type: ignore[no-untyped-def]
    """Trials, paths and rows of a sweep over (frequency, acceleration in deg/s^2, error)."""
    firsts, rows = [], []
    for frequency, acceleration, error in places:
        for k, name in enumerate(methods):
            options = {
                "frequency": f"{frequency} Hz",
                "acceleration": f"{acceleration} deg/s^2",
                "compensation": name,
            }
            trial = trials("stabilization", bench(), options)[0]
            si = {"frequency": frequency, "compensation": name}
            number = len(firsts) + 11
            trial = trial.model_copy(update={"point": si, "number": number})
            time = np.arange(0.0, trial.task.duration, 0.01)
            found = {"pointing_error": channel("pointing_error", np.sin(time))}
            samples = Recording(time, found, (), Ending(Outcome.COMPLETED))
            firsts.append(Done(trial, samples.ending, samples))
            accel = float(np.deg2rad(acceleration))
            rows.append(row(name, error / (k + 1), frequency=frequency, acceleration=accel))
    return firsts, ("frequency", "compensation"), rows


def over_time(*places: tuple[float, float, float]) -> Figure:
    figures = stabilization_figures(*swept(*places))
    return next(figure for figure in figures if figure.key == "position-error")


def test_the_condition_of_a_published_figure_is_shown_where_it_was_measured() -> None:
    figure = over_time((2.0, 36.0, 1e-4), (1.0, 36.0, 9e-4), (0.5, 36.0, 2e-4))
    assert figure.caption.endswith("Shown at 2 Hz, 36 deg/s², one of 3 conditions.")
    assert figure.trials == (11, 12)
    assert figure.thesis == ("5.10", "5.24")


def test_else_that_of_the_largest_error_without_compensation() -> None:
    figure = over_time((2.0, 30.0, 1e-4), (1.0, 30.0, 9e-4), (0.5, 30.0, 2e-4))
    assert figure.caption.endswith("Shown at 1 Hz, 30 deg/s², one of 3 conditions.")
    assert figure.trials == (13, 14)
    assert figure.thesis == ()


def test_titles_say_the_largest_error_and_lines_where_the_hull_turns() -> None:
    """As it was recorded to turn, in whole cycles; the error is that of the table."""
    done = execute(trials("stabilization", bench(), {"cycles": 2, "settle_cycles": 1}))
    result = analyse("stabilization", done)
    (panel,) = next(f for f in result.figures if f.key == "position-error").panels
    window = done[0].trial.windows[0]
    cut = done[0].samples.window(window.start, window.stop)
    turns = np.flatnonzero(np.diff(np.sign(cut["base_rate"])) != 0)
    assert len(turns) == 4
    found = [mark.x for mark in panel.marks]
    assert found == pytest.approx(cut.time[turns] - window.start, abs=2e-3)
    (told,) = result.tables[0].rows
    assert panel.title == f"no compensation: {1e3 * told['peak'].value:#.3g} mrad"
    assert told["peak"].value == pytest.approx(np.max(np.abs(panel.curves[0].y)))


def torque_figure(added: np.ndarray) -> Figure:
    firsts, paths, rows = swept((0.24, 18.0, 1e-4), methods=("lugre",))
    (done,) = firsts
    samples = replace(
        done.samples,
        channels={
            **done.samples.channels,
            "compensation_torque": channel("compensation_torque", added),
        },
    )
    shown = stabilization_figures([replace(done, samples=samples)], paths, rows)
    return next(figure for figure in shown if figure.key == "compensation-torque")


def test_a_torque_that_chatters_is_shown_as_its_mean_and_range() -> None:
    firsts, _, _ = swept((0.24, 18.0, 1e-4), methods=("lugre",))
    time = firsts[0].samples.time
    slow = 20.0 * np.sin(2 * np.pi * 0.24 * time)
    clean = torque_figure(slow)
    assert [curve.style for curve in clean.panels[0].curves] == ["line"]
    assert "mean over" not in clean.caption
    shown = torque_figure(slow + 5.0 * (-1.0) ** np.arange(len(time)))  # ± 5 N m
    band, line = shown.panels[0].curves
    assert band.style == "band"
    known = np.isfinite(line.y)
    assert np.mean(known) > 0.95
    wide = (band.y - band.y_low)[known]  # and what the slow part rises by within the window
    assert 9.0 < wide.min() < 10.5
    assert wide.max() < 14.0
    assert np.max(np.abs(line.y - clean.panels[0].curves[0].y)[known]) < 0.5
    assert re.search(r"its mean, and the shade its range, over [\d.]+ ms", shown.caption)


def test_what_methods_leave_of_friction_is_shown_side_by_side() -> None:
    done = execute(
        trials("stabilization", bench(), {"compensation": name, "cycles": 2, "settle_cycles": 1})[0]
        for name in ("static", "lugre")
    )
    figures = stabilization_figures(done, ("compensation",), [row(n, 1e-4) for n in "ab"])
    *methods, left = next(f for f in figures if f.key == "compensation-torque").panels
    assert [curve.series for curve in left.curves] == ["static", "lugre"]
    for panel, curve in zip(methods, left.curves, strict=True):
        friction, added = panel.curves[0], panel.curves[-1]
        assert friction.series == "reference"
        np.testing.assert_allclose(curve.y, friction.y - added.y)


def test_the_errors_come_first() -> None:
    first, *_ = stabilization_figures(*swept((2.0, 36.0, 1e-4)))
    assert first.key == "error-by-method"


def test_without_trials_there_are_no_figures() -> None:
    assert list(stabilization_figures([], (), [])) == []
