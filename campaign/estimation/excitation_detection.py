"""Detection of a sine, a step or a ramp in an unplanned recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array

EXPLAINED = 0.9
"""Share of a signal's variance that a single sine must explain to be called one."""
LEAST_CYCLES = 2.0
"""cycles of a sine in a recording, for its frequency to be told."""
RAMP_PART = (0.2, 0.8)
"""Part of a ramp's height on which its line lies."""
NOISE = 5.0
"""Standard deviations of the standstill before it that a step is larger than."""
PLATEAU = 0.02
"""of its height, within which a step has arrived."""
CHOOSE = "where the recording holds several steps, start and stop choose one"
LEVEL_PART = 0.004
"""of its height that a ramp gains in a twentieth of its time, at least; a level gains less."""
CYCLES_SEEN = 3.0
"""cycles of a sine in a recording, at least, for where it begins and ends to be looked for."""
LEAST_SHARE = 0.1
"""of a recording that a sine which rests before and after must last."""
OUTSIDE = 0.2
"""of a sine's amplitude that a signal may scatter where the sine is not, to be at rest there."""


@dataclass(frozen=True)
class FoundSine:
    """offset + amplitude * sin(2 pi frequency t + phase); Hz, rad, t from the recording's start."""

    frequency: float
    amplitude: float
    phase: float
    offset: float
    explained: float


@dataclass(frozen=True)
class FoundStep:
    """From `before` to `after`, beginning at time `at` (s) and over after `ramp` (s)."""

    at: float
    ramp: float
    before: float
    after: float

    @property
    def size(self) -> float:
        return self.after - self.before


@dataclass(frozen=True)
class FoundRamp:
    """A line of `slope` (1/s) that leaves `level` at time `start` (s)."""

    start: float
    slope: float
    level: float


def found_sine(signal: Array, sample_rate: float, frequency: float | None = None) -> FoundSine:
    """The sine that a signal, shape (n,), is.

    Args:
        frequency: where it is known (Hz).

    Raises ValueError where it is none, or too short to tell.
    """
    if not np.isfinite(signal).all():
        raise ValueError("samples are missing in it")
    time = np.arange(len(signal)) / sample_rate
    if frequency is None:
        window = np.hanning(len(signal))
        spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * window))
        line = int(np.argmax(spectrum[1:])) + 1
        if line < LEAST_CYCLES:
            raise ValueError(f"it holds fewer than {LEAST_CYCLES:g} cycles of its strongest sine")
        width = sample_rate / len(signal)
        frequency = _best(time, signal, line * width, width)
    fit, explained = _sine_at(time, signal, frequency)
    if not explained >= EXPLAINED:
        raise ValueError(
            f"a sine of {frequency:.4g} Hz explains {100 * max(explained, 0.0):.0f} % of it"
        )
    amplitude = float(np.hypot(fit[0], fit[1]))
    phase = float(np.arctan2(fit[1], fit[0]))
    return FoundSine(frequency, amplitude, phase, float(fit[2]), explained)


@dataclass(frozen=True)
class FoundStretch:
    """A sine and the samples, first <= i < stop, in which it is; its phase is at sample 0."""

    sine: FoundSine
    first: int
    stop: int


def sine_stretch(signal: Array, sample_rate: float, frequency: float | None = None) -> FoundStretch:
    """The sine of a signal, shape (n,), that may rest before and after it.

    Args:
        frequency: where it is known (Hz).

    Raises ValueError where there is none, or it rests in between.
    """
    wrong, whole = "", None
    try:
        whole = found_sine(signal, sample_rate, frequency)
    except ValueError as error:
        wrong = str(error)
    run = _where_it_swings(signal, sample_rate, whole.frequency if whole else frequency)
    if run is None:
        if whole is None:
            raise ValueError(wrong)
        return FoundStretch(whole, 0, len(signal))
    first, stop = run
    try:
        part = found_sine(signal[first:stop], sample_rate, frequency)
    except ValueError:
        if whole is None:
            raise ValueError(wrong) from None
        return FoundStretch(whole, 0, len(signal))
    return FoundStretch(from_start(part, first / sample_rate), first, stop)


def from_start(sine: FoundSine, start: float) -> FoundSine:
    """A sine of a stretch that begins at `start` (s), with its phase at time zero."""
    phase = sine.phase - 2.0 * np.pi * sine.frequency * start
    return replace(sine, phase=float(np.angle(np.exp(1j * phase))))


def _where_it_swings(
    signal: Array, sample_rate: float, frequency: float | None
) -> tuple[int, int] | None:
    """First and stop of the one stretch in which a sine is; None where it is all of the signal,
    or where what is left of the signal is no rest.
    """
    if not np.isfinite(signal).all():
        return None
    about = signal - np.median(signal)
    if frequency is None:
        spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal))))
        frequency = float(np.argmax(spectrum[1:]) + 1) * sample_rate / len(signal)
    cycle = round(sample_rate / frequency)
    if cycle < 2 or len(signal) < CYCLES_SEEN * cycle:
        return None
    # Its amplitude over the cycle around each sample.
    turning = about * np.exp(-2j * np.pi * frequency * np.arange(len(signal)) / sample_rate)
    sums = np.concatenate([[0.0], np.cumsum(turning)])
    place = np.arange(len(signal))
    low = np.maximum(place - cycle // 2, 0)
    high = np.minimum(place - cycle // 2 + cycle, len(signal))
    envelope = 2.0 * np.abs(sums[high] - sums[low]) / (high - low)
    height = float(np.quantile(envelope, 1.0 - LEAST_SHARE))
    there = np.flatnonzero(envelope > 0.5 * height)
    if not len(there):
        return None
    first, stop = int(there[0]), int(there[-1]) + 1
    # At the ends of a recording half of the cycle is not seen: less than that is no rest.
    first, stop = (
        (0 if first <= cycle // 4 else first),
        (len(signal) if stop >= len(signal) - cycle // 4 else stop),
    )
    if (first, stop) == (0, len(signal)) or not (
        envelope[first + cycle : stop - cycle] > 0.5 * height
    ).all():
        return None
    rest = np.concatenate([about[: max(first - cycle, 0)], about[stop + cycle :]])
    if len(rest) and float(np.std(rest)) > OUTSIDE * height:
        return None
    return first, stop


def _best(time: Array, signal: Array, middle: float, width: float) -> float:
    """The frequency within `width` of `middle` (Hz) at which a sine explains most."""
    from scipy.optimize import minimize_scalar

    def left(offset: float) -> float:
        return -_sine_at(time, signal, middle + offset)[1]

    # Of an offset: the search resolves a share of what it varies.
    fine = {"xatol": 1e-9 * width}
    found = minimize_scalar(left, bounds=(-width, width), method="bounded", options=fine)
    return middle + float(found.x)


def _sine_at(time: Array, signal: Array, frequency: float) -> tuple[Array, float]:
    """Sine and cosine parts and offset, and the share of the variance that they explain."""
    angle = 2.0 * np.pi * frequency * time
    columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones(len(time))])
    fit, *_ = np.linalg.lstsq(columns, signal, rcond=None)
    left = signal - columns @ fit
    about = signal - signal.mean()
    whole = float(about @ about)
    return fit, 1.0 - float(left @ left) / whole if whole > 0 else 0.0


def found_step(time: Array, signal: Array) -> FoundStep:
    """The one step of a signal between two levels.

    Raises ValueError where it makes none, or several.
    """
    known = np.isfinite(signal)
    time, signal = time[known], signal[known]
    if len(signal) < 10:
        raise ValueError("it is too short for a step")
    fifth = max(2, len(signal) // 5)
    after = float(np.median(signal[-fifth:]))
    first = float(np.median(signal[: max(2, len(signal) // 100)]))
    half = 0.5 * (first + after)
    beyond = (signal > half) if after > first else (signal < half)
    if first == after or not beyond.any():
        raise ValueError(
            f"it ends at the level at which it began: there is no step in it; {CHOOSE}"
        )
    if _stays_between(signal, first, after):
        raise ValueError(f"it stays at a level between its first and its last: {CHOOSE}")
    middle = int(np.argmax(beyond))
    if not beyond[middle:].mean() > EXPLAINED:
        raise ValueError(f"it does not stay where it goes to: that is no step; {CHOOSE}")
    before = float(np.median(signal[: max(middle // 2, 1)]))
    size = after - before
    scatter = float(np.std(signal[: max(middle // 2, 1)]))
    if not abs(size) > NOISE * scatter:
        raise ValueError("it moves no further than it scatters: there is no step in it")
    gone = (signal - before) / size
    level = max(PLATEAU, NOISE * scatter / abs(size))
    left = np.flatnonzero(gone[: middle + 1] <= level)
    there = np.flatnonzero(gone[middle:] >= 1.0 - level)
    start = float(time[left[-1]]) if len(left) else float(time[0])
    end = float(time[middle + there[0]]) if len(there) else float(time[middle])
    step = float(np.median(np.diff(time)))
    # A jump is between two samples: the later one is the first that has it.
    ramp = end - start if end - start > 1.5 * step else 0.0
    return FoundStep(end if ramp == 0.0 else start, ramp, before, after)


def _stays_between(signal: Array, first: float, after: float) -> bool:
    """Whether a signal, shape (n,), on its way between two levels keeps to another for a while."""
    gone = (signal - first) / (after - first)
    left, there = np.flatnonzero(gone <= 0.05), np.flatnonzero(gone >= 0.95)
    if not len(left) or not len(there):
        return False
    way = (
        gone[int(left[left < there[0]][-1]) + 1 : int(there[0])] if left[0] < there[0] else gone[:0]
    )
    half = max(len(way) // 20, 5)
    halves = way[: len(way) // half * half].reshape(-1, half)
    # Of the noise: of white noise, whose differences the few steps do not show in their median.
    noise = float(np.median(np.abs(np.diff(gone)))) / (0.6745 * 2**0.5)
    if len(halves) < 2 or 3.0 * noise * (2.0 * 1.57 / half) ** 0.5 > LEVEL_PART:
        return False
    return bool((np.abs(np.diff(np.median(halves, axis=1))) < LEVEL_PART).any())


def found_ramp(time: Array, signal: Array, until: float) -> FoundRamp:
    """The ramp by which a signal reaches what it is at time `until` (s).

    Raises ValueError where it does not rise, or fall, to there from a standstill.
    """
    part = (time <= until) & np.isfinite(signal)
    time, signal = time[part], signal[part]
    if len(signal) < 10:
        raise ValueError("there is no ramp before the load slides")
    level = float(np.median(signal[: max(2, len(signal) // 50)]))
    height = float(np.median(signal[-max(2, len(signal) // 50) :])) - level
    if height == 0.0:
        raise ValueError("there is no ramp before the load slides")
    share = (signal - level) / height
    low, high = RAMP_PART
    reached = np.flatnonzero(share >= low)
    passed = np.flatnonzero(share >= high)
    if not len(reached) or not len(passed) or passed[0] - reached[0] < 5:
        raise ValueError("what comes before the load slides is a jump and no ramp")
    rising = slice(int(reached[0]), int(passed[0]) + 1)
    line = np.polynomial.Polynomial.fit(time[rising], signal[rising], 1).convert()
    slope = float(line.coef[1])
    start = float((level - line.coef[0]) / slope)
    return FoundRamp(max(start, float(time[0])), slope, level)
