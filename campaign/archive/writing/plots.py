"""A figure panel as NeXus data: curves over one x in one group.

An NXdata group has one x for all of its curves. Curves of a panel with the same x share a group.
So do curves on separate ranges of x, such as the two directions of a friction map; a curve is NaN
outside its range. All others get their own group.

Curves that are drawn with an offset beside one place do not share an x.

Several viewers show only the first curve of a group, or only its intervals. If all curves are
single points, such as one per method, the first series contains all of them.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, count

import numpy as np

from campaign.result import Array, Axis, Column, Curve, Panel

SYMMETRIC = 0.1
"""Largest offset of an interval's center, relative to its half-width, for the form `value ± half`;
as in printed numbers (`campaign.text.interval`)."""


INTERVAL = {
    "errors": "half-width of the 95 % interval",
    "low": "lower end of the 95 % interval",
    "high": "upper end of the 95 % interval",
    "lower_edge": "lower edge of the band",
}
"""Meaning of a series' companions, by the ending of their names."""


@dataclass(frozen=True)
class Plot:
    """Curves over one x.

    Attributes:
        x: shape (n,).
        curves: each with its name and the index in `x` where it begins.
    """

    x: Array
    curves: tuple[tuple[str, Curve, int], ...]

    def spread(self, values: Array, start: int) -> Array:
        """Extend the values of a curve to all of `x`, with NaN elsewhere; shape (n,)."""
        if len(values) == len(self.x):
            return values
        whole = np.full(len(self.x), np.nan)
        whole[start : start + len(values)] = values
        return whole


def plots_of(panel: Panel) -> list[Plot]:
    """The plots of a panel, the most important first: viewers open it."""
    alike: dict[tuple[bytes, float], list[Curve]] = {}
    for curve in panel.curves:
        alike.setdefault((floats(curve.x).tobytes(), curve.aside), []).append(curve)
    bundles: list[list[list[Curve]]] = []  # per plot: groups of curves with one x, side by side
    for curves in alike.values():
        beside = next((b for b in bundles if all(_apart(curves[0], c[0]) for c in b)), None)
        if beside is None:
            bundles.append([curves])
        else:
            beside.append(curves)
    return sorted(map(_plot, bundles), key=_background)


def joined(plot: Plot) -> Curve | None:
    """All points of a plot as one curve; None unless it has several curves of one point each."""
    curves = [curve for _, curve, _ in sorted(plot.curves, key=lambda each: each[2])]
    if len(curves) < 2 or not len(curves) == len(plot.x) == sum(len(c.x) for c in curves):
        return None

    def ends(which: str) -> Array | None:
        given = [getattr(curve, which) for curve in curves]
        if all(each is None for each in given):
            return None
        return np.concatenate([[np.nan] if each is None else floats(each) for each in given])

    y = np.concatenate([floats(curve.y) for curve in curves])
    return Curve(plot.x, y, label="all", style="points", low=ends("low"), high=ends("high"))


def half_widths(values: Array, low: Array, high: Array) -> Array | None:
    """Half-widths of the intervals, shape (n,), NaN without one; None if any is asymmetric."""
    half = 0.5 * (high - low)
    off = np.abs(high + low - 2 * values)
    given = np.isfinite(half)
    return half if given.any() and not np.any(off[given] > SYMMETRIC * half[given]) else None


def names_of(wanted: Sequence[str]) -> list[str]:
    """Valid and unique NeXus names, in the order of `wanted`."""
    taken: dict[str, None] = {}
    for text in wanted:
        name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_")[:50] or "unnamed"
        taken[unused(f"n_{name}" if name[0].isdigit() else name, taken)] = None
    return list(taken)


def unused(name: str, taken: Container[str]) -> str:
    """`name`, or with a number appended if it is taken."""
    numbered = (f"{name}_{number}" for number in count(2))
    return next(each for each in chain([name], numbered) if each not in taken)


def _plot(bundle: list[list[Curve]]) -> Plot:
    """The plot of groups of curves side by side, in the order of x."""
    ordered = sorted(bundle, key=lambda curves: _ends(curves[0])[0])
    starts = np.cumsum([0, *(len(curves[0].x) for curves in ordered)])
    placed = [
        (curve, int(start))
        for curves, start in zip(ordered, starts[:-1], strict=True)
        for curve in curves
    ]
    placed.sort(key=lambda each: _rank(each[0]))  # stable
    names = names_of([curve.series or curve.label or "curve" for curve, _ in placed])
    x = np.concatenate([floats(curves[0].x) for curves in ordered])
    return Plot(
        x, tuple((name, curve, start) for name, (curve, start) in zip(names, placed, strict=True))
    )


def _background(plot: Plot) -> int:
    return min(_rank(curve) for _, curve, _ in plot.curves)


def _has_ends(curve: Curve) -> bool:
    """Whether any of its points has an interval, at least on one side."""
    return any(
        end is not None and np.isfinite(floats(end)).any() for end in (curve.low, curve.high)
    )


def _rank(curve: Curve) -> int:
    """Order of a curve: 0 with intervals, 1 measured, 2 reference, thin or band."""
    if _has_ends(curve) and curve.style not in ("thin", "band"):
        return 0
    if curve.series in ("reference", "alternative") or curve.style in ("thin", "band"):
        return 2
    return 1


def _apart(one: Curve, other: Curve) -> bool:
    """Whether both have increasing x, and their ranges of x do not overlap."""
    if not (_runs_along(one) and _runs_along(other)):
        return False
    (low, high), (lowest, highest) = _ends(one), _ends(other)
    return high < lowest or highest < low


def _runs_along(curve: Curve) -> bool:
    x = floats(curve.x)
    return len(x) > 0 and bool(np.all(np.diff(x) > 0))


def _ends(curve: Curve) -> tuple[float, float]:
    x = floats(curve.x)
    return (float(x[0]), float(x[-1])) if len(x) else (0.0, 0.0)


def floats(values: Array) -> Array:
    """Values as float64: a plug-in may use another type or a list."""
    return np.asarray(values, dtype=np.float64)


def labels(shown: Axis | Column, more: str = "") -> dict[str, str]:
    """Attributes of a series along an axis or of a column: name, SI unit, unit for display."""
    unit = f" ({shown.unit})" if shown.unit else ""
    units = {"units": shown.unit, "display_units": shown.display or shown.unit} if unit else {}
    return {"long_name": f"{shown.label}{more}{unit}", **units}


def parts_of(curve: Curve) -> Iterator[tuple[str, Array, Array | None]]:
    """Companions of a curve: ending of the name in the file, values, and the array of the curve;
    None for a computed array.
    """
    if curve.low is not None and curve.high is not None and _has_ends(curve):
        low, high = floats(curve.low), floats(curve.high)
        half = half_widths(floats(curve.y), low, high)
        if half is not None:
            yield "errors", half, None
        yield "low", low, curve.low
        yield "high", high, curve.high
    if curve.y_low is not None:
        yield "lower_edge", floats(curve.y_low), curve.y_low
