"""Trials in unplanned recordings: excitation and windows are detected."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from campaign.channels import BASE_RATE, COMMAND, GYRO_RATE
from campaign.estimate import Window
from campaign.estimation.excitation_detection import (
    FoundStretch,
    found_sine,
    found_step,
    from_start,
    sine_stretch,
)
from campaign.signals import Polyline, Sine
from campaign.trial import OfferedRecording, Task, TrialRequest

CHOOSE_SINE = "where it is a sine for a while, windows name that part, or start and stop cut it out"


def named_or_found(offered: OfferedRecording, found: Sequence[Window]) -> tuple[Window, ...]:
    """The windows that an analysis needs: stated ones by name, else detected ones."""
    stated = {window.name: window for window in offered.windows}
    return tuple(stated.get(window.name, window) for window in found)


def _stated(offered: OfferedRecording, name: str) -> Window | None:
    """The stated window of a name. Raises ValueError if only other windows are stated."""
    names = [window.name for window in offered.windows]
    if names and name not in names:
        raise ValueError(f"a window {names[0]!r} has no meaning here; it is {name!r}")
    return next((window for window in offered.windows if window.name == name), None)


def _sine(offered: OfferedRecording, channel: str, window: Window | None) -> FoundStretch:
    """The sine of a channel, at the stated frequency (Hz) if there is one.

    The search covers the stated window, or the whole recording.
    """
    known = offered.conditions.get("frequency")
    frequency = float(known) if isinstance(known, int | float) else None
    signal, rate = offered.read([channel])[channel], offered.sample_rate
    try:
        if window is None:
            return sine_stretch(signal, rate, frequency)
        first, stop = (round(end * rate) for end in (window.start, window.stop))
        sine = found_sine(signal[first:stop], rate, frequency)
    except ValueError as error:
        if window is not None:
            raise ValueError(f"{channel} in the window {window.name!r}: {error}") from None
        raise ValueError(f"{channel}: {error}; {CHOOSE_SINE}") from None
    return FoundStretch(from_start(sine, first / rate), first, stop)


def _steady(
    offered: OfferedRecording,
    window: Window | None,
    found: FoundStretch,
    settle_cycles: int,
    settle_time: float,
) -> tuple[float, float, int]:
    """Begin and end (s) of the measured whole cycles, and their number."""
    frequency = found.sine.frequency
    if window is not None:
        return window.start, window.stop, round((window.stop - window.start) * frequency)
    settle = max(settle_cycles, math.ceil(settle_time * frequency - 1e-9))
    begin = found.first / offered.sample_rate
    lasts = (found.stop - found.first) / offered.sample_rate
    cycles = math.floor(lasts * frequency + 1e-9) - settle
    if cycles < 1:
        raise ValueError(
            f"{lasts:.3g} s hold no whole cycle of {frequency:.4g} Hz after {settle} to "
            "settle; lower settle_cycles, or say its windows"
        )
    return begin + settle / frequency, begin + (settle + cycles) / frequency, cycles


def sine_response(
    offered: OfferedRecording,
    mode: Literal["rate", "torque"],
    excitation: str,
    window: str,
    settle_cycles: int,
    settle_time: float,
) -> TrialRequest:
    """A response to a sine of a channel. Raises ValueError if the channel is not a sine."""
    stated = _stated(offered, window)
    stretch = _sine(offered, excitation, stated)
    sine = stretch.sine
    start, stop, cycles = _steady(offered, stated, stretch, settle_cycles, settle_time)
    return TrialRequest(
        Task(
            mode=mode,
            command=Sine(amplitude=sine.amplitude, frequency=sine.frequency, phase=sine.phase),
            duration=offered.duration,
            window=(start, stop),
            sample_rate=offered.sample_rate,
        ),
        point={"frequency": round(sine.frequency, 9)},
        note=f"a sine of {sine.frequency:.4g} Hz was found{_where(offered, stated, stretch)}; "
        f"{cycles} cycles are measured",
        requires=(GYRO_RATE, excitation),
        windows=(Window(window, start, stop),),
    )


def _where(offered: OfferedRecording, stated: Window | None, found: FoundStretch) -> str:
    """Window or times of a sine in a recording, as text; empty for the whole recording."""
    if stated is not None:
        return f" in the window {stated.name!r}, {stated.start:.4g} to {stated.stop:.4g} s"
    whole = round(offered.duration * offered.sample_rate)
    if found.stop - found.first >= whole - 1:
        return ""
    first, stop = (each / offered.sample_rate for each in (found.first, found.stop))
    return f", from {first:.4g} to {stop:.4g} s"


def step_found(offered: OfferedRecording, names: tuple[str, str]) -> TrialRequest:
    """A step of the command, with named windows before and after. Raises ValueError for no step."""
    recording = offered.read([COMMAND])
    try:
        step = found_step(recording.time, recording[COMMAND])
    except ValueError as error:
        raise ValueError(f"{COMMAND}: {error}") from None
    windows = Window(names[0], 0.0, step.at), Window(names[1], step.at, offered.duration)
    return TrialRequest(
        Task(
            mode="rate",
            command=Polyline(
                times=(0.0, step.at, step.at + step.ramp),
                values=(step.before, step.before, step.after),
            ),
            duration=offered.duration,
            window=(step.at, offered.duration),
            sample_rate=offered.sample_rate,
        ),
        note=f"a step was found at {step.at:.4g} s",
        windows=named_or_found(offered, windows),
        options={
            "step": step.size,
            "ramp": step.ramp,
            "rest": step.at,
            "duration": offered.duration - step.at,
            "linear": False,
        },
    )


def hull_sine(offered: OfferedRecording, window: str, settle_cycles: int) -> TrialRequest:
    """A sinusoidal motion of the hull. Raises ValueError if it is not a sine."""
    stated = _stated(offered, window)
    stretch = _sine(offered, BASE_RATE, stated)
    sine = stretch.sine
    start, stop, cycles = _steady(offered, stated, stretch, settle_cycles, 0.0)
    omega = 2.0 * np.pi * sine.frequency
    acceleration = sine.amplitude * omega
    return TrialRequest(
        Task(
            mode="rate",
            # The derivative leads the rate by a quarter of a cycle.
            base_acceleration=Sine(
                amplitude=acceleration, frequency=sine.frequency, phase=sine.phase + 0.5 * math.pi
            ),
            duration=offered.duration,
            window=(start, stop),
            sample_rate=offered.sample_rate,
        ),
        note=f"the hull swings at {sine.frequency:.4g} Hz{_where(offered, stated, stretch)}; "
        f"{cycles} cycles are measured",
        options={
            "frequency": round(sine.frequency, 6),
            "acceleration": acceleration,
            "cycles": cycles,
        },
    )
