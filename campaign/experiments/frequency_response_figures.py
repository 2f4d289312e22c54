"""Bode diagrams of measured responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from campaign.identification.frequency_response import (
    Continuation,
    Response,
    margins,
    open_loop,
)
from campaign.result import Array, Axis, Curve, Figure, Finding, Mark, Panel

FREQUENCY = Axis("Frequency", "Hz", "Hz", scale="log")
PHASE = Axis("Phase", "rad", "deg")
SHOWN_BEYOND = 1.2
"""An extrapolated curve is drawn to this many times the crossover that it is for."""

Named = tuple[str, str, Response]
"""Label, series and response of one curve."""


def closed_loop_figures(sweeps: Sequence[Named]) -> Iterator[Figure]:
    """Figures 5.5 and 5.19 (closed loop), 5.6 and 5.20 (open loop from it)."""
    several = len(sweeps) != len({series for _, series, _ in sweeps})
    named = [(label, label if several else series, r) for label, series, r in sweeps]
    methods = {series for _, series, _ in sweeps}
    observed, modelled = "observer" in methods, bool(methods & {"lugre", "static"})
    yield _bode(
        "closed-loop",
        "Closed-loop response, rate command to gyro rate",
        "Up to the bandwidth, where the gain has fallen by 3 dB, the load follows its command. "
        "Compensation is harmless where its curve stays with the uncompensated one.",
        "Gain and phase of the closed loop over frequency, one curve per compensation.",
        Axis("Gain", "dB"),
        [(label, series, r, r.level, _turned(r)) for label, series, r in named],
        thesis=_chosen(("5.5", modelled), ("5.19", observed)),
        level_marks=(Mark("-3 dB", y=-3.0),),
    )
    loops = [(label, series, open_loop(r)) for label, series, r in named]
    yield _bode(
        "open-loop",
        "Open-loop response, rate error to gyro rate",
        "The distance of the phase from -180° where the gain is 0 dB is the phase margin; how far "
        "the gain is below 0 dB where the phase is -180° is the gain margin. What lies above the "
        "sweep is extrapolated (thin).",
        "Gain and phase of the open loop over frequency, one curve per compensation, with the "
        "0 dB and -180° lines.",
        Axis("Gain", "dB"),
        [(label, series, r, r.level, _turned(r)) for label, series, r in loops],
        thesis=_chosen(("5.6", modelled), ("5.20", observed)),
        level_marks=(Mark("0 dB", y=0.0),),
        phase_marks=(Mark("-180°", y=-np.pi),),
        more=list(_continued(loops)),
    )


def torque_figure(sweeps: Sequence[Named], modes: Iterable[Finding]) -> Figure:
    """Figure 4.5: drive torque to gyro rate, and the inertia that it looks like."""
    several = len(sweeps) != len({series for _, series, _ in sweeps})
    named = [(label, label if several else series, r) for label, series, r in sweeps]
    found = [mode.value for mode in modes][:1]
    bode = _bode(
        "torque-to-rate",
        "Open-loop response, drive torque to gyro rate",
        "A rigid axis falls by 20 dB per decade with the phase at -90°; friction lifts the phase "
        "and flattens the gain at low frequencies. An elastic mode is a dip and a peak side by "
        "side: in the inertia that torque over acceleration amounts to, a peak and a dip on top "
        "of the axis' own.",
        "Gain and phase from drive torque to gyro rate over frequency, and the apparent inertia.",
        Axis("Gain, dB of 1 rad/s per N m"),
        [(label, series, r, r.level, _turned(r)) for label, series, r in named],
        thesis=("4.5",),
        level_marks=tuple(Mark(f"{value:.3g} Hz", x=value) for value in found),
        phase_marks=tuple(Mark("", x=value) for value in found),
    )
    inertia = Panel(
        FREQUENCY,
        Axis("Apparent inertia", "kg m^2", "kg m^2"),
        [Curve(r.frequency, _apparent_inertia(r), label, series) for label, series, r in named],
        marks=tuple(Mark("", x=value) for value in found),
    )
    return replace(bode, panels=(*bode.panels, inertia))


def _apparent_inertia(response: Response) -> Array:
    """Torque over acceleration (kg m^2), shape (n,): what a rigid free axis would have."""
    omega = 2.0 * np.pi * response.frequency
    return np.asarray(1.0 / (omega * np.maximum(np.abs(response.values), 1e-300)))


def _chosen(*numbers: tuple[str, bool]) -> tuple[str, ...]:
    """Numbers whose condition holds; all of them when none does."""
    return tuple(number for number, holds in numbers if holds) or tuple(n for n, _ in numbers)


def _turned(response: Response) -> Array:
    """Phase (rad) with its median within half a turn of -90°."""
    phase = response.phase
    turns = np.round((np.median(phase) + 0.5 * np.pi) / (2.0 * np.pi))
    return np.asarray(phase - 2.0 * np.pi * turns)


def _continued(loops: Sequence[Named]) -> Iterator[tuple[Curve, Curve]]:
    """Gain and phase above the sweep, up to a crossover that lies there."""
    for number, (_, series, loop) in enumerate(loops):
        gain, _ = margins(loop)
        beyond = Continuation.of(loop)
        if beyond is None or not gain.extrapolated:
            continue
        at = np.geomspace(beyond.start, SHOWN_BEYOND * gain.frequency, 60)
        shift = _turned(loop)[-1] - loop.phase[-1]
        label = "extrapolated" if number == 0 else ""
        yield (
            Curve(at, beyond.level(at), label, series, "thin"),
            Curve(at, beyond.phase(at) + shift, label, series, "thin"),
        )


def _bode(
    key: str,
    title: str,
    caption: str,
    alt: str,
    gain: Axis,
    curves: Sequence[tuple[str, str, Response, Array, Array]],
    thesis: tuple[str, ...],
    level_marks: tuple[Mark, ...] = (),
    phase_marks: tuple[Mark, ...] = (),
    more: Sequence[tuple[Curve, Curve]] = (),
) -> Figure:
    return Figure(
        key=key,
        title=title,
        caption=caption,
        alt=alt,
        panels=(
            Panel(
                FREQUENCY,
                gain,
                [Curve(r.frequency, level, label, s) for label, s, r, level, _ in curves]
                + [level for level, _ in more],
                marks=level_marks,
            ),
            Panel(
                FREQUENCY,
                PHASE,
                [Curve(r.frequency, phase, label, s) for label, s, r, _, phase in curves]
                + [phase for _, phase in more],
                marks=phase_marks,
            ),
        ),
        thesis=thesis,
    )
