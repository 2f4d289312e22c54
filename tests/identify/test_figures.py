"""What is drawn of an identification is what was fitted, and from where on."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.inverse.motion import FilterSettings, motion_of_position
from campaign.experiments.any_motion.figures import figures, friction_figure
from campaign.experiments.any_motion.inverse_fit import InverseDynamics, predicted
from campaign.experiments.any_motion.inverse_fit import find as find_inverse
from campaign.experiments.any_motion.motions import MotionPiece, with_slowest
from campaign.experiments.frequency_response.model.frequency_fit import Masses
from campaign.experiments.frequency_response.model.tables import figures as response_figures
from campaign.experiments.whole_model.residuals import models
from campaign.experiments.whole_model.tables_and_figures import figures as whole_figures
from campaign.experiments.whole_model.whole_model_fit import find as find_whole
from campaign.result import Curve, Figure
from tests.estimation.rigs import Rig, random_rigs


@pytest.fixture(scope="module")
def rig() -> Rig:
    return random_rigs(3, seed=4, seconds=15.0)[1]


@pytest.fixture(scope="module")
def regression(rig: Rig) -> InverseDynamics:
    filtering = FilterSettings.for_rate(1000.0)
    motion = motion_of_position(rig.time, rig.angle, rig.force, filtering.low_pass)
    pieces = [MotionPiece(1, motion, None)]
    return find_inverse(pieces, [], with_slowest(filtering, pieces, None), linear=False)


def curves(figure: Figure, panel: int = 0) -> dict[str, Curve]:
    return {curve.label: curve for curve in figure.panels[panel].curves}


def test_rows_that_stand_still_are_in_no_curve_of_friction(regression: InverseDynamics) -> None:
    """They were not fitted: friction there is whatever it takes, and no model's."""
    shown = curves(friction_figure(regression))
    slowest = regression.filtering.slowest
    assert slowest > 0
    assert len(shown["rows"].x) > 500
    for curve in shown.values():
        assert np.nanmin(np.abs(curve.x)) >= slowest
    model = shown["model"]
    known = np.isfinite(model.x)
    assert (np.sign(model.y[known]) == np.sign(model.x[known])).all()


@pytest.mark.slow
def test_the_plain_regression_is_drawn_beside_the_friction_models(
    regression: InverseDynamics, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "campaign.experiments.whole_model.whole_model_fit.models", lambda *told: models(*told)[1:2]
    )
    still = replace(regression.filtering, slowest=0.25 * regression.filtering.slowest)
    whole = find_whole(regression.pieces, [], still, starts=1)
    [figure] = whole_figures(whole, regression, [])
    line = curves(figure)["plain regression"]
    by_direction = regression.tried[1].structure
    told = dict(zip(by_direction.names, by_direction.fit.values, strict=True))
    for sign, way in ((1.0, "positive"), (-1.0, "negative")):
        own = sign * line.x > 0
        expected = sign * told[f"coulomb_{way}"] + told[f"viscous_{way}"] * line.x[own]
        assert line.y[own] == pytest.approx(expected)
    fitted = {each.model.name for each in whole.fits}
    assert curves(figure).keys() == {"rows", "plain regression", *fitted}


def test_no_line_leads_from_one_recording_to_the_next(regression: InverseDynamics) -> None:
    best = regression.best
    early = predicted(regression.pieces[0].motion, best.structure, regression.filtering, 0.0)
    tried = [replace(each, predictions=(early, early)) for each in regression.tried]
    shown = {each.key: each for each in figures(replace(regression, tried=tuple(tried)))}
    lines = [c for key in ("prediction", "models") for p in shown[key].panels for c in p.curves]
    assert len(lines) >= 5
    for line in lines:
        gap = np.flatnonzero(np.isnan(line.x))
        assert gap.tolist() == [len(early.time)]
        assert np.isnan(line.y[gap]).all()


def test_a_model_of_a_response_is_drawn_where_it_was_fitted() -> None:
    frequency = np.geomspace(0.5, 50.0, 40)
    n = len(frequency)
    measured = MeasuredResponse(
        frequency, 1.0 / (1j * frequency), np.full(n, 1e-6), np.full(n, np.inf), np.ones(n),
        np.zeros(n),
    )  # fmt: skip
    function = SimpleNamespace(misfit=False, lowest=1.0, highest=20.0, value=lambda f: 1 / (1j * f))
    drive = SimpleNamespace(misfit=False, rigid=False, value=lambda f, place: 1.1 / (1j * f))
    source = SimpleNamespace(
        responses={"load": measured}, closed=None, best={}, name="a source", trials=(1,)
    )
    found = SimpleNamespace(source=source, fits={"load": SimpleNamespace(fit=function)}, modes={})
    masses = Masses(drive, source, places={"load": "motor"}, lowest=4.0)  # type: ignore[arg-type]
    bode = next(iter(response_figures([found], masses)))  # type: ignore[list-item]
    for panel in (0, 1):
        shown = curves(bode, panel)
        assert shown["measured"].x == pytest.approx(frequency)
        assert shown["rational function"].x[[0, -1]] == pytest.approx([1.0, 20.0])
        assert shown["two inertias"].x[[0, -1]] == pytest.approx([4.0, 50.0])
