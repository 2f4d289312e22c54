"""Detection of a sine, a step or a ramp in an unplanned recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array

EXPLAINED = 0.9
"""Least share of a signal's variance that a single sine explains."""
LEAST_CYCLES = 2.0
"""Fewest cycles of a sine in a recording for an estimate of its frequency."""
RAMP_PART = (0.2, 0.8)
"""Part of a ramp's height that is fitted by a line."""
NOISE = 5.0
"""Least size of a step, in standard deviations of the standstill before it."""
PLATEAU = 0.02
"""Share of its height within which a step has reached its level."""
CHOOSE = "where the recording holds several steps, start and stop choose one"
LEVEL_PART = 0.004
"""Least gain of a ramp in a twentieth of its time, as a share of its height; a level gains less."""
CYCLES_SEEN = 3.0
"""Fewest cycles in a recording for a search of the begin and end of a sine."""
LEAST_SHARE = 0.1
"""Least share of a recording for a sine with rest before and after."""
OUTSIDE = 0.2
"""Largest scatter of a signal at rest outside of the sine, over the sine's amplitude."""


@dataclass(frozen=True)
class FoundSine:
    """amplitude * sin(2 pi frequency t + phase); Hz, rad, t from the recording's start."""

    frequency: float
    amplitude: float
    phase: float


@dataclass(frozen=True)
class FoundStep:
    """Step from `before` to `after`, from time `at` (s) on, with the duration `ramp` (s)."""

    at: float
    ramp: float
    before: float
    after: float

    @property
    def size(self) -> float:
        return self.after - self.before


@dataclass(frozen=True)
class FoundRamp:
    """A line of `slope` (1/s) that leaves the first level at time `start` (s)."""

    start: float
    slope: float


def found_sine(signal: Array, sample_rate: float, frequency: float | None = None) -> FoundSine:
    """Sine of a whole signal, shape (n,).

    Args:
        frequency: (Hz); None: unknown.

    Raises ValueError for missing samples, a signal that is no sine, or too few cycles.
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
    return FoundSine(frequency, amplitude, float(np.arctan2(fit[1], fit[0])))


@dataclass(frozen=True)
class FoundStretch:
    """Sine and its samples, first <= i < stop; its phase is at sample 0."""

    sine: FoundSine
    first: int
    stop: int


def sine_stretch(signal: Array, sample_rate: float, frequency: float | None = None) -> FoundStretch:
    """Sine of a signal, shape (n,), with or without rest before and after it.

    Args:
        frequency: (Hz); None: unknown.

    Raises ValueError for a signal without a sine, or with a rest in between.
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
    """Sine of a stretch that begins at `start` (s), with its phase shifted to time zero."""
    phase = sine.phase - 2.0 * np.pi * sine.frequency * start
    return replace(sine, phase=float(np.angle(np.exp(1j * phase))))


def _where_it_swings(
    signal: Array, sample_rate: float, frequency: float | None
) -> tuple[int, int] | None:
    """First and stop of the only stretch with a sine.

    None where that is the whole signal, or where the rest of the signal is not at rest.
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
    # Amplitude over the cycle around each sample.
    turning = about * np.exp(-2j * np.pi * frequency * np.arange(len(signal)) / sample_rate)
    sums = np.concatenate([[0.0], np.cumsum(turning)])
    place = np.arange(len(signal))
    low = np.maximum(place - cycle // 2, 0)
    high = np.minimum(place - cycle // 2 + cycle, len(signal))
    envelope = 2.0 * np.abs(sums[high] - sums[low]) / (high - low)
    height = float(np.quantile(envelope, 1.0 - LEAST_SHARE))
    large = np.flatnonzero(envelope > 0.5 * height)
    if not len(large):
        return None
    first, stop = int(large[0]), int(large[-1]) + 1
    # At the ends of a recording half of the cycle is missing: a shorter part is no rest.
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
    """Frequency within `width` of `middle` (Hz) at which a sine explains most."""
    from scipy.optimize import minimize_scalar

    def left(offset: float) -> float:
        return -_sine_at(time, signal, middle + offset)[1]

    # The variable is an offset, because the resolution of the search is relative to it.
    fine = {"xatol": 1e-9 * width}
    result = minimize_scalar(left, bounds=(-width, width), method="bounded", options=fine)
    return middle + float(result.x)


def _sine_at(time: Array, signal: Array, frequency: float) -> tuple[Array, float]:
    """Sine and cosine parts and offset, and their share of the variance."""
    angle = 2.0 * np.pi * frequency * time
    columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones(len(time))])
    fit, *_ = np.linalg.lstsq(columns, signal, rcond=None)
    left = signal - columns @ fit
    about = signal - signal.mean()
    whole = float(about @ about)
    return fit, 1.0 - float(left @ left) / whole if whole > 0 else 0.0


def found_step(time: Array, signal: Array) -> FoundStep:
    """Only step of a signal between two levels.

    Raises ValueError for no step, several steps, or fewer than ten samples.
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
    reached = np.flatnonzero(gone[middle:] >= 1.0 - level)
    start = float(time[left[-1]]) if len(left) else float(time[0])
    end = float(time[middle + reached[0]]) if len(reached) else float(time[middle])
    step = float(np.median(np.diff(time)))
    # A jump lies between two samples: its time is that of the later one.
    ramp = end - start if end - start > 1.5 * step else 0.0
    return FoundStep(end if ramp == 0.0 else start, ramp, before, after)


def _stays_between(signal: Array, first: float, after: float) -> bool:
    """Whether a signal, shape (n,), stays at a level between two levels for some time."""
    gone = (signal - first) / (after - first)
    left, last = np.flatnonzero(gone <= 0.05), np.flatnonzero(gone >= 0.95)
    if not len(left) or not len(last):
        return False
    rise = gone[int(left[left < last[0]][-1]) + 1 : int(last[0])] if left[0] < last[0] else gone[:0]
    half = max(len(rise) // 20, 5)
    halves = rise[: len(rise) // half * half].reshape(-1, half)
    # For white noise; the median of the differences excludes the few steps.
    noise = float(np.median(np.abs(np.diff(gone)))) / (0.6745 * 2**0.5)
    if len(halves) < 2 or 3.0 * noise * (2.0 * 1.57 / half) ** 0.5 > LEVEL_PART:
        return False
    return bool((np.abs(np.diff(np.median(halves, axis=1))) < LEVEL_PART).any())


def found_ramp(time: Array, signal: Array, until: float) -> FoundRamp:
    """Ramp of a signal that ends at time `until` (s).

    Raises ValueError where the signal has no ramp from its first level to that time.
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
    return FoundRamp(max(start, float(time[0])), slope)
