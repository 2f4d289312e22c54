"""Bode plot of a bench's rate loop for every compensation, with margins."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.physics.complete import CompleteBench
from campaign.physics.linear_friction import REGIMES, NoLoopError, Regime
from campaign.physics.loop_margins import LoopMargins, Response, frequency_grid, margins_of
from campaign.physics.open_loop import open_loop
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.figures import draw, draw_sheet
from campaign.report.palette import PAPER
from campaign.result import Axis, Curve, Figure, Mark, Panel
from campaign.signals import Array

TWO_PI = 2.0 * np.pi
POINTS = 1500
DEEPEST, HIGHEST = -70.0, 60.0
"""Limits of the magnitude (dB): below, a loop has no effect; above, it is only an integrator."""
FREQUENCY = Axis("Frequency", "Hz", scale="log")


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
    """Rate loop with each compensation, by regime; those without a linear loop are missing."""
    loops: list[tuple[Regime, str, Response, LoopMargins]] = []
    for regime in REGIMES:
        for name in names:
            try:
                loop = open_loop(bench, name, "rate", regime)
            except NoLoopError:
                continue
            loops.append((regime, name, Response(loop), margins_of(loop)))
    low, high = _range([margins for _, _, _, margins in loops])
    traces: dict[Regime, list[Trace]] = {}
    for regime, name, response, margins in loops:
        near = frequency_grid(response.poles, response.period)
        near = near[(near > low) & (near < high)]
        omega = np.unique(np.concatenate([np.geomspace(low, high, POINTS), near]))
        traces.setdefault(regime, []).append(_trace(name, omega, response, margins))
    return traces


def bode_svg(bench: CompleteBench, names: Sequence[str]) -> str:
    """Bode plot as a complete SVG document for white paper."""
    return DrawingFiles.of(draw(bode_figure(bench, names))).svg


def bode_png(bench: CompleteBench, names: Sequence[str]) -> bytes:
    """Bode plot as a PNG on white."""
    out = io.BytesIO()
    sheet = draw_sheet(bode_figure(bench, names))
    sheet.savefig(out, format="png", dpi=200, facecolor=PAPER.light)
    return out.getvalue()


def bode_figure(bench: CompleteBench, names: Sequence[str]) -> Figure:
    """Figure with magnitude above phase, a column per regime, margins of the least stable loop."""
    traces = traces_of(bench, names)
    levels = [trace.level for shown in traces.values() for trace in shown] or [np.zeros(1)]
    lowest, highest = float(np.min(np.hstack(levels))), float(np.max(np.hstack(levels)))
    limits = max(DEEPEST, lowest - 5.0), max(10.0, min(HIGHEST, highest))
    above, below = [], []
    for regime, shown in traces.items():
        worst = min(shown, key=lambda trace: trace.margins.tightness)
        gain, phase = _margins(worst) if worst.margins.stable else ((), ())
        state = "least margin" if worst.margins.stable else "UNSTABLE"
        title = f"{bench.name}, {regime}: {state} with {worst.compensation}"
        above.append(
            Panel(
                FREQUENCY,
                Axis("Magnitude of L", "dB", limits=limits),
                tuple(_curve(trace, trace.level) for trace in shown),
                title,
                (Mark("", y=0.0), *gain),
            )
        )
        below.append(
            Panel(
                FREQUENCY,
                Axis("Phase of L", "deg"),
                tuple(_curve(trace, trace.phase) for trace in shown),
                f"Phase, {regime}",
                (Mark("", y=-180.0), *phase),
            )
        )
    title = f"Rate loop of {bench.name}, opened at the rate error"
    panels, across = (*above, *below), max(1, len(traces))
    return Figure("bode", title, title, title, panels, across=across, one_scale=True)


def _range(loops: Sequence[LoopMargins]) -> tuple[float, float]:
    """Range from below every crossover to the Nyquist frequency, or above them (rad/s)."""
    omegas = [omega for loop in loops for omega in (*loop.crossovers, loop.gain_crossing) if omega]
    periods = [loop.period for loop in loops if loop.period is not None]
    high = math.pi / periods[0] if periods else 30.0 * max(omegas, default=TWO_PI)
    return max(0.1 * min(omegas, default=TWO_PI), 1e-5 * high), high


def _trace(name: str, omega: Array, response: Response, margins: LoopMargins) -> Trace:
    value = response(omega)
    phase = np.degrees(np.unwrap(np.angle(value)))
    # Whole turns are arbitrary: at the margin, the phase must be from -270 to 90 degrees.
    place = margins.crossover or margins.gain_crossing or float(omega[len(omega) // 2])
    phase_there = float(np.interp(place, omega, phase))
    phase -= 360.0 * math.ceil((phase_there - 90.0) / 360.0)
    return Trace(name, omega / TWO_PI, 20.0 * np.log10(np.abs(value)), phase, margins)


def _curve(trace: Trace, values: Array) -> Curve:
    return Curve(trace.frequency, values, trace.compensation, trace.compensation)


def _margins(trace: Trace) -> tuple[list[Mark], list[Mark]]:
    """Marks of crossover, phase margin and gain margin, on the magnitude and on the phase."""
    margins, own = trace.margins, trace.compensation
    above: list[Mark] = []
    below: list[Mark] = []
    if margins.crossover is not None and margins.phase_margin is not None:
        at = margins.crossover / TWO_PI
        phase = float(np.interp(at, trace.frequency, trace.phase))
        above += [Mark("", x=at), Mark("", x=at, y=0.0, point=True, series=own)]
        below += [Mark(f"{math.degrees(margins.phase_margin):.0f}° at {at:.3g} Hz", x=at)]
        below += [Mark("", x=at, y=phase, point=True, series=own)]
    if margins.gain_crossing is not None and margins.gain_margin_db is not None:
        at, decibel = margins.gain_crossing / TWO_PI, margins.gain_margin_db
        if trace.frequency[0] <= at <= trace.frequency[-1]:
            above += [Mark(f"{decibel:.1f} dB at {at:.3g} Hz", x=at)]
            above += [Mark("", x=at, y=-decibel, point=True, series=own)]
            below += [Mark("", x=at), Mark("", x=at, y=-180.0, point=True, series=own)]
    return above, below
