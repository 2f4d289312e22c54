"""Drift and jumps of a number from the same points.

A trend is a line over time, over temperature, or over whatever runs differ in. A jump is one level
before, another behind. Each is judged with what runs scatter besides and with what neighbouring
runs know of each other (`scatter`). A jump's place is looked for: its p value is the smallest of
all places times how many there are (Bonferroni), which holds whatever the places have to do with
each other. Source of the splitting: Vostrikova, Soviet Mathematics Doklady 24 (1981).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.trends.scatter import Fits, Mixture, fits

LEAST_FOR_A_JUMP = 5
"""With fewer, no place has a second point on both sides that shows how runs scatter."""
ON_EACH_SIDE = 2
"""Fewest points on a side of a jump: one alone is an outlier as well."""
CLEARLY = math.log(3.0)
"""Ratio of integrated likelihoods from which on one of two shapes is said to fit better."""
HELD = 0.95
"""Probability of the models that are kept."""
POWER = 0.8
"""How often a change of the detectable size would be declared."""
PICKED = 1e-3
"""Least share of the weight with which a place counts in the size of a jump."""


@dataclass(frozen=True)
class Trend:
    """A line y = a + b x through points.

    Attributes:
        slope: b.
        p: two-sided, of b = 0.
        scatter: typical standard deviation of runs besides their own errors.
        correlation: of neighbouring runs, as far as the points say.
    """

    slope: Mixture
    p: float
    scatter: float
    correlation: float
    fits: Fits

    def at(self, x: float) -> Mixture:
        """The line's value."""
        return self.fits.line(x)


@dataclass(frozen=True)
class Jump:
    """One level before a place, another from there on.

    Attributes:
        place: index of the first point behind the jump, the likeliest.
        between: first and last place that 95 % of the weight leave.
        size: after less before, averaged over the places that may be meant; the jump was looked
            for, so that one that is only just declared tends to look larger than it is.
        p: of no jump anywhere.
        places: how many were tried.
        before, after: the two levels at `place`.
        clearest: of the place where a jump would be best known, for what would have been seen.
    """

    place: int
    between: tuple[int, int]
    size: Mixture
    p: float
    places: int
    before: Mixture
    after: Mixture
    clearest: Mixture


@dataclass(frozen=True)
class Change:
    """Both shapes of one series.

    Attributes:
        trend: None where there is nothing to follow along.
        jump: None of fewer than five points.
        shape: `line` or `jump`, which of the two the points clearly prefer; "" for neither.
    """

    trend: Trend | None
    jump: Jump | None
    shape: str


def change(x: Array | None, values: Array, own: Array, *, jumps: bool = True) -> Change:
    """Trend and jump of a series.

    Args:
        x: what is followed, shape (n,), in any unit; None where only jumps are asked for.
        values: shape (n,), in the order in which they were measured.
        own: covariance of the values' own errors, shape (n, n); zeros where nobody knows them, and
            the scatter between runs is all that there is. What shifts all alike is no part of it.
        jumps: whether the order is one in which something can jump.

    Raises ValueError for fewer than three points, for values that do not differ, and where x does
    not vary.
    """
    n = len(values)
    steps = steps_of(n) if jumps and n >= LEAST_FOR_A_JUMP else np.empty((n, 0))
    lines = np.empty((n, 0)) if x is None else np.asarray(x, dtype=float)[:, None]
    if lines.shape[1] + steps.shape[1] == 0:
        raise ValueError(f"{n} points are too few for a jump; {LEAST_FOR_A_JUMP} are the least")
    found = fits(values, np.hstack([lines, steps]), own)
    first = lines.shape[1]
    trend = _trend(found) if first else None
    jump = _jump(found, first) if steps.shape[1] else None
    shape = _shape(found.evidence) if trend is not None and jump is not None else ""
    return Change(trend, jump, shape)


def steps_of(n: int) -> Array:
    """Every place of a jump as a column, shape (n, n - 3): 0 before it, 1 from there on."""
    places = np.arange(ON_EACH_SIDE, n - ON_EACH_SIDE + 1)
    return (np.arange(n)[:, None] >= places).astype(float)


def jumps_of(values: Array, own: Array, level: float) -> tuple[Jump, ...]:
    """All jumps, in order: each half is searched again until nothing more is found.

    Args: as for `change`; `level` is the p value at which a jump is declared. Halves share it, so
    that one false jump more has that probability at most at each depth. Two jumps that cancel, up
    and soon down again, may both be overlooked. Size and place are those between the neighbouring
    jumps: a search in the whole of them saw these as well.
    """
    found = sorted(_split(values, own, level, 0), key=lambda jump: jump.place)
    ends = [0, *(jump.place for jump in found), len(values)]
    return tuple(
        _within(values, own, jump, first, stop)
        for jump, first, stop in zip(found, ends, ends[2:], strict=False)
    )


def _within(values: Array, own: Array, jump: Jump, first: int, stop: int) -> Jump:
    """The same jump seen from its own stretch, where that is long enough."""
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
        found.line(0.0, int(models[best])),
        found.line(1.0, int(models[best])),
        found.mixture(int(models[np.argmin(found.typical_deviation[models])])),
    )


def _shape(evidence: Array) -> str:
    """Line against a jump at any place, each place as likely as the next."""
    steps = evidence[1:]
    top = float(np.max(steps))
    anywhere = top + math.log(float(np.mean(np.exp(steps - top))))
    ahead = float(evidence[0]) - anywhere
    return "line" if ahead > CLEARLY else "jump" if ahead < -CLEARLY else ""


def detectable(known: Mixture, level: float) -> float:
    """Smallest size that would be declared at `level` with a probability of `POWER`.

    known: what the points leave open of the number; its centre does not matter. The scatter that
        was found is taken as what it would have been with such a change, too.
    """
    from scipy.special import ndtri

    needed = 0.5 * float(np.diff(known.interval(1.0 - level))[0])
    one_sigma = 0.5 * float(np.diff(known.interval(0.682689492137))[0])
    return needed + float(ndtri(POWER)) * one_sigma
