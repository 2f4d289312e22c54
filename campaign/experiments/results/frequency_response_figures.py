"""Bode diagrams of measured responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from campaign.identification.continuation import DECIBEL, Continuation
from campaign.identification.frequency_response import Response, open_loop
from campaign.identification.servo import ServoCharacteristics
from campaign.result import Array, Axis, Curve, Figure, Finding, Mark, Panel

FREQUENCY = Axis("Frequency", "Hz", "Hz", scale="log")
PHASE = Axis("Phase", "rad", "deg")
SHOWN_BEYOND = 1.2
"""An extrapolated curve is drawn to this many times the crossover that it is for."""

NOTICEABLE = 0.02
"""Half-width, as a share of the response, from which on a point's interval is drawn: 0.2 dB, 1°."""
TWO_SIDED = 1.96

Named = tuple[str, str, Response]
"""Label, series and response of one curve."""


def closed_loop_figures(
    sweeps: Sequence[Named], found: Sequence[ServoCharacteristics | None]
) -> Iterator[Figure]:
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
        "sweep is extrapolated (thin), by one of the fits between which the margin may lie. Bands "
        "are 95 % intervals, where they are wide enough to be seen.",
        "Gain and phase of the open loop over frequency, one curve per compensation, with the "
        "0 dB and -180° lines.",
        Axis("Gain", "dB"),
        [(label, series, r, r.level, _turned(r)) for label, series, r in loops],
        thesis=_chosen(("5.6", modelled), ("5.20", observed)),
        level_marks=(Mark("0 dB", y=0.0),),
        phase_marks=(Mark("-180°", y=-np.pi),),
        more=list(_continued(loops, found)),
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


def _continued(
    loops: Sequence[Named], found: Sequence[ServoCharacteristics | None]
) -> Iterator[tuple[Curve, Curve]]:
    """Gain and phase above the sweep, up to a crossover that lies there."""
    label = "extrapolated"
    for (_, series, loop), read in zip(loops, found, strict=True):
        gain = read.crossing(read.gain_margin) if read else None
        phase = read.crossing(read.phase_margin) if read else None
        if gain is None or phase is None or not gain.extrapolated:
            continue
        told = loop.told
        beyond = Continuation.of(told, phase.frequency.value)
        if beyond is None:
            continue
        at = np.geomspace(beyond.start, SHOWN_BEYOND * gain.frequency.value, 60)
        shift = _turned(loop)[0] - loop.phase[0]
        yield (
            Curve(at, beyond.level(at), label, series, "thin"),
            Curve(at, beyond.phase(at) + shift, label, series, "thin"),
        )
        label = ""


def _with_interval(
    response: Response, values: Array, label: str, series: str, per_share: float
) -> Curve:
    """A curve with its band where that is noticeable; `per_share` turns shares into its unit."""
    half = TWO_SIDED * response.relative_error
    if not np.any(half > NOTICEABLE):
        return Curve(response.frequency, values, label, series)
    half = np.where(half > NOTICEABLE, half * per_share, np.nan)
    low, high = values - half, values + half
    return Curve(response.frequency, values, label, series, low=low, high=high)


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
                [_with_interval(r, level, label, s, DECIBEL) for label, s, r, level, _ in curves]
                + [level for level, _ in more],
                marks=level_marks,
            ),
            Panel(
                FREQUENCY,
                PHASE,
                [_with_interval(r, phase, label, s, 1.0) for label, s, r, _, phase in curves]
                + [phase for _, phase in more],
                marks=phase_marks,
            ),
        ),
        thesis=thesis,
    )
