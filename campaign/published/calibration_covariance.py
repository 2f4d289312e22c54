"""Covariance of a calibration, for each reproduced number.

`campaign calibrate` writes it (`[propagation]` of its result) into a folder `calibration/` beside a
bench. A run archives it, and the scoreboard adds it to the scatter of trials.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from pydantic import Field, ValidationError

from campaign.options import Options
from campaign.published.draws import student

FOLDER = "calibration"
"""Folder beside a bench file; its file of the same name is the result of the calibration."""


class PropagationTable(Options):
    """`[propagation]` of a calibration's result."""

    protocol: str = ""
    """File name of the protocol whose tests were simulated."""
    fingerprint: str = ""
    """Fingerprint of the calibrated bench."""
    freedom: int = Field(ge=1)
    """Degrees of freedom of the standard uncertainties."""
    lost: tuple[str, ...] = ()
    """Cells that the bench reproduces, but not everywhere within one sigma."""
    standard_uncertainty: dict[str, float] = {}
    """Uncertainty (1 sigma) by path of the cell, in the printed unit."""


@dataclass(frozen=True)
class CalibrationPart:
    """Uncertainty of reproduced numbers by a calibration; empty if unknown.

    Attributes:
        standard_uncertainty: 1 sigma by cell path, in the printed unit.
        lost: paths of cells without a number somewhere within the calibration uncertainty.
    """

    standard_uncertainty: Mapping[str, float] = field(default_factory=dict)
    freedom: int = 1
    lost: frozenset[str] = frozenset()

    def half_width(self, path: str) -> float | None:
        """Half-width of the cell's 95 % interval (Student's t), printed unit; None if unknown."""
        sigma = self.standard_uncertainty.get(path)
        return None if sigma is None else student(self.freedom) * sigma


NOTHING = CalibrationPart()


def file_name(bench: str) -> str:
    """File name of a bench's calibration, e.g. `benches/calibration/platform.toml`."""
    path = PurePosixPath(bench)
    return str(path.parent / FOLDER / path.name)


def calibration_part(sources: Mapping[str, str], fingerprint: str) -> CalibrationPart:
    """Calibration of the bench with this fingerprint, from the archived files.

    Args:
        sources: texts by file name; texts without a valid `[propagation]` are ignored.
    """
    for name, text in sources.items():
        if PurePosixPath(name).parent.name != FOLDER:
            continue
        try:
            table = PropagationTable.model_validate(tomllib.loads(text).get("propagation"))
        except (tomllib.TOMLDecodeError, ValidationError):
            continue
        if fingerprint and table.fingerprint == fingerprint:
            return CalibrationPart(table.standard_uncertainty, table.freedom, frozenset(table.lost))
    return NOTHING
