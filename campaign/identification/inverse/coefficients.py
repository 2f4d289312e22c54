"""Coefficients of an inverse dynamic model whose terms are known, with what scatter and band do.

Where terms and delay are to be found as well, `campaign.identifying.inverse` does that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate
from campaign.identification.intervals import LEVEL, shifted_by
from campaign.identification.inverse.motion import Array, Filtering, Motion
from campaign.identification.inverse.regression import Regression, regress
from campaign.identification.inverse.rows import rows
from campaign.identification.inverse.terms import Term

FASTER = 5.0
"""times the slowest rate of a row: rows below that are left out to see what they do."""
METHOD = "least squares; deviation with autocorrelation (Newey and West)"


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
    moved = {name: _moved(fit, motions, terms, each) for name, each in parts.items()}
    found = {}
    for index, term in enumerate(terms):
        value, error = float(fit.values[index]), float(fit.robust[index])
        wide = fit.quantile * error
        if fit.freedom < 1.0 or not math.isfinite(wide):
            reason = "what is left over is worth too few independent rows"
            found[term.name] = Estimate.without_interval(term.name, value, term.unit, reason)
            continue
        one = Estimate(
            term.name, value, term.unit, value - wide, value + wide, LEVEL, METHOD,
            standard_error=error, freedom=fit.freedom,
        )  # fmt: skip
        for name, shifts in moved.items():
            one = shifted_by(one, name, None if shifts is None else float(shifts[index]))
        found[term.name] = one
    return fit, found


def _moved(
    fit: Regression, motions: Sequence[Motion], terms: Sequence[Term], filtering: Filtering
) -> Array | None:
    """How far coefficients go with rows made otherwise, shape (k,); None where they tell none."""
    try:
        other = regress([rows(motion, terms, filtering) for motion in motions])
    except ValueError:
        return None
    return np.asarray(np.abs(other.values - fit.values))
