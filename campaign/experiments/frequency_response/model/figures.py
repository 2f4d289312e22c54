"""Figures of frequency responses: Bode with intervals and fits, coherence, distortion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from campaign.estimation.continuation import DECIBEL
from campaign.estimation.frequency.best_linear import BestLinear
from campaign.estimation.frequency.distortion import Level
from campaign.estimation.frequency.measured import MeasuredResponse
from campaign.estimation.frequency_response import Array, ComplexArray
from campaign.experiments.frequency_response.figures import closed_loop_figures
from campaign.experiments.frequency_response.model.frequency_fit import FrequencyFit, Masses
from campaign.experiments.frequency_response.model.tables import drive_name
from campaign.result import Axis, Curve, Figure, Mark, Panel

FREQUENCY = Axis("Frequency", "Hz", "Hz", scale="log")
PHASE = Axis("Phase", "rad", "deg")
FINE = 800
"""Frequencies at which a fitted function is drawn."""
TORQUE = "Gain, dB of 1 rad/s per N·m"


def figures(found: Sequence[FrequencyFit], masses: Masses) -> Iterator[Figure]:
    """All of them, the most telling first."""
    for number, each in enumerate(found, start=1):
        for side, measured in each.source.responses.items():
            key = f"bode-{number}-{side}"
            yield _bode_of(key, each, side, measured, masses)
        for side, best in each.source.best.items():
            if best.distortion is not None:
                yield _distortion(f"distortion-{number}-{side}", each, side, best)
    loops = [(each.source.name, each.source.closed, each.margins) for each in found]
    closed = [(name, name, loop) for name, loop, _ in loops if loop is not None]
    if closed:
        margins = [told for _, loop, told in loops if loop is not None]
        yield from closed_loop_figures(closed, margins)
    told = [(each.source.name, r) for each in found for r in each.source.responses.values()]
    yield _coherence(told)


def _bode_of(
    key: str, each: FrequencyFit, side: str, measured: MeasuredResponse, masses: Masses
) -> Figure:
    lines: list[tuple[str, Array, ComplexArray]] = []
    fit = each.fits.get(side)  # type: ignore[call-overload]
    if fit is not None:
        label = "rational function" + (", misfit" if fit.fit.misfit else "")
        fine = np.geomspace(fit.fit.lowest, fit.fit.highest, FINE)
        lines.append((label, fine, fit.fit.value(fine)))
    place = masses.places.get(side)  # type: ignore[call-overload]
    if masses.drive is not None and masses.source is each.source and place is not None:
        label = drive_name(masses.drive) + (", misfit" if masses.drive.misfit else "")
        first = max(masses.lowest, measured.frequency[0])
        fine = np.geomspace(first, measured.frequency[-1], FINE)
        lines.append((label, fine, masses.drive.value(fine, place)))
    gain, phase = panels(measured, lines, TORQUE)
    shown = [gain, phase]
    if fit is not None:
        shown.append(_left(measured, fit.fit.value(measured.frequency)))
    modes = [m for m in each.modes.get(side, ()) if m.frequency.has_interval]  # type: ignore[call-overload]
    marks = tuple(Mark(f"{mode.frequency.value:.3g} Hz", x=mode.frequency.value) for mode in modes)
    shown[0] = Panel(gain.x, gain.y, gain.curves, marks=marks)
    return Figure(
        key,
        f"Torque to rate, {each.source.name}, sensor of the {side}",
        "Bars are 95 % intervals by scatter. A model's line begins where it was fitted from on. "
        "What a fit leaves should be no larger than the line "
        "of its scatter; where it is, the function is no model of the drive.",
        "Gain and phase from torque to rate over frequency with intervals and fitted functions, "
        "and what the rational function leaves.",
        tuple(shown),
        trials=each.source.trials,
    )


def panels(
    measured: MeasuredResponse, lines: Sequence[tuple[str, Array, ComplexArray]], label: str
) -> tuple[Panel, Panel]:
    """Gain and phase of a response with 95 % bars, and lines (name, frequency, response)."""
    size = np.maximum(np.abs(measured.values), 1e-300)
    half = 1.96 * measured.widened / size
    known = half < 1.0
    half = np.where(known, half, np.nan)
    level = DECIBEL * np.log(size)
    phase = _turned(measured.values)
    down = np.where(known, DECIBEL * np.log(np.maximum(1.0 - half, 1e-3)), np.nan)
    up = DECIBEL * np.log(1.0 + half)
    x = measured.frequency
    gains = [Curve(x, level, "measured", "measured", "points", low=level + down, high=level + up)]
    wide = np.arcsin(np.minimum(np.nan_to_num(half, nan=1.0), 1.0))
    wide = np.where(known, wide, np.nan)
    phases = [
        Curve(x, phase, "measured", "measured", "points", low=phase - wide, high=phase + wide)
    ]
    for name, at, values in lines:
        gains.append(Curve(at, DECIBEL * np.log(np.maximum(np.abs(values), 1e-300)), name, name))
        own = np.unwrap(np.angle(values))
        there = np.interp(np.log(x), np.log(at), own)
        own = own + 2.0 * np.pi * np.round(np.median(phase - there) / (2.0 * np.pi))
        phases.append(Curve(at, own, name, name))
    return Panel(FREQUENCY, Axis(label), gains), Panel(FREQUENCY, PHASE, phases)


def _turned(values: ComplexArray) -> Array:
    """Phase (rad), unwrapped, its median within half a turn of -90 deg."""
    phase = np.unwrap(np.angle(values))
    turns = np.round((np.median(phase) + 0.5 * np.pi) / (2.0 * np.pi))
    return np.asarray(phase - 2.0 * np.pi * turns)


def _left(measured: MeasuredResponse, model: ComplexArray) -> Panel:
    x = measured.frequency
    left = np.maximum(np.abs(measured.values - model), 1e-300)
    scatter = np.maximum(np.sqrt(measured.variance + measured.bias**2), 1e-300)
    return Panel(
        FREQUENCY,
        Axis("Left over, dB of 1 rad/s per N·m"),
        [
            Curve(x, DECIBEL * np.log(left), "left over by the function", "residual", "points"),
            Curve(x, DECIBEL * np.log(scatter), "scatter (1 sigma)", "scatter"),
        ],
    )


def _distortion(key: str, each: FrequencyFit, side: str, best: BestLinear) -> Figure:
    distortion = best.distortion
    if distortion is None:
        raise ValueError("there is no distortion to draw")
    x = best.response.frequency
    answered = decibel(np.sqrt(distortion.excited))
    curves = [Curve(x, answered, "excited lines", "measured", "points")]

    def level(name: str, told: Level) -> None:
        low, high = told.interval()
        sure = told.significant
        if np.any(sure):
            curves.append(
                Curve(
                    told.frequency[sure],
                    decibel(told.rms[sure]),
                    name,
                    name,
                    "points",
                    low=np.where(low[sure] > 0, decibel(low[sure]), np.nan),
                    high=decibel(high[sure]),
                )
            )

    level("even", distortion.even)
    level("odd", distortion.odd)
    noise = np.concatenate([distortion.even.noise, distortion.odd.noise])
    at = np.concatenate([distortion.even.frequency, distortion.odd.frequency])
    order = np.argsort(at)
    curves.append(Curve(at[order], decibel(np.sqrt(noise[order])), "noise", "noise", "thin"))
    return Figure(
        key,
        f"Distortion, {each.source.name}, sensor of the {side}",
        f"Rms of the output at single lines, {best.excitation}. Where no level is drawn, "
        "distortion is no more than the noise. Odd distortion also lies on the excited lines, and "
        "shifts the response there.",
        "Even and odd distortion and noise of the output over frequency.",
        (Panel(FREQUENCY, Axis("Rms of a line, dB of the output's unit"), curves),),
        trials=each.source.trials,
    )


def decibel(values: Array | float) -> Array:
    """20 log10 of sizes."""
    return np.asarray(DECIBEL * np.log(np.maximum(values, 1e-300)))


def _coherence(told: Sequence[tuple[str, MeasuredResponse]]) -> Figure:
    return Figure(
        "coherence",
        "Coherence",
        "Share of the output's power that the excitation accounts for. Noise, distortion and a "
        "second excitation take away from it.",
        "Coherence over frequency, one curve per response.",
        (
            Panel(
                FREQUENCY,
                Axis("Coherence", limits=(0.0, 1.02)),
                [Curve(each.frequency, each.coherence, name, name) for name, each in told],
            ),
        ),
    )
