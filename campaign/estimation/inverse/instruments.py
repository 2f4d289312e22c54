"""Instrumental variables from the commanded motion.

A measured rate contains noise, and in a loop the force responds to that noise. Both bias least
squares. The commanded motion is independent of the noise. Source: Janot, Vandanjon, Gautier,
IEEE Trans. Control Syst. Technol. 22 (2014); strength of instruments: Sanderson and Windmeijer,
J. Econometrics 190 (2016).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.regression import (
    Piece,
    Regression,
    effective_count,
    fitted,
    stacked,
)

WEAK = 10.0
"""F of the first stage below which the instrument does not determine a coefficient."""


@dataclass(frozen=True)
class InstrumentFit:
    """A regression by instruments.

    Attributes:
        strength: conditional F of the first stage, shape (k,), with the effective number of rows.
    """

    fit: Regression
    strength: Array


def by_instruments(pieces: Sequence[Piece], instruments: Sequence[Piece]) -> InstrumentFit:
    """Coefficients with the same columns of another motion as instruments, row by row.

    Raises ValueError if the instruments do not determine the coefficients.
    """
    design, force = stacked(pieces)
    other, _ = stacked(instruments)
    across = other.T @ design
    length = np.linalg.norm(other, axis=0)
    if not np.all(length > 0):
        raise ValueError("the setpoints do not excite some term of the model")
    scaled = across / np.outer(length, np.linalg.norm(design, axis=0))
    if np.linalg.cond(scaled) > 1e8:
        raise ValueError("the setpoints do not separate the model's terms")
    inverse = np.asarray(np.linalg.solve(across, other.T))
    fit = fitted(pieces, inverse, design, force)
    return InstrumentFit(fit, _strength(design, other, pieces))


def _strength(design: Array, other: Array, pieces: Sequence[Piece]) -> Array:
    basis = np.linalg.qr(other)[0]
    cuts = np.cumsum([len(piece.force) for piece in pieces])[:-1]

    def explained(values: Array) -> Array:
        return np.asarray(basis @ (basis.T @ values))

    strengths = []
    for index in range(design.shape[1]):
        rest = np.delete(design, index, axis=1)
        own = design[:, index]
        if rest.shape[1]:
            own = own - rest @ np.linalg.lstsq(explained(rest), own, rcond=None)[0]
        projection = explained(own)
        residual = own - projection
        count = effective_count(np.split(residual, cuts))
        noise = max(float(residual @ residual), float(np.finfo(float).tiny))
        strengths.append(float(projection @ projection) / noise * max(count - other.shape[1], 1.0))
    return np.array(strengths)
