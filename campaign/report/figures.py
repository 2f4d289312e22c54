"""Drawing `result.Figure` as SVG: the same input gives the same bytes, on any machine.

Text stays text and takes the page's font. Colours are written so that the page can exchange them
for its dark ones; a file on its own is for white paper.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from campaign.report.decimate import POINTS, decimate
from campaign.report.palette import HAIRLINE, INK, MUTED, PAPER, Look, looks, variables
from campaign.report.text import number, pretty_unit
from campaign.result import Axis, Curve, Figure, Mark, Panel
from campaign.units import factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

Array = NDArray[np.float64]

WIDTH = 6.9
"""Inches: the text width of a page in two columns of a journal, or of the report."""
FIGURE_POINTS = 40_000
"""Most points of a figure's lines together; many curves share them."""
DENSE = 2_000
"""From here on a scatter is drawn as an image: thousands of signs would outweigh the page."""
LONGEST_BAR = 1.0
"""Span of a panel's numbers beyond which the bars of their intervals are cut."""
OUT_OF_SIGHT = 1e-6
"""of a number: where a bar ends that a logarithmic axis has no end for."""
FLAT = 1e-4
"""Share of its level that a curve must vary by to be drawn as varying."""

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "campaign",
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.parse_math": False,  # a label is a name, whatever signs are in it
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 7,
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK.light,
    "axes.edgecolor": MUTED.light,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-5, 6),
    "axes.xmargin": 0.02,
    "grid.color": HAIRLINE.light,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED.light,
    "ytick.color": MUTED.light,
    "xtick.labelcolor": INK.light,
    "ytick.labelcolor": INK.light,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "text.color": INK.light,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "lines.linewidth": 1.4,
    "lines.scale_dashes": True,
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.h_pad": 0.06,
    "savefig.transparent": True,
    "savefig.dpi": 200,
}
METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


def draw(figure: Figure) -> str:
    """A figure as a complete SVG document for white paper."""
    with canvas(*_size(figure)) as sheet:
        across = _across(figure)
        down = -(-len(figure.panels) // across)
        axes = sheet.subplots(down, across, squeeze=False).ravel()
        chosen = looks(_series(curve) for panel in figure.panels for curve in panel.curves)
        total = sum(len(panel.curves) for panel in figure.panels)
        points = max(64, min(POINTS, FIGURE_POINTS // max(total, 1)))
        for panel, ax in zip(figure.panels, axes, strict=False):
            _draw_panel(ax, panel, chosen, points)
        for ax in axes[len(figure.panels) :]:
            ax.set_axis_off()
        if not _titles_say_it(figure):
            add_legend(sheet, list(axes))
        return to_svg(sheet)


@contextmanager
def canvas(width: float, height: float) -> Iterator[Canvas]:
    """An empty matplotlib figure (inches) under the report's own style, whatever the user's is."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        sheet = Canvas(figsize=(width, height))
        FigureCanvasSVG(sheet)
        yield sheet


def to_svg(sheet: Canvas) -> str:
    """The SVG document of a canvas, with nothing in it that changes from run to run."""
    out = io.StringIO()
    sheet.savefig(out, format="svg", metadata=METADATA)
    return re.sub(r"[ \t]+$", "", out.getvalue(), flags=re.MULTILINE)


def inline(svg: str, prefix: str, title: str, alt: str) -> str:
    """The SVG for the middle of a page: own ids, the page's colours, and words for who cannot see.

    `prefix` must be unique on the page and safe in an id.
    """
    from markupsafe import escape

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>\s*", "", body, flags=re.DOTALL)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = body.replace('href="#', f'href="#{prefix}-').replace("url(#", f"url(#{prefix}-")
    body = _with_variables(body)
    head = (
        f'<svg role="img" aria-labelledby="{prefix}-title {prefix}-alt" class="plot"'
        f" {_view_box(body)} >"
        f'<title id="{prefix}-title">{escape(title)}</title>'
        f'<desc id="{prefix}-alt">{escape(alt)}</desc>'
    )
    return head + body[body.index(">") + 1 :]


def add_legend(sheet: Canvas, axes: Sequence[Axes]) -> None:
    """One legend for all panels, above them, where it covers no data."""
    entries: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return
    longest = max(len(label) for label in entries)
    columns = max(1, min(len(entries), int(WIDTH * 13 / (longest + 7))))
    sheet.legend(
        list(entries.values()), list(entries), loc="outside upper left", ncols=columns, borderpad=0
    )


def _titles_say_it(figure: Figure) -> bool:
    """Whether every panel's title already names all its curves."""
    return all(
        {curve.label for curve in panel.curves} <= {"", panel.title} for panel in figure.panels
    )


def _across(figure: Figure) -> int:
    return max(1, min(figure.across, len(figure.panels), 3))


def _size(figure: Figure) -> tuple[float, float]:
    across = _across(figure)
    down = -(-len(figure.panels) // across) if figure.panels else 1
    each = {1: 3.3 if down == 1 else 2.4, 2: 2.7, 3: 2.2}[across]
    return WIDTH, 0.35 + each * max(down, 1)


def _series(curve: Curve) -> str:
    return curve.series or curve.label


def _draw_panel(ax: Axes, panel: Panel, chosen: dict[str, Look], points: int) -> None:
    scale_x, scale_y = _scale(panel.x), _scale(panel.y)
    shown = [_prepare(curve, panel, scale_x, scale_y) for curve in panel.curves]
    empty = not any(np.isfinite(y).any() for _, y, _ in shown)
    intervals = [
        _interval(curve, panel, y) for curve, (_, y, _) in zip(panel.curves, shown, strict=True)
    ]
    for curve, (x, y, y_low), ends in zip(panel.curves, shown, intervals, strict=True):
        look = chosen[_series(curve)]
        if ends is not None:
            _draw_interval(ax, curve, ends, look, x, y, points)
        _draw_curve(ax, curve, look, x, y, y_low, points)
    for set_scale, axis in ((ax.set_xscale, panel.x), (ax.set_yscale, panel.y)):
        if axis.scale == "log" and not empty:
            set_scale("log")
    ends_shown = [ends for ends in intervals if ends is not None]
    drawn = [y for _, y, _ in shown]
    _limit_intervals(ax, np.concatenate([np.empty(0), *drawn]), ends_shown)
    if panel.y.scale == "linear":
        _spare_rounding_errors(ax, [*drawn, *(end for ends in ends_shown for end in ends)])
    _label_axes(ax, panel, scale_x, scale_y)
    for mark in panel.marks:
        _draw_mark(ax, mark, scale_x, scale_y)
    if empty:
        ax.text(0.5, 0.5, "no data", transform=ax.transAxes, ha="center", color=MUTED.light)


def _prepare(
    curve: Curve, panel: Panel, scale_x: float, scale_y: float
) -> tuple[Array, Array, Array | None]:
    """Coordinates in display units; what a logarithmic axis cannot show becomes a gap."""
    x = _showable(curve.x, panel.x, scale_x)
    y = _showable(curve.y, panel.y, scale_y)
    low = None if curve.y_low is None else _showable(curve.y_low, panel.y, scale_y)
    count = min(len(x), len(y)) if low is None else min(len(x), len(y), len(low))
    x, y = x[:count], np.where(np.isfinite(x[:count]), y[:count], np.nan)
    return x, y, None if low is None else low[:count]


def _showable(values: Array, axis: Axis, scale: float) -> Array:
    shown = np.asarray(values, dtype=float).ravel() * scale
    shown = np.where(np.isfinite(shown), shown, np.nan)
    return np.where(shown > 0, shown, np.nan) if axis.scale == "log" else shown


def _draw_interval(
    ax: Axes, curve: Curve, ends: tuple[Array, Array], look: Look, x: Array, y: Array, points: int
) -> None:
    """The 95 % interval of a curve: bars on points, a band behind a line."""
    low, high = ends
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(low) & np.isfinite(high)
    if not known.any():
        return
    if curve.style not in ("points", "line+points"):
        some = np.unique(np.linspace(0, len(x) - 1, min(len(x), points)).astype(int))
        x, low, high = x[some], low[some], high[some]
        ax.fill_between(x, low, high, color=look.light, alpha=0.18, linewidth=0)
        return
    below, above = np.maximum(y - low, 0.0)[known], np.maximum(high - y, 0.0)[known]
    ax.errorbar(
        x[known],
        y[known],
        yerr=np.vstack([below, above]),
        fmt="none",
        ecolor=look.light,
        elinewidth=0.9,
        capsize=2.0,
        capthick=0.9,
    )


def _interval(curve: Curve, panel: Panel, y: Array) -> tuple[Array, Array] | None:
    """Low and high in display units, each shape (n,); None for a curve that has none.

    A logarithmic axis has no place for a lower end that is not positive: its bar goes out of sight.
    """
    if curve.low is None or curve.high is None:
        return None
    scale = _scale(panel.y)
    low, high = (_showable(end, panel.y, scale)[: len(y)] for end in (curve.low, curve.high))
    if panel.y.scale == "log":
        given = np.isfinite(np.asarray(curve.low, dtype=float).ravel()[: len(y)])
        low = np.where(np.isnan(low) & given, OUT_OF_SIGHT * y, low)
    return low, high


def _limit_intervals(ax: Axes, values: Array, ends: Sequence[tuple[Array, Array]]) -> None:
    """Bars that are far longer than what the points tell are cut, so that those can be told apart.

    `values` are all that is drawn besides the intervals `ends`.
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


def _draw_curve(
    ax: Axes, curve: Curve, look: Look, x: Array, y: Array, y_low: Array | None, points: int
) -> None:
    label = curve.label or None
    if curve.style == "band":
        low = np.zeros_like(y) if y_low is None else y_low
        ax.fill_between(x, low, y, color=look.light, alpha=0.18, linewidth=0, label=label)
        return
    if curve.style == "points":
        size = 4.0 if len(x) <= 60 else 3.0 if len(x) <= 400 else 1.8
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
    line: dict[str, Any] = {"color": look.light, "label": label, "linewidth": 1.4}
    if look.dash:  # above the solid lines, which then show through the gaps
        line |= {"dashes": look.dash, "zorder": 2.1}
    if curve.style == "thin":
        line |= {"linewidth": 0.9, "alpha": 0.9}
    if curve.style == "line+points":
        line |= {"marker": look.marker, "markersize": 4, "markeredgewidth": 0}
    ax.plot(x, y, **line)


def _spare_rounding_errors(ax: Axes, values: Sequence[Array]) -> None:
    """A constant is drawn as one: an axis does not zoom in on its last digits."""
    finite = np.concatenate([np.empty(0), *(y[np.isfinite(y)] for y in values)])
    if not finite.size:
        return
    middle, span = float(np.median(finite)), float(np.ptp(finite))
    if span < FLAT * abs(middle):
        ax.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))


def _draw_mark(ax: Axes, mark: Mark, scale_x: float, scale_y: float) -> None:
    line: dict[str, Any] = {"color": MUTED.light, "linewidth": 0.8, "dashes": (3, 2), "zorder": 1.5}
    text: dict[str, Any] = {"fontsize": 7.5, "color": MUTED.light, "zorder": 4}
    background = {"facecolor": PAPER.light, "edgecolor": "none", "pad": 1.0, "alpha": 0.85}
    if mark.x is not None and np.isfinite(mark.x):
        ax.axvline(mark.x * scale_x, **line)
        along = ax.get_xaxis_transform()
        ax.annotate(
            mark.label,
            (mark.x * scale_x, 0.98),
            xycoords=along,
            xytext=(-3, 0),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            bbox=background,
            **text,
        )
    if mark.y is not None and np.isfinite(mark.y):
        ax.axhline(mark.y * scale_y, **line)
        if mark.x is None:
            ax.annotate(
                mark.label,
                (0.995, mark.y * scale_y),
                xycoords=ax.get_yaxis_transform(),
                xytext=(0, 2),
                textcoords="offset points",
                ha="right",
                va="bottom",
                bbox=background,
                **text,
            )


def _label_axes(ax: Axes, panel: Panel, scale_x: float, scale_y: float) -> None:
    from matplotlib.ticker import FuncFormatter

    ax.set_xlabel(axis_label(panel.x))
    ax.set_ylabel(axis_label(panel.y))
    if panel.title:
        ax.set_title(panel.title)
    limits = ((ax.set_xlim, panel.x, scale_x), (ax.set_ylim, panel.y, scale_y))
    for set_limits, axis, scale in limits:
        if axis.limits is not None and np.all(np.isfinite(axis.limits)):
            set_limits(axis.limits[0] * scale, axis.limits[1] * scale)
    for drawn in (ax.xaxis, ax.yaxis):
        if drawn.get_scale() == "log":
            low, high = drawn.get_view_interval()
            short = 0 < low < high < 20 * low
            drawn.set_major_formatter(FuncFormatter(_plain_tick))
            drawn.set_minor_formatter(FuncFormatter(_twos_and_fives if short else _no_tick))


def _plain_tick(value: float, position: int | None) -> str:
    return number(value)


def _twos_and_fives(value: float, position: int | None) -> str:
    return number(value) if f"{value:e}"[0] in "25" else ""


def _no_tick(value: float, position: int | None) -> str:
    return ""


def axis_label(axis: Axis) -> str:
    """`label (unit)` in the unit of the page."""
    unit = axis.display or axis.unit
    return f"{axis.label} ({pretty_unit(unit)})" if unit else axis.label


def _scale(axis: Axis) -> float:
    return factor(axis.unit, axis.display) if axis.display and axis.display != axis.unit else 1.0


def _with_variables(svg: str) -> str:
    """Every palette colour as a CSS variable with itself as the fallback."""
    by_colour: dict[str, str] = {}
    for name, (light, _) in variables().items():
        by_colour.setdefault(light, name)
    pattern = "|".join(re.escape(colour) for colour in sorted(by_colour))
    return re.sub(
        rf"(?<=[ :])({pattern})(?=[;\"])", lambda m: f"var(--{by_colour[m[1]]}, {m[1]})", svg
    )


def _view_box(svg: str) -> str:
    found = re.search(r'viewBox="[-0-9. ]+"', svg[: svg.index(">")])
    return found[0] if found else ""
