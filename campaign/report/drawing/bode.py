"""Bode plot of a bench's rate loop for every compensation, with margins."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from campaign.physics.complete import CompleteBench
from campaign.physics.linear_friction import REGIMES, NoLoopError, Regime
from campaign.physics.loop_margins import LoopMargins, Response, frequency_grid, margins_of
from campaign.physics.open_loop import open_loop
from campaign.report.drawing.figures import WIDTH, canvas, to_svg
from campaign.report.palette import INK, MUTED, PAPER, Look, looks
from campaign.signals import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

HEIGHT = 5.0
"""Inches."""
TWO_PI = 2.0 * np.pi
POINTS = 1500
DEEPEST = -70.0
"""dB; below, nothing of a loop matters."""
HIGHEST = 60.0
"""dB; above, it is only an integrator."""


SHORT_PHASE, SHORT_GAIN = 40.0, 12.0
"""deg and dB; a shorter arrow has its label below, where a falling curve leaves room."""


@dataclass(frozen=True)
class Trace:
    """One open loop over frequency.

    Attributes:
        frequency: Hz, (n,).
        level: dB, (n,).
        phase: deg, continuous, (n,).
    """

    compensation: str
    frequency: Array
    level: Array
    phase: Array
    margins: LoopMargins


def traces_of(bench: CompleteBench, names: Sequence[str]) -> dict[Regime, list[Trace]]:
    """The rate loop with each compensation, by regime; those without a linear loop are missing."""
    loops: list[tuple[Regime, str, Response, LoopMargins]] = []
    for regime in REGIMES:
        for name in names:
            try:
                loop = open_loop(bench, name, "rate", regime)
            except NoLoopError:
                continue
            loops.append((regime, name, Response(loop), margins_of(loop)))
    low, high = _range([margins for _, _, _, margins in loops])
    found: dict[Regime, list[Trace]] = {}
    for regime, name, response, margins in loops:
        near = frequency_grid(response.poles, response.period)
        near = near[(near > low) & (near < high)]
        omega = np.unique(np.concatenate([np.geomspace(low, high, POINTS), near]))
        found.setdefault(regime, []).append(_trace(name, omega, response, margins))
    return found


def bode_svg(bench: CompleteBench, names: Sequence[str]) -> str:
    """The picture as a complete SVG document for white paper."""
    with canvas(WIDTH, HEIGHT) as sheet:
        _draw(sheet, bench, traces_of(bench, names))
        return to_svg(sheet)


def bode_png(bench: CompleteBench, names: Sequence[str]) -> bytes:
    """The picture as a PNG on white."""
    with canvas(WIDTH, HEIGHT) as sheet:
        _draw(sheet, bench, traces_of(bench, names))
        out = io.BytesIO()
        sheet.savefig(out, format="png", transparent=False, facecolor=PAPER.light)
        return out.getvalue()


def _range(loops: Sequence[LoopMargins]) -> tuple[float, float]:
    """From well below every crossover to Nyquist's frequency, or well above them (rad/s)."""
    told = [omega for loop in loops for omega in (*loop.crossovers, loop.gain_crossing) if omega]
    periods = [loop.period for loop in loops if loop.period is not None]
    high = math.pi / periods[0] if periods else 30.0 * max(told, default=TWO_PI)
    return max(0.1 * min(told, default=TWO_PI), 1e-5 * high), high


def _trace(name: str, omega: Array, response: Response, margins: LoopMargins) -> Trace:
    value = response(omega)
    phase = np.degrees(np.unwrap(np.angle(value)))
    # Whole turns are arbitrary: where the margin is, the phase is from -270 to 90 degrees.
    place = margins.crossover or margins.gain_crossing or float(omega[len(omega) // 2])
    there = float(np.interp(place, omega, phase))
    phase -= 360.0 * math.ceil((there - 90.0) / 360.0)
    return Trace(name, omega / TWO_PI, 20.0 * np.log10(np.abs(value)), phase, margins)


def _draw(sheet: Canvas, bench: CompleteBench, traces: Mapping[Regime, Sequence[Trace]]) -> None:
    """Magnitude above, phase below, a column per regime."""
    heading = f"Rate loop of {bench.name}, opened at the rate error"
    sheet.suptitle(heading, x=0.008, ha="left", fontsize=10, weight="bold")
    axes = sheet.subplots(2, max(1, len(traces)), sharex=True, sharey="row", squeeze=False)
    chosen = looks(
        name
        for name in ("none", *bench.compensation)
        if any(name == trace.compensation for shown in traces.values() for trace in shown)
    )
    for name, look in chosen.items():  # the legend, in this order, whatever is drawn first
        axes[0, 0].plot([], [], label=name, **_line(look))
    for column, (regime, shown) in enumerate(traces.items()):
        _draw_regime(axes[0, column], axes[1, column], regime, shown, chosen)
    levels = [level for shown in traces.values() for trace in shown for level in trace.level]
    lowest, highest = min(levels, default=0.0), max(levels, default=0.0)
    axes[0, 0].set_ylim(max(DEEPEST, lowest - 5.0), max(10.0, min(HIGHEST, highest)))
    axes[0, 0].set_ylabel("Magnitude of L (dB)")
    axes[1, 0].set_ylabel("Phase of L (deg)")
    for ax in axes[1]:
        ax.set_xlabel("Frequency (Hz)")
    sheet.legend(loc="outside lower left", ncols=min(6, max(1, len(chosen))), borderpad=0)


def _draw_regime(
    above: Axes, below: Axes, regime: Regime, shown: Sequence[Trace], chosen: Mapping[str, Look]
) -> None:
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    for trace in shown:
        line = _line(chosen[trace.compensation])
        above.plot(trace.frequency, trace.level, **line)
        below.plot(trace.frequency, trace.phase, **line)
    level: dict[str, Any] = {"color": INK.light, "linewidth": 0.7, "zorder": 1.4}
    above.axhline(0.0, **level)
    below.axhline(-180.0, **level)
    above.set_xscale("log")
    above.xaxis.set_major_formatter(FuncFormatter(lambda hertz, _: f"{hertz:g}"))
    below.yaxis.set_major_locator(MultipleLocator(45.0))
    worst = min(shown, key=lambda trace: trace.margins.tightness)
    above.set_title(f"{regime.capitalize()}: {_verdict(worst)}")
    if worst.margins.stable:
        _draw_margins(above, below, worst, chosen[worst.compensation])


def _line(look: Look) -> dict[str, Any]:
    if not look.dash:
        return {"color": look.light, "linewidth": 1.3}
    # Above the solid lines, which then show through the gaps.
    return {"color": look.light, "linewidth": 1.3, "dashes": look.dash, "zorder": 2.1}


def _verdict(trace: Trace) -> str:
    """The least margin in few words; its place is drawn."""
    state = "least margin" if trace.margins.stable else "UNSTABLE"
    return f"{state} with {trace.compensation}"


def _draw_margins(above: Axes, below: Axes, trace: Trace, look: Look) -> None:
    """Crossover and phase margin, and the gain margin where there is one."""
    margins = trace.margins
    guide: dict[str, Any] = {
        "color": MUTED.light,
        "linewidth": 0.7,
        "dashes": (3, 2),
        "zorder": 1.5,
    }
    if margins.crossover is not None and margins.phase_margin is not None:
        at = margins.crossover / TWO_PI
        for ax in (above, below):
            ax.axvline(at, **guide)
        phase = float(np.interp(at, trace.frequency, trace.phase))
        above.plot([at], [0.0], marker="o", markersize=4.5, color=look.light, zorder=3)
        _arrow(below, (at, -180.0), (at, phase))
        text = f"{math.degrees(margins.phase_margin):.0f}°\n{at:.3g} Hz"
        middle = -180.0 + 0.45 * (phase + 180.0)
        side = _free_side(trace.frequency, trace.phase, at, middle)
        _label(below, text, (at, middle), side if phase + 180.0 > SHORT_PHASE else "below")
    if margins.gain_crossing is not None and margins.gain_margin_db is not None:
        at, decibel = margins.gain_crossing / TWO_PI, margins.gain_margin_db
        if trace.frequency[0] <= at <= trace.frequency[-1]:
            for ax in (above, below):
                ax.axvline(at, **guide)
            below.plot([at], [-180.0], marker="o", markersize=4.5, color=look.light, zorder=3)
            _arrow(above, (at, -decibel), (at, 0.0))
            middle = -0.25 * decibel
            side = _free_side(trace.frequency, trace.level, at, middle)
            text = f"{decibel:.1f} dB\n{at:.3g} Hz"
            _label(above, text, (at, middle), side if decibel > SHORT_GAIN else "below")


def _free_side(frequency: Array, value: Array, at: float, middle: float) -> str:
    """On which side of `at` the curve leaves more room around `middle`."""
    places = at * np.array([0.25, 0.4, 0.65, 1.5, 2.5, 4.0])
    room = np.abs(np.interp(places, frequency, value) - middle)
    outside = places > frequency[-1]
    room[outside] = 0.0
    return "right" if np.min(room[3:]) > np.min(room[:3]) else "left"


def _arrow(ax: Axes, begin: tuple[float, float], end: tuple[float, float]) -> None:
    style = {"arrowstyle": "<->", "color": INK.light, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, begin, arrowprops=style, zorder=3)


def _label(ax: Axes, text: str, at: tuple[float, float], side: str) -> None:
    """Beside an arrow, or below and left of it, on paper of its own that hides no curve."""
    right = side == "right"
    ax.annotate(
        text,
        at,
        xytext=(6 if right else -6, -20 if side == "below" else 0),
        textcoords="offset points",
        ha="left" if right else "right",
        va="center",
        fontsize=8,
        bbox={"facecolor": PAPER.light, "edgecolor": "none", "pad": 1.0, "alpha": 0.85},
        zorder=1.8,  # over the grid, under the curves
    )
