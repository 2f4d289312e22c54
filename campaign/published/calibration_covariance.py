"""Covariance of a calibration, for each reproduced number.

`campaign calibrate` writes it (`[propagation]` of its result), a folder `calibration/` beside a
bench keeps it, a run archives it, and the scoreboard adds it to what trials scatter.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import PurePosixPath

from pydantic import Field, ValidationError

from campaign.options import Options

FOLDER = "calibration"
"""Beside a bench file: holds a file of the same name, which is the result of its calibration."""
LEVEL = 0.95


class PropagationTable(Options):
    """`[propagation]` of a calibration's result."""

    protocol: str = ""
    """File name of the protocol whose tests were simulated."""
    fingerprint: str = ""
    """Of the bench that was calibrated."""
    freedom: int = Field(ge=1)
    """Degrees of freedom of the standard uncertainties."""
    lost: tuple[str, ...] = ()
    """Cells that the bench reproduces, but not any more somewhere within one sigma."""
    standard_uncertainty: dict[str, float] = {}
    """By path of the cell, 1 sigma, in the printed unit."""


@dataclass(frozen=True)
class CalibrationPart:
    """Uncertainty of reproduced numbers by a calibration; without cells it says nothing.

    Attributes:
        standard_uncertainty: cell path to 1 sigma, in the printed unit.
        lost: cells of which the calibration does not even say that they can be found.
    """

    standard_uncertainty: Mapping[str, float] = field(default_factory=dict)
    freedom: int = 1
    lost: frozenset[str] = frozenset()

    @cached_property
    def _student(self) -> float:
        from scipy.special import stdtrit

        return float(stdtrit(self.freedom, 0.5 + 0.5 * LEVEL))

    def half_width(self, path: str) -> float | None:
        """Of the cell's 95 % interval (Student's t), printed unit; None where nothing is known."""
        sigma = self.standard_uncertainty.get(path)
        return None if sigma is None else self._student * sigma


NOTHING = CalibrationPart()


def file_name(bench: str) -> str:
    """Name of the calibration of a bench file: `benches/calibration/platform.toml`."""
    path = PurePosixPath(bench)
    return str(path.parent / FOLDER / path.name)


def calibration_part(sources: Mapping[str, str], fingerprint: str) -> CalibrationPart:
    """What the archived files say of the bench with this fingerprint.

    Args:
        sources: texts by name; those that are no calibration, or one without `[propagation]`, are
            passed over.
    """
    for name, text in sources.items():
        if PurePosixPath(name).parent.name != FOLDER:
            continue
        try:
            found = PropagationTable.model_validate(tomllib.loads(text).get("propagation"))
        except (tomllib.TOMLDecodeError, ValidationError):
            continue
        if fingerprint and found.fingerprint == fingerprint:
            return CalibrationPart(found.standard_uncertainty, found.freedom, frozenset(found.lost))
    return NOTHING
