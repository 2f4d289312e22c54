"""Recorded channels over time as small plain SVG.

This module needs milliseconds where matplotlib needs a second. It draws only a frame, ticks, lines
and shaded windows. Colours are CSS variables of the page.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from campaign.estimate import Window
from campaign.report.drawing.decimate import decimate
from campaign.report.palette import Look
from campaign.text import number

Array = NDArray[np.float64]

WIDTH, HEIGHT = 720.0, 170.0
"""Size of one chart (pixels) ..."""
FONT = 11.0
"""... of its labels, as in the page's style ..."""
LEFT, RIGHT, TOP, BOTTOM = 62.0, 8.0, 8.0, 34.0
"""... and of the margins of its frame."""
POINTS = 800
"""Maximum number of points of a line: about one per pixel."""
TICKS = 6
"""Approximate maximum number of ticks of an axis."""
FLAT = 1e-4
"""Minimum variation of a channel, as a share of its level; with less it is drawn as constant."""
MARGIN = 0.05
"""Free margin above and below the values, as a share of their span."""


@dataclass(frozen=True)
class Trace:
    """One line: `values` over the chart's time, in display units, with its look."""

    label: str
    values: Array
    look: Look


def draw_traces(
    time: Array,
    traces: Sequence[Trace],
    axis: str,
    windows: Sequence[Window] = (),
    moments: Sequence[tuple[float, str]] = (),
) -> Markup:
    """Draw one chart as an SVG element within a page.

    Args:
        time: s, shape (n,).
        traces: each of shape (n,); values that are not finite are gaps.
        axis: label and unit of the values.
        windows: shaded parts, each with a tooltip.
        moments: times (s) of events, each with a tooltip.
    """
    x, y = _Scale.of(time, LEFT, WIDTH - RIGHT, 0.0), _scale_of_values(traces)
    names = ", ".join(trace.label for trace in traces)
    parts = [
        (
            f'<svg class="plot" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img"'
            f' aria-label="{escape(f"{axis} over time: {names}")}">'
        ),
        *(_shade(window, x) for window in windows),
        *_ticks(x, y),
        *(_line(time, trace, x, y) for trace in traces),
        *(_moment(at, text, x) for at, text in moments if x.low <= at <= x.high),
        *_labels(axis),
        "</svg>",
    ]
    return Markup("".join(parts))  # noqa: S704 (numbers are generated here, texts are escaped)


def key(look: Look) -> Markup:
    """Short piece of a trace, for a legend in the page's text."""
    return Markup(  # noqa: S704 (all of it is generated here)
        '<svg class="key" width="26" height="8" aria-hidden="true">'
        f'<line x1="0" x2="26" y1="4" y2="4" {_stroke(look)}/></svg>'
    )


@dataclass(frozen=True)
class _Scale:
    """Scale from values to pixels; `low` and `high` are at `start` and `stop`."""

    low: float
    high: float
    start: float
    stop: float

    @classmethod
    def of(cls, values: Array, start: float, stop: float, margin: float) -> _Scale:
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        span, middle, largest = high - low, 0.5 * (low + high), max(abs(low), abs(high))
        if not span > FLAT * largest:  # a constant is drawn as one
            span = 0.2 * largest or 1.0
            low, high = middle - 0.5 * span, middle + 0.5 * span
        return cls(low - margin * span, high + margin * span, start, stop)

    def pixels(self, values: Array) -> Array:
        share = (values - self.low) / (self.high - self.low)
        return self.start + share * (self.stop - self.start)

    def pixel(self, value: float) -> float:
        return float(self.pixels(np.array(value)))

    def ticks(self) -> list[float]:
        """Multiples of 1, 2 or 5 times a power of ten."""
        rough = (self.high - self.low) / TICKS
        power = 10.0 ** math.floor(math.log10(rough))
        step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough)
        first, last = math.ceil(self.low / step), math.floor(self.high / step)
        return [multiple * step for multiple in range(first, last + 1)]


def _scale_of_values(traces: Sequence[Trace]) -> _Scale:
    every = np.concatenate([np.empty(0), *(trace.values for trace in traces)])
    return _Scale.of(every, HEIGHT - BOTTOM, TOP, MARGIN)


def _ticks(x: _Scale, y: _Scale) -> Iterator[str]:
    bottom = HEIGHT - BOTTOM
    for value in x.ticks():
        at = x.pixel(value)
        yield f'<path class="grid" d="M{at:.1f} {TOP:g}V{bottom:g}"/>'
        yield _text(at, bottom + 14, "middle", number(value))
    for value in y.ticks():
        at = y.pixel(value)
        yield f'<path class="grid" d="M{LEFT:g} {at:.1f}H{WIDTH - RIGHT:g}"/>'
        yield _text(LEFT - 6, at + 4, "end", number(value))


def _labels(axis: str) -> Iterator[str]:
    yield _text(0.5 * (LEFT + WIDTH - RIGHT), HEIGHT - 4, "middle", "Time (s)")
    middle = 0.5 * (TOP + HEIGHT - BOTTOM)
    yield _text(12, middle, "middle", axis, f' transform="rotate(-90 12 {middle:g})"')


def _text(x: float, y: float, anchor: str, words: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(words)}</text>'


def _line(time: Array, trace: Trace, x: _Scale, y: _Scale) -> str:
    if not np.isfinite(trace.values).any():
        return ""
    at, values = decimate(time, trace.values, POINTS)
    known = np.isfinite(at) & np.isfinite(values)
    pieces, drawn = [], False
    for ok, a, b in zip(known, x.pixels(at), y.pixels(values), strict=True):
        if ok:
            pieces.append(f"{'L' if drawn else 'M'}{a:.1f} {b:.1f}")
        drawn = bool(ok)
    return f'<path d="{"".join(pieces)}" {_stroke(trace.look)}/>'


def _stroke(look: Look) -> str:
    dash = f' stroke-dasharray="{" ".join(f"{1.3 * d:g}" for d in look.dash)}"' if look.dash else ""
    return f'fill="none" stroke="var(--{look.name})" stroke-width="1.3"{dash}'


def _shade(window: Window, x: _Scale) -> str:
    start, stop = (x.pixel(min(max(at, x.low), x.high)) for at in (window.start, window.stop))
    span = f"{number(window.start)} to {number(window.stop)} s"
    return (
        f'<rect class="window" x="{start:.1f}" y="{TOP:g}" width="{max(stop - start, 0):.1f}"'
        f' height="{HEIGHT - BOTTOM - TOP:g}"><title>{escape(window.name)}: {span}</title></rect>'
    )


def _moment(at: float, text: str, x: _Scale) -> str:
    return (
        f'<path class="moment" d="M{x.pixel(at):.1f} {TOP:g}V{HEIGHT - BOTTOM:g}">'
        f"<title>{number(at)} s: {escape(text)}</title></path>"
    )
