"""Coefficients of an inverse dynamic model as estimates: scatter, and what other rows would say.

`coefficients` is for terms that are known and a force that is not late. Where terms and delay are
to be found as well, `campaign.experiments.any_motion` does that, with the same two steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, shifted_by
from campaign.estimation.inverse.motion import Array, Filtering, Motion
from campaign.estimation.inverse.regression import Regression, regress
from campaign.estimation.inverse.rows import rows
from campaign.estimation.inverse.terms import Term
from campaign.reason import Cause

FASTER = 5.0
"""times the slowest rate of a row: rows below that are left out to see what they do."""
METHOD = "least squares; deviation with autocorrelation (Newey and West)"
TOO_FEW_ROWS = Cause(
    "too few independent rows", "what is left over is worth too few independent rows"
)


def coefficients(
    motions: Sequence[Motion], terms: Sequence[Term], filtering: Filtering
) -> tuple[Regression, dict[str, Estimate]]:
    """Of all motions together, by the names of the terms.

    Systematic parts of a coefficient are how far it goes with half the band of the rows, and
    without slow rows, where friction is more than these terms say (Stribeck's, bristles, a force
    that is late as it reverses). Raises ValueError where the motions do not tell the terms apart.
    """
    fit = regress([rows(motion, terms, filtering) for motion in motions])
    parts = {"band": filtering.half_band}
    if filtering.slowest > 0.0:
        parts["slow rows"] = replace(filtering, slowest=FASTER * filtering.slowest)
    moved = {name: shifts(fit, motions, terms, each) for name, each in parts.items()}
    return fit, estimates(fit, terms, moved)


def estimates(
    fit: Regression, terms: Sequence[Term], parts: Mapping[str, Array | None]
) -> dict[str, Estimate]:
    """Of a regression, by the names of its terms: scatter with autocorrelation.

    parts: sources of systematic parts, and how far each shifts the coefficients, shape (k,); None
        where that is not known.
    """
    found = {}
    for index, term in enumerate(terms):
        value, error = float(fit.values[index]), float(fit.robust[index])
        wide = fit.quantile * error
        if fit.freedom < 1.0 or not math.isfinite(wide):
            found[term.name] = Estimate.without_interval(
                term.name, value, term.unit, TOO_FEW_ROWS()
            )
            continue
        one = Estimate(
            term.name, value, term.unit, value - wide, value + wide, LEVEL, METHOD,
            standard_error=error, freedom=fit.freedom,
        )  # fmt: skip
        for source, far in parts.items():
            one = shifted_by(one, source, None if far is None else float(far[index]))
        found[term.name] = one
    return found


def shifts(
    fit: Regression,
    motions: Sequence[Motion],
    terms: Sequence[Term],
    filtering: Filtering,
    delay: float = 0.0,
) -> Array | None:
    """How far coefficients go with rows made otherwise, shape (k,); None where they tell none.

    delay: by which the force is late in these rows (s).
    """
    try:
        other = regress([rows(motion, terms, filtering, delay) for motion in motions])
    except ValueError:
        return None
    return np.asarray(np.abs(other.values - fit.values))
