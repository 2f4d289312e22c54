"""Delay between recorded drive signal and motion.

A command that is held for a sample acts half a sample late; a bus or a filter adds to it. Times the
inertia it looks like a term of the jerk, and all that share its shape are wrong by it.
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
"""s; delays are looked for up to this, or up to `SAMPLES` samples where these are longer."""
SAMPLES = 5.0
"""Fewest samples up to which delays are looked for."""
OWN = 0.05
"""Share of what a delay changes that has to be like no other term."""
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
    """How much later the force acts than it is recorded (s); negative where it is recorded late.

    What half the band finds otherwise is a systematic part: a loop that answers the noise of what
    it measures looks like a delay, the more so the wider the band. All motions have one sample
    rate. Not determined where the least residual lies at the end of what was looked at.
    """
    found = _in_band(motions, terms, filtering)
    if math.isnan(found.value):
        return found
    try:
        other = _in_band(motions, terms, filtering.half_band)
    except ValueError:
        return found
    if math.isnan(other.value):
        reason = HALF_BAND_OPEN(why=other.reason)
        return Estimate.without_interval("delay", math.nan, "s", reason, method=METHOD)
    return shifted_by(found, "band", abs(other.value - found.value))


def _in_band(motions: Sequence[Motion], terms: Terms, filtering: FilterSettings) -> Estimate:
    from scipy.optimize import minimize_scalar

    rate = motions[0].sample_rate
    reach = max(LONGEST, SAMPLES / rate)
    moves = np.concatenate([moving(motion, filtering) for motion in motions])
    design, _ = stacked([rows(motion, terms, filtering) for motion in motions])
    basis = np.linalg.qr(design)[0]
    forces = [late_force(each, filtering) for each in motions]

    def left(delay: float) -> float:
        force = np.concatenate([each.at(delay) for each in forces]) * moves
        rest = force - basis @ (basis.T @ force)
        return float(rest @ rest)

    tried = np.linspace(-reach, reach, 21)
    best = int(np.argmin([left(float(each)) for each in tried]))
    if best in (0, len(tried) - 1):
        reason = STILL_FALLING(milliseconds=tried[best] * 1e3)
        return Estimate.without_interval("delay", math.nan, "s", reason, method=METHOD)
    ends = (float(tried[best - 1]), float(tried[best + 1]))
    found = float(minimize_scalar(left, bounds=ends, method="bounded").x)
    return _with_interval(found, motions, terms, filtering, reach)


def _with_interval(
    delay: float, motions: Sequence[Motion], terms: Terms, filtering: FilterSettings, reach: float
) -> Estimate:
    """By a column more: how the model's own force changes in time."""
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
    """Of the last column, of shape (n, k), what the others do not explain: its norm over its own.

    A single sine in one direction has no time: inertia and viscous friction turn it as a delay.
    """
    others, last = design[:, :-1], design[:, -1]
    rest = last - others @ np.linalg.lstsq(others, last, rcond=None)[0]
    return float(np.linalg.norm(rest) / max(float(np.linalg.norm(last)), 1e-300))
