"""Figures of sensitivity, observer gain, step response, model output: marks where they belong."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.estimation.threshold import Threshold
from campaign.experiments.observer_gain.figures import error_figure
from campaign.experiments.observer_gain.metrics import Gain
from campaign.experiments.sensitivity.results import (
    Response,
    ResponseVerdict,
    judge,
    sensitivity_figure,
    thresholds_figure,
)
from campaign.result import Figure, Mark, Panel
from tests.experiments.laboratory import analyse, execute, trials
from tests.physics.benches import bench

CHANGES = np.linspace(-0.8, 0.8, 17)
LIMIT = Threshold(0.2e-3)


# --- sensitivity ----------------------------------------------------------------------------


def response(below: float, above: float, deviation: float = 1e-6) -> Response:
    """0.1 mrad unchanged, and straight to either side, that much more per unit of change."""
    slopes = np.where(CHANGES < 0, below, above)
    values = 1e-4 + 1e-4 * slopes * np.abs(CHANGES)
    errors = (Estimate("e", float(v), "rad", standard_error=deviation) for v in values)
    return Response(CHANGES, tuple(errors), np.column_stack([CHANGES, values]))


def judged() -> tuple[ResponseVerdict, ...]:
    """Passed at -0.4, at +0.5, and by nothing."""
    return judge(
        {
            "coulomb_torque": response(2.5, 0.1),
            "static_torque": response(0.1, 2.0),
            "viscous_friction": response(0.1, 0.1),
        },
        LIMIT,
    )


def thresholds() -> Figure:
    (figure,) = thresholds_figure(judged(), LIMIT, "lugre", {"compensation": "lugre"})
    return figure


def test_thresholds_stand_by_rank_with_their_intervals() -> None:
    (panel,) = thresholds().panels
    assert [name for _, name in panel.x.places] == ["Tc", "Ts", "σ2\nnot reached"]
    dots = [curve for curve in panel.curves if curve.style == "points"]
    assert [dot.y[0] for dot in dots[:2]] == pytest.approx([0.4, 0.5], rel=1e-3)
    for dot in dots[:2]:
        assert dot.low[0] < dot.y[0] < dot.high[0]
    assert [dot.conditions["parameter"] for dot in dots] == [
        "coulomb_torque",
        "static_torque",
        "viscous_friction",
    ]


def test_a_threshold_that_is_not_reached_has_no_upper_end() -> None:
    (panel,) = thresholds().panels
    passed, other, bound = panel.curves
    assert bound.x[0] == 2.0
    assert np.isposinf(bound.high[0])
    assert np.isfinite([passed.high[0], other.high[0]]).all()
    assert "arrow goes up" in thresholds().caption


def test_nothing_is_said_of_bounds_where_there_are_none() -> None:
    only = judge({"coulomb_torque": response(2.5, 0.1)}, LIMIT)
    (figure,) = thresholds_figure(only, LIMIT, "lugre", None)
    assert "goes up" not in figure.caption
    assert {curve.quantity for curve in figure.panels[0].curves} == {""}


@pytest.mark.parametrize(("place", "at"), [(0, -0.4), (1, 0.5)])
def test_the_passing_is_marked_on_its_own_side(place: int, at: float) -> None:
    panel = sensitivity_figure(judged(), LIMIT, "lugre").panels[place]
    (dot,) = (mark for mark in panel.marks if mark.point)
    assert (dot.x, dot.y) == (pytest.approx(at, rel=1e-3), LIMIT.value)
    (shade,) = (mark for mark in panel.marks if mark.until is not None)
    assert min(shade.x, shade.until) < dot.x < max(shade.x, shade.until)
    assert f"passes at {100 * abs(at):.0f} %" in panel.title


def test_what_is_not_passed_has_a_line_only() -> None:
    panel = sensitivity_figure(judged(), LIMIT, "lugre").panels[2]
    (line,) = panel.marks
    assert (line.label, line.y, line.x) == ("0.2 mrad", LIMIT.value, None)
    assert "not reached by 80 %" in panel.title


# --- observer gain --------------------------------------------------------------------------


def gain(corner: float, error: float | None, unstable: str = "") -> Gain:
    found = None if error is None else Estimate("error", error, "rad", 0.9 * error, 1.1 * error)
    return Gain(corner, 1.0, found, None, None, None, (), unstable)


def marks_of(gains: list[Gain], limit: float | None) -> dict[str, Mark]:
    (figure,) = error_figure(gains, 2.0, limit)
    return {mark.label: mark for mark in figure.panels[0].marks}


def test_the_limit_of_stability_lies_between_two_gains() -> None:
    gains = [gain(0.0, 5e-4), gain(2.0, 1e-4), gain(8.0, 5e-5), gain(32.0, None, "limit")]
    marks = marks_of(gains, 20.0)
    assert (marks["becomes unstable"].x, marks["becomes unstable"].until) == (8.0, 32.0)
    assert marks["unstable by eigenvalues"].x == 20.0
    assert marks["without observer"].y == 5e-4
    (figure,) = error_figure(gains, 2.0, 20.0)
    assert "Shaded: between the highest gain that was stable" in figure.caption


def test_a_loop_that_stays_stable_has_no_limit_and_says_so() -> None:
    gains = [gain(0.0, 5e-4), gain(2.0, 1e-4), gain(8.0, 5e-5)]
    marks = marks_of(gains, None)
    assert set(marks) == {"the bench's", "without observer"}
    (figure,) = error_figure(gains, 2.0, None)
    assert "stable at every gain that was tried, up to 8 Hz" in figure.caption
    assert "Equation 5.4" not in figure.caption, "no line of theory, no word of it"


def test_a_limit_far_beyond_what_was_tried_does_not_stretch_the_axis() -> None:
    assert "unstable by eigenvalues" not in marks_of([gain(0.0, 5e-4), gain(2.0, 1e-4)], 500.0)


def test_nothing_stable_nothing_drawn() -> None:
    assert list(error_figure([gain(0.0, 5e-4), gain(2.0, None, "limit")], 2.0, 1.0)) == []


# --- step response --------------------------------------------------------------------------


def step_panel(**options: object) -> Panel:
    result = analyse("step_response", execute(trials("step_response", bench(), options)))
    return result.figures[0].panels[0]


def test_rise_overshoot_and_settling_are_marked_on_the_curve() -> None:
    """Read off the drawn curve again, on its samples."""
    panel = step_panel(step="1 deg/s")
    curve = panel.curves[-1]
    share = curve.y / np.deg2rad(1.0)
    marks = {mark.label.split(" ")[0]: mark for mark in panel.marks}
    at = {level: float(curve.x[np.argmax(share >= level)]) for level in (0.1, 0.9)}
    assert (marks["rise"].x, marks["rise"].until) == pytest.approx((at[0.1], at[0.9]), abs=1e-3)
    outside = np.flatnonzero((np.abs(share - 1.0) > 0.02) & (curve.x > 0))
    assert marks["settled"].x == pytest.approx(float(curve.x[outside[-1]]), abs=2e-3)
    assert marks["settled"].label == f"settled {1e3 * marks['settled'].x:.3g} ms"
    assert marks["overshoot"].y == np.max(curve.y)
    assert marks["overshoot"].label == f"overshoot {100 * (np.max(share) - 1):.3g} %"
    assert (marks["±2"].y, marks["±2"].until) == pytest.approx(
        (0.98 * np.deg2rad(1.0), 1.02 * np.deg2rad(1.0))
    )


def test_a_step_that_did_not_settle_has_no_mark_of_it() -> None:
    panel = step_panel(linear=False, duration="0.06 s", ramp="5 ms")
    assert not [mark for mark in panel.marks if mark.label.startswith("settled")]


def test_several_steps_say_whose_numbers_are_marked() -> None:
    planned = trials("step_response", bench(), {}, [{"linear": True}, {"linear": False}])
    (figure,) = analyse("step_response", execute(planned)).figures
    assert "Marked are numbers of: linear loop." in figure.caption


# --- model output ---------------------------------------------------------------------------


def sine_figure(**options: object) -> Figure:
    done = execute(trials("model_output", bench(), {"compensation": ["lugre"], **options}))
    return next(f for f in analyse("model_output", done).figures if f.key == "sine")


def test_what_compensation_leaves_is_the_difference_of_the_curves_beside_it() -> None:
    figure = sine_figure(models=[])
    whole, _, left = figure.panels
    assert left.title == "What compensation leaves"
    friction, model = (curve.y for curve in whole.curves)
    np.testing.assert_allclose(left.curves[0].y, friction - model)
    assert "less the output of its model" in figure.caption


def test_of_several_frictions_nothing_is_left() -> None:
    figure = sine_figure(models=["stribeck", "lugre"])
    assert len(figure.panels) == 2
    assert "less the output" not in figure.caption
