"""Bode diagrams of measured responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimation.continuation import DECIBEL, Continuation
from campaign.estimation.frequency_response import Response, open_loop
from campaign.estimation.servo import ServoCharacteristics
from campaign.experiments.frequency_response.marks import BodeContent, Named, bandwidths, margins
from campaign.experiments.responses.figures import FREQUENCY, PHASE, gain_label, turned
from campaign.result import Array, Axis, Curve, Figure, Finding, Mark, Panel

SHOWN_BEYOND = 1.2
"""End of an extrapolated curve over the crossover that it is for."""

NOTICEABLE = 0.02
"""Half-width over the response above which a point's interval is drawn: 0.2 dB, 1°."""
TWO_SIDED = 1.96
"""Half of a two-sided 95 % interval over its standard deviation."""
BARE = "none"
"""Series of a response without compensation."""


def closed_loop_figures(
    sweeps: Sequence[Named],
    found: Sequence[ServoCharacteristics | None],
    names: Sequence[str] | None = None,
) -> Iterator[Figure]:
    """Figures 5.5 and 5.19 (closed loop), 5.6 and 5.20 (open loop from it).

    names: short names of the sweeps, for labels of their bandwidths and margins.
    """
    names = [series for _, series, _ in sweeps] if names is None else names
    named = _distinct(sweeps)
    methods = {series for _, series, _ in sweeps}
    observed, modelled = "observer" in methods, bool(methods & {"lugre", "static"})
    widths = bandwidths(named, found, names)
    yield _bode(
        "closed-loop",
        "Closed-loop response, rate command to gyro rate",
        "Up to the bandwidth, where the gain has fallen by 3 dB"
        + (" (dots)" if any(mark.point for mark in widths.gain_marks) else "")
        + ", the load follows its command. Compensation is harmless where its curve stays with the "
        "uncompensated one.",
        "Gain and phase of the closed loop over frequency, one curve per compensation.",
        Axis("Gain", "dB"),
        named,
        _chosen(("5.5", modelled), ("5.19", observed)),
        replace(widths, gain_marks=[Mark("-3 dB", y=-3.0), *widths.gain_marks]),
    )
    loops = [(label, series, open_loop(r)) for label, series, r in named]
    kept = margins(loops, [turned(r.phase) for _, _, r in loops], found, names)
    beyond = list(_continued(loops, found))
    yield _bode(
        "open-loop",
        "Open-loop response, rate error to gyro rate",
        "Phase margin: distance of the phase from -180° where the gain is 0 dB. Gain margin: "
        "distance of the gain below 0 dB where the phase is -180°."
        + (" Marks show both." if kept.gain_marks or kept.phase_marks else "")
        + (
            " What lies above the sweep is extrapolated (thin), by one of the fits between which "
            "the margin may lie."
            if beyond
            else ""
        )
        + " Bands and bars: 95 % intervals.",
        "Gain and phase of the open loop over frequency, one curve per compensation, with the "
        "0 dB and -180° lines and the margins.",
        Axis("Gain", "dB"),
        loops,
        _chosen(("5.6", modelled), ("5.20", observed)),
        BodeContent(
            [*(level for level, _ in beyond), *kept.gain],
            [*(phase for _, phase in beyond), *kept.phase],
            [Mark("0 dB", y=0.0), *kept.gain_marks],
            [Mark("-180°", y=-np.pi), *kept.phase_marks],
        ),
    )


def torque_figure(sweeps: Sequence[Named], modes: Iterable[Finding]) -> Figure:
    """Figure 4.5: drive torque to gyro rate, and the apparent inertia."""
    named = _distinct(sweeps)
    resonances = [Mark(f"{mode.value:.3g} Hz", x=mode.value) for mode in modes][:1]
    bode = _bode(
        "torque-to-rate",
        "Open-loop response, drive torque to gyro rate",
        "A rigid axis falls by 20 dB per decade with the phase at -90°; friction lifts the phase "
        "and flattens the gain at low frequencies. An elastic mode is a dip and a peak side by "
        "side. In the apparent inertia, torque over acceleration, it is a peak and a dip.",
        "Gain and phase from drive torque to gyro rate over frequency, and the apparent inertia.",
        Axis(gain_label("Gain")),
        named,
        ("4.5",),
        BodeContent(gain_marks=resonances, phase_marks=resonances),
    )
    inertia = Panel(
        FREQUENCY,
        Axis("Apparent inertia", "kg m^2", "kg m^2"),
        [Curve(r.frequency, _apparent_inertia(r), label, series) for label, series, r in named],
        marks=resonances,
    )
    return replace(bode, panels=(*bode.panels, inertia))


def _distinct(sweeps: Sequence[Named]) -> list[Named]:
    """The sweeps; if two have one series, each with its label as the series."""
    several = len(sweeps) != len({series for _, series, _ in sweeps})
    return [(label, label if several else series, r) for label, series, r in sweeps]


def _apparent_inertia(response: Response) -> Array:
    """Torque over acceleration (kg m^2), shape (n,): the inertia of a rigid free axis."""
    omega = 2.0 * np.pi * response.frequency
    return np.asarray(1.0 / (omega * np.maximum(np.abs(response.values), 1e-300)))


def _chosen(*numbers: tuple[str, bool]) -> tuple[str, ...]:
    """Numbers whose condition holds; all of them when none does."""
    return tuple(number for number, holds in numbers if holds) or tuple(n for n, _ in numbers)


def _continued(
    loops: Sequence[Named], found: Sequence[ServoCharacteristics | None]
) -> Iterator[tuple[Curve, Curve]]:
    """Extrapolated gain and phase from the sweep's end to a crossover above it."""
    label = "extrapolated"
    for (_, series, loop), read in zip(loops, found, strict=True):
        gain = read.crossing(read.gain_margin) if read else None
        phase = read.crossing(read.phase_margin) if read else None
        if gain is None or phase is None or not gain.extrapolated:
            continue
        beyond = Continuation.of(loop.told, phase.frequency.value)
        if beyond is None:
            continue
        at = np.geomspace(beyond.start, SHOWN_BEYOND * gain.frequency.value, 60)
        shift = turned(loop.phase)[0] - loop.phase[0]
        yield (
            Curve(at, beyond.level(at), label, series, "thin"),
            Curve(at, beyond.phase(at) + shift, label, series, "thin"),
        )
        label = ""


def _with_interval(
    response: Response, values: Array, label: str, series: str, per_share: float
) -> Curve:
    """Curve with its band if the band is noticeable; `per_share` converts shares into its unit."""
    half = TWO_SIDED * response.relative_error
    if not np.any(half > NOTICEABLE):
        return Curve(response.frequency, values, label, series)
    half = np.where(half > NOTICEABLE, half * per_share, np.nan)
    return _within(response.frequency, values, half, label, series)


def _bode(
    key: str,
    title: str,
    caption: str,
    alt: str,
    gain: Axis,
    named: Sequence[Named],
    thesis: tuple[str, ...],
    more: BodeContent,
) -> Figure:
    curves = [(label, series, r, r.level, turned(r.phase)) for label, series, r in named]
    less = list(_differences(curves))
    every = [curve.x for curve in more.gain] + [r.frequency for _, _, r, _, _ in curves]
    across = _range(np.concatenate(every)) if less else FREQUENCY
    below = " (c, d) What compensation changes, less the response without." if less else ""
    return Figure(
        key=key,
        title=title,
        caption=caption + below,
        alt=alt + below,
        panels=(
            Panel(
                across,
                gain,
                [_with_interval(r, level, label, s, DECIBEL) for label, s, r, level, _ in curves]
                + more.gain,
                marks=more.gain_marks,
            ),
            Panel(
                across,
                PHASE,
                [_with_interval(r, phase, label, s, 1.0) for label, s, r, _, phase in curves]
                + more.phase,
                marks=more.phase_marks,
            ),
            *(replace(panel, x=across) for panel in less),
        ),
        thesis=thesis,
        across=2 if less else 1,
    )


def _range(frequency: Array) -> Axis:
    """Axis over all frequencies (Hz), so that panels below each other have the same one."""
    known = frequency[np.isfinite(frequency)]
    if not known.size:
        return FREQUENCY
    return replace(FREQUENCY, limits=(float(known.min()), float(known.max())))


def _differences(
    curves: Sequence[tuple[str, str, Response, Array, Array]],
) -> Iterator[Panel]:
    """Gain and phase of each method minus those without compensation, with 95 % intervals.

    Requires exactly one response without compensation, and others at the same frequencies. Overlaid
    curves do not show the effect of compensation.
    """
    bare = [each for each in curves if each[1] == BARE]
    if len(bare) != 1:
        return
    _, _, reference, level, phase = bare[0]
    others = [
        each
        for each in curves
        if each[1] != BARE and np.array_equal(each[2].frequency, reference.frequency)
    ]
    if not others:
        return
    gains, phases = [], []
    for label, series, response, own_level, own_phase in others:
        half = TWO_SIDED * np.hypot(response.relative_error, reference.relative_error)
        at, away = response.frequency, own_level - level
        turned = (own_phase - phase + np.pi) % (2.0 * np.pi) - np.pi
        gains.append(_within(at, away, half * DECIBEL, label, series))
        phases.append(_within(at, turned, half, label, series))
    yield Panel(FREQUENCY, Axis("Change of gain", "dB"), gains, marks=(Mark("", y=0.0),))
    yield Panel(FREQUENCY, Axis("Change of phase", "rad", "deg"), phases, marks=(Mark("", y=0.0),))


def _within(at: Array, values: Array, half: Array, label: str, series: str) -> Curve:
    return Curve(at, values, label, series, low=values - half, high=values + half)
