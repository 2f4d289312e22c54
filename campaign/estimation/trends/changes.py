"""Drift and jumps of a number from the same points.

A trend is a line over time, temperature, or another quantity in which runs differ. A jump is a
change from one level to another. Both tests include the scatter between runs and the correlation
of neighboring runs (`scatter`). The place of a jump is searched: its p value is the smallest of
all places times their number (Bonferroni). This is valid for any dependence between places.
Source of the splitting: Vostrikova, Soviet Mathematics Doklady 24 (1981).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.trends.scatter import Fits, Mixture, fits

LEAST_FOR_A_JUMP = 5
"""Fewest points for a jump: after two levels, three remain to estimate the scatter of runs."""
ON_EACH_SIDE = 2
"""Fewest points on a side of a jump: a single point can also be an outlier."""
CLEARLY = math.log(3.0)
"""Logarithm of the ratio of integrated likelihoods above which one shape fits clearly better."""
HELD = 0.95
"""Least total probability of the places in `Jump.between`."""
POWER = 0.8
"""Probability with which a change of the detectable size is declared."""
PICKED = 1e-3
"""Least weight of a place that contributes to the size of a jump."""


@dataclass(frozen=True)
class Trend:
    """A line y = a + b x through points.

    Attributes:
        slope: b.
        p: two-sided p value of b = 0.
        scatter: typical standard deviation between runs, without their own errors.
        correlation: of neighboring runs, as estimated from the points.
    """

    slope: Mixture
    p: float
    scatter: float
    correlation: float
    fits: Fits

    def at(self, x: float) -> Mixture:
        """Value of the line."""
        return self.fits.line(x)


@dataclass(frozen=True)
class Jump:
    """Change of level at one place.

    Attributes:
        place: index of the first point after the jump, at its most likely place.
        between: first and last of the places that have 95 % of the weight.
        size: level after less level before, averaged over the likely places. Because the place
            is searched, the size of a barely significant jump tends to be too large.
        p: p value of no jump at any place.
        places: number of places tried.
        clearest: size at the place with the smallest uncertainty, for the detectable size.
    """

    place: int
    between: tuple[int, int]
    size: Mixture
    p: float
    places: int
    clearest: Mixture


@dataclass(frozen=True)
class Change:
    """Trend and jump of one series.

    Attributes:
        trend: None without an x.
        jump: None for fewer than five points.
        shape: `line` or `jump`, the shape that fits clearly better; "" for neither.
    """

    trend: Trend | None
    jump: Jump | None
    shape: str


def change(x: Array | None, values: Array, own: Array, *, jumps: bool = True) -> Change:
    """Trend and jump of a series.

    Args:
        x: abscissa of the trend, shape (n,), in any unit; None for jumps only.
        values: shape (n,), in the order of measurement.
        own: covariance of the values' own errors, shape (n, n), without errors common to all
            values. Zeros: unknown; then only the scatter between runs remains.
        jumps: whether to test for jumps, which need a meaningful order.

    Raises ValueError for fewer than three points, for equal values, and for a constant x.
    """
    n = len(values)
    steps = steps_of(n) if jumps and n >= LEAST_FOR_A_JUMP else np.empty((n, 0))
    lines = np.empty((n, 0)) if x is None else np.asarray(x, dtype=float)[:, None]
    if lines.shape[1] + steps.shape[1] == 0:
        raise ValueError(f"{n} points are too few for a jump; {LEAST_FOR_A_JUMP} are the least")
    models = fits(values, np.hstack([lines, steps]), own)
    first = lines.shape[1]
    trend = _trend(models) if first else None
    jump = _jump(models, first) if steps.shape[1] else None
    shape = _shape(models.evidence) if trend is not None and jump is not None else ""
    return Change(trend, jump, shape)


def steps_of(n: int) -> Array:
    """One column for each place of a jump, shape (n, n - 3): 0 before the jump, 1 after it."""
    places = np.arange(ON_EACH_SIDE, n - ON_EACH_SIDE + 1)
    return (np.arange(n)[:, None] >= places).astype(float)


def jumps_of(values: Array, own: Array, level: float) -> tuple[Jump, ...]:
    """All jumps, in order: each part is split again until no significant jump remains.

    values, own: as for `change`. level: p value at which a jump is declared. Two parts share it, so
    that the probability of a further false jump is at most `level` at each depth. Two jumps that
    cancel, up and soon down, may both remain undetected. Size and place are estimated between the
    neighboring jumps, because a search over all points includes these jumps.
    """
    jumps = sorted(_split(values, own, level, 0), key=lambda jump: jump.place)
    ends = [0, *(jump.place for jump in jumps), len(values)]
    return tuple(
        _within(values, own, jump, first, stop)
        for jump, first, stop in zip(jumps, ends, ends[2:], strict=False)
    )


def _within(values: Array, own: Array, jump: Jump, first: int, stop: int) -> Jump:
    """The jump, estimated again from its own segment if that is long enough."""
    if stop - first < LEAST_FOR_A_JUMP:
        return jump
    again = change(None, values[first:stop], own[first:stop, first:stop]).jump
    return jump if again is None else replace(_moved(again, first), p=jump.p, places=jump.places)


def _split(values: Array, own: Array, level: float, start: int) -> Iterator[Jump]:
    n = len(values)
    if n < LEAST_FOR_A_JUMP or not float(np.std(values)) > 1e-12 * float(np.max(np.abs(values))):
        return
    jump = change(None, values, own).jump
    if jump is None or jump.p > level:
        return
    k = jump.place
    yield _moved(jump, start)
    yield from _split(values[:k], own[:k, :k], 0.5 * level, start)
    yield from _split(values[k:], own[k:, k:], 0.5 * level, start + k)


def _moved(jump: Jump, by: int) -> Jump:
    low, high = jump.between
    return replace(jump, place=jump.place + by, between=(low + by, high + by))


def _trend(found: Fits) -> Trend:
    slope = found.mixture(0)
    return Trend(slope, slope.p, found.expected(found.tau), found.expected(found.rho), found)


def _jump(found: Fits, first: int) -> Jump:
    models = np.arange(first, found.value.shape[1])
    each = np.array([found.mixture(int(model)).p for model in models])
    evidence = found.evidence[models]
    weight = np.exp(evidence - np.max(evidence))
    weight /= weight.sum()
    best = int(np.argmax(weight))
    order = np.argsort(weight)[::-1]
    kept = order[: int(np.searchsorted(np.cumsum(weight[order]), HELD)) + 1]
    counted = models[weight >= PICKED]
    return Jump(
        best + ON_EACH_SIDE,
        (int(kept.min()) + ON_EACH_SIDE, int(kept.max()) + ON_EACH_SIDE),
        found.averaged(counted),
        float(min(1.0, len(models) * float(np.min(each)))),
        len(models),
        found.mixture(int(models[np.argmin(found.typical_deviation[models])])),
    )


def _shape(evidence: Array) -> str:
    """Shape that fits better: line, or jump at any of the equally likely places."""
    steps = evidence[1:]
    top = float(np.max(steps))
    anywhere = top + math.log(float(np.mean(np.exp(steps - top))))
    ahead = float(evidence[0]) - anywhere
    return "line" if ahead > CLEARLY else "jump" if ahead < -CLEARLY else ""


def detectable(known: Mixture, level: float) -> float:
    """Smallest size that is declared at `level` with a probability of `POWER`.

    known: estimate of the change; only its width matters. The scatter is assumed to be the same
        with such a change.
    """
    from scipy.special import ndtri

    needed = 0.5 * float(np.diff(known.interval(1.0 - level))[0])
    one_sigma = 0.5 * float(np.diff(known.interval(0.682689492137))[0])
    return needed + float(ndtri(POWER)) * one_sigma
