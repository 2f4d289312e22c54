"""Bode diagrams: bandwidth and margins stand where closed forms say, and nothing else does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.estimation.servo import characteristics
from campaign.experiments.frequency_response.figures import closed_loop_figures
from campaign.experiments.frequency_response.marks import SIDE_BY_SIDE, place_names, servo_figure
from campaign.experiments.frequency_response.tables import Sweep
from campaign.result import Figure, Mark, Panel
from tests.estimation.loops import closed, response

GAIN, DELAY = 2 * np.pi * 6.0, 2e-3
"""Of L = K exp(-s T) / s: crosses 0 dB at K, and -180 deg where w T is a quarter turn."""
CROSSOVER = GAIN / (2 * np.pi)
PHASE_MARGIN = 0.5 * np.pi - GAIN * DELAY
HALF_TURN = 1 / (4 * DELAY)
GAIN_MARGIN = 20 * math.log10(2 * np.pi * HALF_TURN / GAIN)
ERROR = 2e-4


def sweep(highest: float, method: str = "none", slower: float = 1.0, lowest: float = 0.5) -> Sweep:
    def loop(s: np.ndarray) -> np.ndarray:
        return slower * GAIN * np.exp(-DELAY * s) / s

    measured = response(closed(loop), np.arange(lowest, highest + 0.01, 0.5), ERROR)
    place = {"compensation": method, "loop": "closed"}
    return Sweep(place, "closed", method, measured, characteristics(measured))


def bode(*sweeps: Sweep) -> dict[str, Figure]:
    named = [(s.label, str(s.place["compensation"]), s.response) for s in sweeps]
    found = [s.found for s in sweeps]
    return {f.key: f for f in closed_loop_figures(named, found, place_names(sweeps))}


def points(panel: Panel) -> list[Mark]:
    return [mark for mark in panel.marks if mark.point]


def test_margins_stand_at_their_frequencies() -> None:
    gain, phase = bode(sweep(200.0))["open-loop"].panels
    (dot,) = points(phase)
    assert dot.x == pytest.approx(CROSSOVER, rel=2e-3)
    assert dot.y == pytest.approx(-np.pi + PHASE_MARGIN, abs=2e-3)
    assert dot.label == f"{np.degrees(PHASE_MARGIN):.3g}°"
    (dot,) = points(gain)
    assert dot.x == pytest.approx(HALF_TURN, rel=2e-3)
    assert dot.y == pytest.approx(-GAIN_MARGIN, abs=0.02)
    assert dot.label == f"{GAIN_MARGIN:.3g} dB"


def test_the_dots_lie_on_the_curves() -> None:
    for key, figure in bode(sweep(200.0)).items():
        for panel in figure.panels:
            curve = panel.curves[0]
            for dot in points(panel):
                on = np.interp(np.log(dot.x), np.log(curve.x), curve.y)
                assert dot.y == pytest.approx(on, abs=0.05), key


def test_a_distance_reaches_from_the_line_to_its_dot() -> None:
    gain, phase = bode(sweep(200.0))["open-loop"].panels
    for panel, line in ((gain, 0.0), (phase, -np.pi)):
        (dot,) = points(panel)
        ends = [c for c in panel.curves if len(c.x) == 2 and c.x[0] == c.x[1] == dot.x]
        assert [tuple(c.y) for c in ends] == [(line, dot.y)]


def test_intervals_of_margins_enclose_their_dots() -> None:
    gain, phase = bode(sweep(200.0))["open-loop"].panels
    for panel in (gain, phase):
        (bar,) = (c for c in panel.curves if c.style == "points")
        assert bar.low[0] < bar.y[0] < bar.high[0]


def test_the_bandwidth_is_where_the_gain_is_3_db_down() -> None:
    """|T| of the loop, solved for here."""
    frequency = np.geomspace(1.0, 50.0, 200_000)
    s = 2j * np.pi * frequency
    loop = GAIN * np.exp(-DELAY * s) / s
    level = 20 * np.log10(np.abs(loop / (1 + loop)))
    expected = frequency[np.argmax(level < -3.0)]
    (dot,) = points(bode(sweep(200.0))["closed-loop"].panels[0])
    assert (dot.x, dot.y) == (pytest.approx(expected, rel=2e-3), -3.0)
    assert dot.label == f"{expected:.3g} Hz"


def test_what_compensation_changes_is_shown_apart() -> None:
    """An open loop of nine tenths is 0.915 dB lower, and of the same phase."""
    figures = bode(sweep(200.0), sweep(200.0, "lugre", 0.9))
    _, _, gain, phase = figures["open-loop"].panels
    assert len({panel.x.limits for panel in figures["open-loop"].panels}) == 1
    for panel, change in ((gain, 20 * math.log10(0.9)), (phase, 0.0)):
        (curve,) = panel.curves
        assert curve.series == "lugre"
        inside = (curve.low <= change) & (change <= curve.high)
        assert np.mean(inside) > 0.8
        assert np.median(curve.y) == pytest.approx(change, abs=0.01)
    assert "What compensation changes" in figures["open-loop"].caption


def test_nothing_changes_where_there_is_nothing_to_compare() -> None:
    """One method alone, or another at other frequencies."""
    for sweeps in ([sweep(200.0)], [sweep(200.0), sweep(150.0, "lugre")]):
        figure = bode(*sweeps)["open-loop"]
        assert len(figure.panels) == 2
        assert "what compensation changes" not in figure.caption


def test_dots_of_several_methods_are_told_apart_by_name() -> None:
    figures = bode(sweep(200.0), sweep(200.0, "lugre", 0.9))
    for key, panel in (("closed-loop", 0), ("open-loop", 0), ("open-loop", 1)):
        dots = points(figures[key].panels[panel])
        assert [dot.series for dot in dots] == ["none", "lugre"]
        assert [dot.label.split(" ")[0] for dot in dots] == ["none", "LuGre"]


def test_where_nothing_was_found_nothing_is_drawn() -> None:
    """A sweep that ends below every crossing."""
    figures = bode(sweep(4.0))
    for figure in figures.values():
        for panel in figure.panels:
            assert not points(panel)
            assert all(len(curve.x) > 2 for curve in panel.curves)
    assert "(dots)" not in figures["closed-loop"].caption
    assert "drawn where" not in figures["open-loop"].caption
    assert "extrapolated" not in figures["open-loop"].caption


def test_a_bandwidth_beyond_the_sweep_is_a_line_that_says_at_least() -> None:
    marks = bode(sweep(4.0))["closed-loop"].panels[0].marks
    (bound,) = (mark for mark in marks if mark.x is not None)
    assert bound.x == pytest.approx(4.0)
    assert "≥ 4 Hz" in bound.label


def test_a_bound_of_the_gain_margin_is_a_line_at_the_bound() -> None:
    found = sweep(14.0)
    assert found.found is not None
    bound = found.found.gain_margin
    assert bound.kind == "at least", "the sweep is too short to go on from"
    gain, _ = bode(found)["open-loop"].panels
    assert not points(gain)
    (mark,) = (m for m in gain.marks if "gain margin" in m.label)
    assert mark.y == pytest.approx(-bound.value)
    assert bound.value < GAIN_MARGIN


def test_side_by_side_they_know_what_they_are() -> None:
    sweeps = [sweep(200.0), sweep(200.0, "lugre", 0.9)]
    (figure,) = servo_figure(sweeps)
    assert [panel.title for panel in figure.panels] == ["Bandwidth", "Gain margin", "Phase margin"]
    for panel, name in zip(
        figure.panels, ("bandwidth", "gain_margin", "phase_margin"), strict=True
    ):
        assert [name for _, name in panel.x.places] == ["none", "LuGre"]
        for place, (curve, one) in enumerate(zip(panel.curves, sweeps, strict=True)):
            estimate = getattr(one.found, name)
            assert (curve.x[0], curve.y[0]) == (place, estimate.value)
            assert (curve.low[0], curve.high[0]) == estimate.combined
            assert curve.quantity == name
            assert curve.conditions == one.place


def test_a_bound_beside_numbers_says_so() -> None:
    (figure,) = servo_figure([sweep(14.0), sweep(200.0, "lugre", 0.9)])
    (panel,) = (panel for panel in figure.panels if panel.title == "Gain margin")
    (mark,) = panel.marks
    assert mark.label == "at least"
    assert np.isposinf(panel.curves[0].high[0]), "an arrow, and no bar that ends somewhere"


def test_what_no_sweep_shows_has_no_panel_and_too_many_no_figure() -> None:
    (figure,) = servo_figure([sweep(4.0)] * 2)
    assert [panel.title for panel in figure.panels] == ["Bandwidth"]
    assert list(servo_figure([])) == list(servo_figure([sweep(200.0)])) == [], "a table says it"
    assert list(servo_figure([sweep(4.0)] * (SIDE_BY_SIDE + 1))) == []
