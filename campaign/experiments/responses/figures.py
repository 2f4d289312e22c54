"""Figures of responses: Bode with intervals and fits, distortion, coherence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.axis_kind import axis_unit
from campaign.estimation.continuation import DECIBEL
from campaign.estimation.frequency.best_linear import BestLinear
from campaign.estimation.frequency.distortion import Distortion, Level
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.two_mass_model import Side
from campaign.experiments.responses.sources import Source
from campaign.result import Axis, Curve, Figure, Mark, Panel
from campaign.text import pretty_unit

FREQUENCY = Axis("Frequency", "Hz", "Hz", scale="log")
PHASE = Axis("Phase", "rad", "deg")
FITTED = (
    " A model's line begins where it was fitted from on. What a fit leaves should be no larger "
    "than the line of its scatter; where it is, the function is no model of the drive."
)


@dataclass(frozen=True)
class FittedResponse:
    """Fits drawn on the response of one sensor.

    Attributes:
        lines: name, frequency (Hz) and response of each, shape (n,).
        marks: of modes, on the gain.
        value: response of a fitted function by Hz, for its residuals; None for none.
    """

    lines: Sequence[tuple[str, Array, ComplexArray]] = ()
    marks: tuple[Mark, ...] = ()
    value: Callable[[Array], ComplexArray] | None = None


NOTHING = FittedResponse()


def response_figures(
    sources: Sequence[Source], fitted: Mapping[tuple[int, Side], FittedResponse] | None = None
) -> Iterator[Figure]:
    """Each response and its distortion; `fitted`: by index of the source and sensor."""
    for index, source in enumerate(sources):
        for side, measured in source.responses.items():
            shown = (fitted or {}).get((index, side), NOTHING)
            yield _bode(f"bode-{index + 1}-{side}", source, side, measured, shown)
        for side, best in source.best.items():
            if best.distortion is not None:
                key = f"distortion-{index + 1}-{side}"
                yield _distortion(key, source, side, best, best.distortion)


def _bode(
    key: str, source: Source, side: Side, measured: MeasuredResponse, fitted: FittedResponse
) -> Figure:
    gain, phase = panels(measured, fitted.lines)
    gain = replace(gain, marks=fitted.marks)
    value = fitted.value
    left = [] if value is None else [_left(measured, value(measured.frequency))]
    return Figure(
        key,
        f"Torque to rate, {source.name}, sensor of the {side}",
        f"Bars are 95 % intervals by scatter.{FITTED if fitted.lines else ''}",
        "Gain and phase from torque to rate over frequency with intervals"
        + (" and fitted functions, and what the rational function leaves." if left else "."),
        (gain, phase, *left),
        trials=source.trials,
    )


def panels(
    measured: MeasuredResponse, lines: Sequence[tuple[str, Array, ComplexArray]]
) -> tuple[Panel, Panel]:
    """Gain and phase of a response with 95 % bars, and lines (name, frequency, response)."""
    size = np.maximum(np.abs(measured.values), 1e-300)
    half = 1.96 * measured.widened / size
    known = half < 1.0
    half = np.where(known, half, np.nan)
    level = decibel(size)
    phase = turned(np.unwrap(np.angle(measured.values)))
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
        gains.append(Curve(at, decibel(np.abs(values)), name, name))
        own = np.unwrap(np.angle(values))
        interpolated = np.interp(np.log(x), np.log(at), own)
        own = own + 2.0 * np.pi * np.round(np.median(phase - interpolated) / (2.0 * np.pi))
        phases.append(Curve(at, own, name, name))
    return Panel(FREQUENCY, Axis(gain_label("Gain")), gains), Panel(FREQUENCY, PHASE, phases)


def gain_label(what: str) -> str:
    """Label of a gain from torque to rate."""
    return f"{what}, dB of 1 {pretty_unit(axis_unit('rad/s/(N m)'))}"


def turned(phase: Array) -> Array:
    """A phase (rad), unwrapped, with its median within half a turn of -90 deg."""
    turns = np.round((np.median(phase) + 0.5 * np.pi) / (2.0 * np.pi))
    return np.asarray(phase - 2.0 * np.pi * turns)


def _left(measured: MeasuredResponse, model: ComplexArray) -> Panel:
    x = measured.frequency
    left = decibel(np.abs(measured.values - model))
    scatter = decibel(np.sqrt(measured.variance + measured.bias**2))
    return Panel(
        FREQUENCY,
        Axis(gain_label("Left over")),
        [
            Curve(x, left, "left over by the function", "residual", "points"),
            Curve(x, scatter, "scatter (1 sigma)", "scatter"),
        ],
    )


def _distortion(
    key: str, source: Source, side: Side, best: BestLinear, distortion: Distortion
) -> Figure:
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
        f"Distortion, {source.name}, sensor of the {side}",
        f"Rms of the output at single lines, {best.excitation}. Where no level is drawn, "
        "distortion is no more than the noise. Odd distortion also lies on the excited lines, and "
        "shifts the response there.",
        "Even and odd distortion and noise of the output over frequency.",
        (Panel(FREQUENCY, Axis("Rms of a line, dB of the output's unit"), curves),),
        trials=source.trials,
    )


def decibel(values: Array | float) -> Array:
    """20 log10 of sizes."""
    return np.asarray(DECIBEL * np.log(np.maximum(values, 1e-300)))


def coherence_figure(sources: Sequence[Source]) -> Figure:
    """Figure of the coherence of all responses."""
    responses = [(each.name, response) for each in sources for response in each.responses.values()]
    return Figure(
        "coherence",
        "Coherence",
        "Share of the output's power that the excitation accounts for. Noise, distortion and a "
        "second excitation take away from it.",
        "Coherence over frequency, one curve per response.",
        (
            Panel(
                FREQUENCY,
                Axis("Coherence"),
                [Curve(each.frequency, each.coherence, name, name) for name, each in responses],
            ),
        ),
    )
