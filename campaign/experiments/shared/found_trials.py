"""Trials in recordings that nobody planned: what excited them, and so their windows, is found."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from campaign.channels import BASE_RATE, COMMAND, GYRO_RATE
from campaign.estimate import Window
from campaign.identification.found_excitation import (
    FoundStretch,
    found_sine,
    found_step,
    from_start,
    sine_stretch,
)
from campaign.signals import Polyline, Sine
from campaign.trial import Offered, Task, TrialRequest

CHOOSE_SINE = "where it is a sine for a while, windows name that part, or start and stop cut it out"


def _sine(offered: Offered, channel: str) -> FoundStretch:
    """The sine of a channel, at the frequency (Hz) that is known to have been set, if it is.

    Looked for in the first of the windows that were stated, or in all of the recording.
    """
    known = offered.conditions.get("frequency")
    frequency = float(known) if isinstance(known, int | float) else None
    signal, rate = offered.read([channel])[channel], offered.sample_rate
    try:
        if not offered.windows:
            return sine_stretch(signal, rate, frequency)
        first, stop = (round(end * rate) for end in _ends(offered.windows[0]))
        sine = found_sine(signal[first:stop], rate, frequency)
    except ValueError as error:
        if offered.windows:
            part = f" in the window {offered.windows[0].name!r}"
            raise ValueError(f"{channel}{part}: {error}") from None
        raise ValueError(f"{channel}: {error}; {CHOOSE_SINE}") from None
    return FoundStretch(from_start(sine, first / rate), first, stop)


def _ends(window: Window) -> tuple[float, float]:
    return window.start, window.stop


def _steady(
    offered: Offered, found: FoundStretch, settle_cycles: int, settle_time: float
) -> tuple[float, float, int]:
    """Begin and end (s) of the whole cycles that are measured, and how many they are."""
    frequency = found.sine.frequency
    if offered.windows:
        first = offered.windows[0]
        return first.start, first.stop, round((first.stop - first.start) * frequency)
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
    offered: Offered,
    mode: Literal["rate", "torque"],
    excitation: str,
    window: str,
    settle_cycles: int,
    settle_time: float,
) -> TrialRequest:
    """A response to a sine of a channel. Raises ValueError where that is none."""
    found = _sine(offered, excitation)
    sine = found.sine
    start, stop, cycles = _steady(offered, found, settle_cycles, settle_time)
    return TrialRequest(
        Task(
            mode=mode,
            command=Sine(amplitude=sine.amplitude, frequency=sine.frequency, phase=sine.phase),
            duration=offered.duration,
            window=(start, stop),
            sample_rate=offered.sample_rate,
        ),
        point={"frequency": round(sine.frequency, 9)},
        note=f"a sine of {sine.frequency:.4g} Hz was found{_where(offered, found)}; "
        f"{cycles} cycles are measured",
        requires=(GYRO_RATE, excitation),
        windows=(Window(window, start, stop),),
    )


def _where(offered: Offered, found: FoundStretch) -> str:
    """From when until when a sine is in a recording, where that is not all of it."""
    whole = round(offered.duration * offered.sample_rate)
    if offered.windows or found.stop - found.first >= whole - 1:
        return ""
    first, stop = (each / offered.sample_rate for each in (found.first, found.stop))
    return f", from {first:.4g} to {stop:.4g} s"


def step_found(offered: Offered, names: tuple[str, str]) -> TrialRequest:
    """A step of the command; windows of these names before and after it. Raises ValueError."""
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
        windows=offered.windows or windows,
        options={
            "step": step.size,
            "ramp": step.ramp,
            "rest": step.at,
            "duration": offered.duration - step.at,
            "linear": False,
        },
    )


def hull_sine(offered: Offered, settle_cycles: int) -> TrialRequest:
    """A motion of the hull that is a sine. Raises ValueError where it is none."""
    found = _sine(offered, BASE_RATE)
    sine = found.sine
    start, stop, cycles = _steady(offered, found, settle_cycles, 0.0)
    omega = 2.0 * np.pi * sine.frequency
    acceleration = sine.amplitude * omega
    return TrialRequest(
        Task(
            mode="rate",
            # The rate's derivative: a quarter of a cycle before it.
            base_acceleration=Sine(
                amplitude=acceleration, frequency=sine.frequency, phase=sine.phase + 0.5 * math.pi
            ),
            duration=offered.duration,
            window=(start, stop),
            sample_rate=offered.sample_rate,
        ),
        note=f"the hull swings at {sine.frequency:.4g} Hz{_where(offered, found)}; "
        f"{cycles} cycles are measured",
        options={
            "frequency": round(sine.frequency, 6),
            "acceleration": acceleration,
            "cycles": cycles,
        },
    )
