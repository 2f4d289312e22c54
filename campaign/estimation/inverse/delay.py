"""Delay between recorded drive signal and motion.

A command with a zero-order hold acts half a sample late. A bus or a filter adds to the delay. The
delay times the inertia acts as a term of the jerk and biases all terms that are similar to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import shifted_by, with_error
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.regression import Piece, fitted, regress, stacked
from campaign.estimation.inverse.rows import all_rows, late_force, moving, rows
from campaign.estimation.inverse.terms import Terms
from campaign.reason import Cause

LONGEST = 0.02
"""Largest delay in the search (s), unless `SAMPLES` samples are longer."""
SAMPLES = 5.0
"""Least range of the search in samples."""
OWN = 0.05
"""Least share of the effect of a delay that is independent of the other terms."""
METHOD = "least residual over a shift of the force, Bartlett HAC"
HALF_BAND_OPEN = Cause("half band open", "half the band does not determine it: {why}")
STILL_FALLING = Cause(
    "residual still falling", "the residual still falls at {milliseconds:+.3g} ms"
)
LIKE_OTHER_TERMS = Cause(
    "delay like other terms",
    "a later force looks like other terms in this motion: all but {own_percent:.1g} % of it",
)
STEADY_FORCE = Cause(
    "force hardly changing", "the force hardly changes: its delay cannot be estimated"
)


def find_delay(motions: Sequence[Motion], terms: Terms, filtering: FilterSettings) -> Estimate:
    """Delay of the force after its record (s); negative if it is recorded late.

    The difference from the result with half the band is a systematic part, because the response of
    a loop to sensor noise resembles a delay, more so in a wider band. All motions have one sample
    rate. Not determined if the minimum of the residual lies at an end of the search.
    """
    delay = _in_band(motions, terms, filtering)
    if math.isnan(delay.value):
        return delay
    try:
        other = _in_band(motions, terms, filtering.half_band)
    except ValueError:
        return delay
    if math.isnan(other.value):
        reason = HALF_BAND_OPEN(why=other.reason)
        return Estimate.without_interval("delay", math.nan, "s", reason, method=METHOD)
    return shifted_by(delay, "band", abs(other.value - delay.value))


def _in_band(motions: Sequence[Motion], terms: Terms, filtering: FilterSettings) -> Estimate:
    from scipy.optimize import minimize_scalar

    rate = motions[0].sample_rate
    reach = max(LONGEST, SAMPLES / rate)
    moves = np.concatenate([moving(motion, filtering) for motion in motions])
    design, _ = stacked([rows(motion, terms, filtering) for motion in motions])
    basis = np.linalg.qr(design)[0]
    forces = [late_force(each, filtering) for each in motions]

    def left(delay: float) -> float:
        force = np.concatenate([each(delay) for each in forces]) * moves
        rest = force - basis @ (basis.T @ force)
        return float(rest @ rest)

    tried = np.linspace(-reach, reach, 21)
    best = int(np.argmin([left(float(each)) for each in tried]))
    if best in (0, len(tried) - 1):
        reason = STILL_FALLING(milliseconds=tried[best] * 1e3)
        return Estimate.without_interval("delay", math.nan, "s", reason, method=METHOD)
    ends = (float(tried[best - 1]), float(tried[best + 1]))
    least = float(minimize_scalar(left, bounds=ends, method="bounded").x)
    return _with_interval(least, motions, terms, filtering, reach)


def _with_interval(
    delay: float, motions: Sequence[Motion], terms: Terms, filtering: FilterSettings, reach: float
) -> Estimate:
    """Interval from an additional column: the time derivative of the model's force."""
    values = regress([rows(motion, terms, filtering, delay) for motion in motions]).values
    wider = []
    for motion in motions:
        whole = all_rows(motion, terms, filtering, delay)
        change = np.gradient(whole.columns @ values, whole.time)
        moves = moving(motion, filtering)
        both = np.column_stack([whole.columns, change])
        wider.append(Piece(both * moves[:, None], whole.force * moves, whole.time))
    design, force = stacked(wider)
    if (own := _own_share(design)) < OWN:
        reason = LIKE_OTHER_TERMS(own_percent=100 * own)
        return Estimate.without_interval("delay", math.nan, "s", reason, method=METHOD)
    fit = fitted(wider, np.asarray(np.linalg.pinv(design)), design, force)
    error = float(fit.robust[-1])
    if not fit.quantile * error < reach:
        return Estimate.without_interval("delay", math.nan, "s", STEADY_FORCE(), method=METHOD)
    return with_error("delay", delay, "s", error, fit.freedom, METHOD, fit.quantile)


def _own_share(design: Array) -> float:
    """Share of the norm of the last column of (n, k) that the others do not explain.

    A single sine does not determine a delay: inertia and viscous friction also shift its phase.
    """
    others, last = design[:, :-1], design[:, -1]
    rest = last - others @ np.linalg.lstsq(others, last, rcond=None)[0]
    return float(np.linalg.norm(rest) / max(float(np.linalg.norm(last)), 1e-300))
