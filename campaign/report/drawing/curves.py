"""Curves of a panel: lines, dots, bands, bars, published values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from campaign.report.drawing.decimate import decimate
from campaign.report.drawing.published_marks import PublishedMarks
from campaign.report.palette import INK, Look
from campaign.result import Axis, Curve, Panel
from campaign.units import factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

DENSE = 2_000
"""Number of points above which a scatter is an image: thousands of signs make a large page."""
LONGEST_BAR = 1.0
"""Maximum extent of interval bars beyond the numbers of a panel, as a share of their span."""
OUT_OF_SIGHT = 1e-6
"""Lower end of a bar on a logarithmic axis, as a share of the number, if it is not positive."""
BARS = "bars"
"""Id of the paths of intervals."""
FLAT = 1e-4
"""Minimum variation of a curve, as a share of its level; with less it is drawn as constant."""

ARROW = 17.0
"""Length of the arrow of a bound (points) ..."""
HEADROOM = 0.14
"""... and the share of a panel's height for it."""
BAR = 0.5
"""Width of a bar, relative to the distance of named places."""
PALE = 0.55
"""Opacity of published values that are inconsistent or not reproducible."""
ARROWS = (0.15, 0.4, 0.65, 0.9)
"""Places of the arrows for the direction of a loop, as shares of its length."""

HOLLOW: dict[str, Any] = {
    "linestyle": "none",
    "marker": "o",
    "markerfacecolor": "none",
    "markersize": 7.0,
    "markeredgewidth": 1.2,
}
DOTTED: dict[str, Any] = {"linewidth": 2.0, "dashes": (0.8, 1.4)}


def draw_published(
    ax: Axes, marks: Sequence[PublishedMarks], look: Look, panel: Panel, aside: float = 0.0
) -> list[Array]:
    """Draw hollow marks in the colour of their series, or a dotted curve; return y as displayed.

    A dotted curve has the colour of ink, because it may coincide with the fit to compare. `aside`
    is `Curve.aside` of the curve that they belong to.
    """
    drawn = []
    for each in marks:
        x = _showable(each.x, panel.x) + aside * scale_of(panel.x)
        y = _showable(each.y, panel.y)
        how: dict[str, Any] = {"color": look.light, "zorder": 3}
        if each.joined:  # never pale, or it would be invisible on a fit that coincides with it
            ax.plot(x, y, **{**DOTTED, **how, "color": INK.light})
        else:
            how |= {"alpha": PALE} if each.doubtful else {}
            ax.plot(x, y, **{**HOLLOW, **how, "marker": hollow_marker(look)})
            up = {"at least": 1.0, "at most": -1.0}.get(each.bound, 0.0)
            _draw_bound(ax, x, y, np.full(len(y), up), how | {"arrowstyle": "<-"})
        drawn.append(y)
    return drawn


def series_name(curve: Curve) -> str:
    """Series of a curve, which has one look on a page."""
    return curve.series or curve.label


def hollow_marker(look: Look) -> str:
    """Marker of a series' published values: its own marker, or a circle if it cannot be hollow."""
    return "o" if look.marker in "x+" else look.marker


def draw_bounds(ax: Axes, curve: Curve, look: Look, x: Array, y: Array) -> Array:
    """Draw arrows from the points of a curve that are bounds, at display coordinates (n,).

    Returns: y of the points with an upward arrow.
    """
    up = np.zeros(len(y))
    for end, infinite, sign in ((curve.high, np.isposinf, 1.0), (curve.low, np.isneginf, -1.0)):
        if end is not None:
            up[infinite(np.asarray(end, dtype=float).ravel()[: len(y)])] = sign
    _draw_bound(ax, x, y, up, {"color": look.light, "zorder": 2.2, "arrowstyle": "<|-"})
    return y[up > 0.0]


def _draw_bound(ax: Axes, x: Array, y: Array, up: Array, how: Mapping[str, Any]) -> None:
    """Draw an arrow of `ARROW` points, up or down, from each place with `up` of 1 or -1."""
    arrow = {key: value for key, value in how.items() if key != "zorder"}
    arrow |= {"shrinkA": 0, "shrinkB": 0, "linewidth": 1.2, "mutation_scale": 9}
    for k in np.flatnonzero((up != 0.0) & np.isfinite(x) & np.isfinite(y)):
        end = (0.0, up[k] * ARROW)
        at = {"xytext": end, "textcoords": "offset points", "zorder": how["zorder"]}
        ax.annotate("", (x[k], y[k]), **at, arrowprops=arrow)


def leave_room(ax: Axes, bounds: Array) -> None:
    """Raise the upper limit for the arrow of the highest of `bounds` (display units, (n,))."""
    known = bounds[np.isfinite(bounds)]
    if not known.size:
        return
    low, high = ax.get_ylim()
    if ax.get_yscale() == "log":
        ax.set_ylim(top=max(high, float(known.max()) * (high / low) ** HEADROOM))
    else:
        ax.set_ylim(top=max(high, float(known.max()) + HEADROOM * (high - low)))


def prepared(curve: Curve, panel: Panel) -> tuple[Array, Array, Array | None]:
    """Coordinates in display units; values that a logarithmic axis cannot show become gaps."""
    x = _showable(curve.x, panel.x)
    y = _showable(curve.y, panel.y)
    low = None if curve.y_low is None else _showable(curve.y_low, panel.y)
    count = min(len(x), len(y)) if low is None else min(len(x), len(y), len(low))
    x, y = x[:count], np.where(np.isfinite(x[:count]), y[:count], np.nan)
    return x, y, None if low is None else low[:count]


def drawn_points(curve: Curve, panel: Panel, points: int) -> tuple[Array, Array, Array | None]:
    """Drawn x, y and lower edge of a curve: display units, shape (n,), lines decimated."""
    x, y, y_low = prepared(curve, panel)
    if curve.style in ("points", "band"):
        return x, y, y_low
    return *decimate(x, y, points), None


def drawn_interval(curve: Curve, panel: Panel) -> tuple[Array, Array, Array] | None:
    """Drawn x, low and high of a curve's 95 % interval: display units, (n,); None without one."""
    x, y, _ = prepared(curve, panel)
    ends = interval_of(curve, panel, y)
    return None if ends is None else (x, *ends)


def _showable(values: Array, axis: Axis) -> Array:
    shown = np.asarray(values, dtype=float).ravel() * scale_of(axis)
    shown = np.where(np.isfinite(shown), shown, np.nan)
    return np.where(shown > 0, shown, np.nan) if axis.scale == "log" else shown


def draw_interval(
    ax: Axes, curve: Curve, ends: tuple[Array, Array], look: Look, x: Array, y: Array, points: int
) -> None:
    """Draw the 95 % interval of a curve: bars on points, a band behind a line."""
    low, high = ends
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(low) & np.isfinite(high)
    if not known.any():
        return
    if curve.style not in ("points", "line+points"):
        some = np.unique(np.linspace(0, len(x) - 1, min(len(x), points)).astype(int))
        x, low, high = x[some], low[some], high[some]
        ax.fill_between(x, low, high, color=look.light, alpha=0.18, linewidth=0)
        return
    # One path with gaps has a tenth of the size of separate bars.
    rows = [np.repeat(x[known], 3), np.full(3 * int(known.sum()), np.nan)]
    rows[1][0::3], rows[1][1::3] = np.minimum(low, y)[known], np.maximum(high, y)[known]
    ax.plot(*rows, color=look.light, linewidth=1.0, zorder=1.9, gid=BARS)


def interval_of(curve: Curve, panel: Panel, y: Array) -> tuple[Array, Array] | None:
    """Low and high in display units, each shape (n,); None for a curve without interval.

    A logarithmic axis cannot show a lower end that is not positive: its bar ends out of view.
    """
    if curve.low is None or curve.high is None:
        return None
    low, high = (_showable(end, panel.y)[: len(y)] for end in (curve.low, curve.high))
    if panel.y.scale == "log":
        given = np.isfinite(np.asarray(curve.low, dtype=float).ravel()[: len(y)])
        low = np.where(np.isnan(low) & given, OUT_OF_SIGHT * y, low)
    return low, high


def limit_intervals(ax: Axes, values: Array, ends: Sequence[tuple[Array, Array]]) -> None:
    """Limit the y axis so that long interval bars do not hide the differences of points.

    `values`: all drawn values without the intervals `ends`.
    """
    finite = values[np.isfinite(values)]
    reach = np.concatenate([np.empty(0), *(np.concatenate(pair) for pair in ends)])
    reach = reach[np.isfinite(reach)]
    if not finite.size or not reach.size:
        return
    bottom, top = float(finite.min()), float(finite.max())
    if ax.get_yscale() == "log":
        seen = reach[reach > 10.0 * OUT_OF_SIGHT * bottom]
        if len(seen) < len(reach):
            ax.set_ylim(bottom=0.5 * min(bottom, float(seen.min(initial=bottom))))
        return
    spare = LONGEST_BAR * max(top - bottom, 0.5 * max(abs(top), abs(bottom)))
    if reach.min() < bottom - spare or reach.max() > top + spare:
        low, high = max(bottom - spare, reach.min()), min(top + spare, reach.max())
        margin = 0.05 * (high - low)
        ax.set_ylim(min(low, bottom) - margin, max(high, top) + margin)


def draw_curve(
    ax: Axes, curve: Curve, look: Look, x: Array, y: Array, y_low: Array | None, points: int
) -> None:
    """Draw a curve in its style, at display coordinates (n,); a long line is decimated."""
    label = curve.label or None
    if curve.style == "band":
        low = np.zeros_like(y) if y_low is None else y_low
        ax.fill_between(x, low, y, color=look.light, alpha=0.18, linewidth=0, label=label)
        return
    if curve.style == "points":
        size = 5.0 if len(x) <= 60 else 4.0 if len(x) <= 200 else 3.0 if len(x) <= 400 else 1.8
        ax.plot(
            x,
            y,
            linestyle="none",
            marker=look.marker,
            markersize=size,
            color=look.light,
            markeredgewidth=0.8 if look.marker in "x+" else 0,
            label=label,
            rasterized=len(x) > DENSE,
        )
        return
    x, y = decimate(x, y, points)
    if curve.style == "loop":
        _draw_arrows(ax, x, y, look.light)
    line: dict[str, Any] = {"color": look.light, "label": label, "linewidth": 1.4}
    if look.dash:  # above solid lines, which are then visible through the gaps
        line |= {"dashes": look.dash, "zorder": 2.1}
    if curve.style == "thin":
        line |= {"linewidth": 0.9, "alpha": 0.9}
    if curve.style == "line+points":
        line |= {"marker": look.marker, "markersize": 4, "markeredgewidth": 0}
    ax.plot(x, y, **line)


def draw_bar(ax: Axes, look: Look, x: Array, y: Array) -> None:
    """Draw a pale bar from zero to each number of a named place, behind its dot and interval."""
    ax.bar(x, y, BAR, color=look.light, alpha=0.25, zorder=1.2)


def _draw_arrows(ax: Axes, x: Array, y: Array, colour: str) -> None:
    """Draw arrow heads on a line, at the shares `ARROWS` of its length on the page."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) < 3 or not np.ptp(x) or not np.ptp(y):
        return
    length = np.concatenate(
        [[0.0], np.cumsum(np.hypot(np.diff(x / np.ptp(x)), np.diff(y / np.ptp(y))))]
    )
    for share in ARROWS:
        at = np.array([share, share + 0.01]) * length[-1]
        (x0, x1), (y0, y1) = np.interp(at, length, x), np.interp(at, length, y)
        how = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0, "linewidth": 0}
        ax.annotate("", (x1, y1), xytext=(x0, y0), arrowprops={**how, "mutation_scale": 12})


def spare_rounding_errors(ax: Axes, values: Sequence[Array]) -> None:
    """Draw a constant as one: the axis does not zoom in on its rounding errors."""
    finite = np.concatenate([np.empty(0), *(y[np.isfinite(y)] for y in values)])
    if not finite.size:
        return
    middle, span = float(np.median(finite)), float(np.ptp(finite))
    if span < FLAT * abs(middle):
        ax.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))


def scale_of(axis: Axis) -> float:
    """Factor from the axis' unit to its display unit."""
    return 1.0 if axis.shown_unit == axis.unit else factor(axis.unit, axis.shown_unit)
