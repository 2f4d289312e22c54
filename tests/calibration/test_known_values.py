"""What a calibration leaves known of its bench; ends of intervals worked out by hand."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.calibration.document import known_entries
from campaign.calibration.objective import Evaluation
from campaign.calibration.outcome import CalibrationOutcome
from campaign.estimation.linear_uncertainty import Uncertainty

from .laboratory import problem, write


def outcome(folder: Path, **certainty: Any) -> CalibrationOutcome:
    """Both parameters in the middle of their ranges, 20 to 80 (log) and 5 to 40."""
    made = problem(write(folder))
    facts: dict[str, Any] = {
        "half_width": np.array([0.1, 0.2]),
        "bound": ("", ""),
        "low": np.array([0.4, 0.3]),
        "high": np.array([0.6, 0.7]),
        "limit": np.full(2, math.nan),
        "open": (False, False),
        "correlation": np.array([[1.0, -0.6], [-0.6, 1.0]]),
        "scatter": 1.0,
        "freedom": 2,
    }
    nothing = Evaluation({})
    return CalibrationOutcome(
        made,
        np.array([0.5, 0.5]),
        0.0,
        0.0,
        nothing,
        nothing,
        (),
        Uncertainty(**(facts | certainty)),
        (),
        1,
        interrupted=False,
    )


INERTIA, VISCOUS = "axis.inertia", "friction.load.viscous_friction"


def test_intervals_and_correlation(tmp_path: Path) -> None:
    """20 kg m² times 4 to the power of 0.4 and 0.6; 5 + 35 times 0.3 and 0.7 N m s/rad."""
    found = known_entries(outcome(tmp_path), ["A.1"], "table.toml")
    assert (found["document"], found["fitted"]) == ("table.toml", ["A.1"])
    low, high = found["values"][INERTIA]["interval"]
    assert low == f"{20 * 4**0.4:.6g} kg m^2"
    assert high == f"{20 * 4**0.6:.6g} kg m^2"
    assert found["values"][VISCOUS] == {
        "interval": ["15.5 N m s/rad", "29.5 N m s/rad"],
        "origin": "fitted",
    }
    assert found["correlations"] == [[INERTIA, VISCOUS, -0.6]]


@pytest.mark.parametrize(
    "certainty",
    [
        {"bound": ("lower", ""), "half_width": np.array([math.nan, 0.2])},
        {"open": (True, False)},
        {"half_width": np.array([math.nan, 0.2]), "low": np.array([math.nan, 0.3])},
    ],
)
def test_what_the_cells_do_not_determine_has_no_interval(
    tmp_path: Path, certainty: dict[str, Any]
) -> None:
    """Nor does the one stay that an earlier calibration found."""
    found = known_entries(outcome(tmp_path, **certainty), ["A.1"], "thesis")
    assert found["values"][INERTIA] == {"origin": "fitted"}
    assert "interval" in found["values"][VISCOUS]
    assert "correlations" not in found


def test_the_interval_that_holds_beside_a_bound_is_known(tmp_path: Path) -> None:
    """The other took the first one's bound as known: 5 + 35 times 0.2 and 0.8, not 0.3 and 0.7."""
    wide = {"low": np.array([math.nan, 0.2]), "high": np.array([math.nan, 0.8])}
    beside = outcome(tmp_path, bound=("lower", ""), half_width=np.array([math.nan, 0.2]), **wide)
    found = known_entries(beside, ["A.1"], "thesis")
    assert found["values"][VISCOUS]["interval"] == ["12 N m s/rad", "33 N m s/rad"]


def test_an_interrupted_calibration_knows_no_intervals(tmp_path: Path) -> None:
    broken_off = dataclasses.replace(outcome(tmp_path), uncertainty=None)
    found = known_entries(broken_off, ["A.1"], "thesis")
    assert set(found["values"]) == {INERTIA, VISCOUS}
    assert all(entry == {"origin": "fitted"} for entry in found["values"].values())


def test_fields_of_one_parameter_go_together(tmp_path: Path) -> None:
    made = outcome(tmp_path)
    first, second = made.problem.space.parameters
    both = dataclasses.replace(first, fields=((INERTIA, 1.0), ("axis.other", -2.0)))
    space = dataclasses.replace(made.problem.space, parameters=(both, second))
    twice = dataclasses.replace(made, problem=dataclasses.replace(made.problem, space=space))
    found = known_entries(twice, ["A.1"], "thesis")
    assert [INERTIA, "axis.other", -1.0] in found["correlations"]
    assert ["axis.other", VISCOUS, 0.6] in found["correlations"]
    low, high = (float(end.split()[0]) for end in found["values"]["axis.other"]["interval"])
    assert (low, high) == pytest.approx((-2 * 20 * 4**0.6, -2 * 20 * 4**0.4), rel=1e-5)
