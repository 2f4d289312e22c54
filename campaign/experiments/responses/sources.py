"""Responses of trials of one kind: sines, repeated multisines, other recordings."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from campaign.arrays import Array
from campaign.axis_kind import axis_unit
from campaign.estimation.frequency.best_linear import BestLinear, best_linear
from campaign.estimation.frequency.measured_response import MeasuredResponse, closed_from_open
from campaign.estimation.frequency.multisine import Lines
from campaign.estimation.frequency.two_mass_model import Side
from campaign.estimation.frequency.welch import Excited as Excitation
from campaign.estimation.frequency.welch import Record, welch_response
from campaign.estimation.frequency_response import Response, make_response
from campaign.estimation.local_fit import FRICTION
from campaign.estimation.sine_point import SinePoint, sine_point
from campaign.experiments.interface import TrialData
from campaign.experiments.responses.signals import (
    ResponseOptions,
    Signals,
    base_frequency,
    by_amplitude,
    repeated,
    signals,
    size_of,
    steady_window,
    unused,
    whole_stretches,
)
from campaign.physics.bench import Bench
from campaign.signals import MultiSine, Sine
from campaign.text import pretty_unit
from campaign.units import rate_text, torque_text

FEWEST_SINES = 6
"""Fewest frequencies of a response from single sines."""
GAP = 3.0
"""Ratio of neighbours in size above which the smaller line is not an excited one."""
HANN_APART = 2
"""Distance of lines of a Hann window that are nearly uncorrelated."""
EXCITED_SHARE = 0.03
"""Share of the largest line of a reference (amplitude) above which a line counts as excited."""
SIZES = ("amplitude", "rms")
"""Conditions that state the amplitude of a multisine; the amplitude is measured instead."""


@dataclass(frozen=True)
class Source:
    """Responses of one measurement by side, with their excitation.

    Attributes:
        name: for display.
        kind: `sines`, `multisine` or `records`.
        excitation: text; a best linear approximation holds for this excitation only.
        trials: numbers.
        responses: torque to rate at the load, by side of the sensor.
        closed: command to rate of a closed rate loop, where there is one.
        best: best linear approximations from repeated multisines, by side.
        every: a fit uses one of so many points; neighbours are correlated.
        remarks: sentences on what is not determined, and why.
    """

    name: str
    kind: str
    excitation: str
    trials: tuple[int, ...]
    responses: Mapping[Side, MeasuredResponse]
    closed: Response | None = None
    best: Mapping[Side, BestLinear] = field(default_factory=dict)
    every: int = 1
    remarks: tuple[str, ...] = ()

    @property
    def rms(self) -> float:
        """Rms of the torque of repeated multisines (N m); zero for other kinds."""
        return max((each.excitation.rms for each in self.best.values()), default=0.0)


def sources(
    trials: Sequence[TrialData], bench: Bench, how: ResponseOptions
) -> tuple[list[Source], list[str]]:
    """All responses of the trials, and sentences on trials without one."""
    groups: dict[tuple[str, ...], list[TrialData]] = {}
    for trial in trials:
        groups.setdefault(_key(trial, how), []).append(trial)
    responses, remarks = [], list(unused(trials, bench))
    refused: dict[str, list[str]] = {}
    for (kind, *_, period), group in groups.items():
        make = {"sines": _of_sines, "multisine": _of_multisine, "records": _of_records}[kind]
        label = _label(group)
        try:
            recorded, lost = _all_signals(group, bench, how)
        except ValueError as error:
            refused.setdefault(str(error), []).append(label)
            continue
        remarks += lost
        parts = {label: recorded}
        if kind == "multisine":
            sized = [
                (size_of(part[0], float(period)), part)
                for part in by_amplitude(recorded, float(period))
            ]
            parts = {f"{label}, {size}": part for size, part in sized}
            if len(sized) > 1:
                sizes = ", ".join(f"{size} ({len(part)} trials)" for size, part in sized)
                remarks.append(f"{label}: grouped by the recorded rms of the excitation: {sizes}.")
        for name, part in parts.items():
            try:
                responses.append(make(name, part, how))
            except ValueError as error:
                remarks.append(f"{name}: {error}.")
    remarks += [
        f"{'; '.join(dict.fromkeys(labels))}: {error}." for error, labels in refused.items()
    ]
    return _named_apart(responses), remarks


def _named_apart(found: Sequence[Source]) -> list[Source]:
    """Add trial numbers to equal names: a matrix may sweep values that are in no name."""
    names = [each.name for each in found]
    return [
        replace(each, name=f"{each.name}, trials {each.trials[0]} to {each.trials[-1]}")
        if names.count(each.name) > 1
        else each
        for each in found
    ]


def _key(trial: TrialData, how: ResponseOptions) -> tuple[str, ...]:
    """Key of a trial; trials of the same key are one measurement."""
    task, command = trial.trial.task, trial.trial.task.command
    own = {"frequency", "seed", "realisation", "realization"}
    point = {k: v for k, v in trial.trial.point.items() if k.rsplit(".", 1)[-1] not in own}

    def common(but: Collection[str] = ()) -> tuple[str, ...]:
        stated = [f"{k}={v}" for k, v in point.items() if k.rsplit(".", 1)[-1] not in but]
        return (trial.trial.test, task.mode, task.compensation, *stated)

    if isinstance(command, Sine) and task.mode in ("rate", "torque"):
        return ("sines", *common())
    if isinstance(command, MultiSine) and task.mode in ("rate", "torque"):
        period = _period(command, task.duration)
        if period is not None:
            lines = ",".join(f"{each * period:.0f}" for each in command.frequencies)
            return ("multisine", *common(SIZES), lines, f"{period:.9g}")
    recorded_period = how.period if how.period is not None else repeated(trial, how.excited)
    if recorded_period is not None and task.duration >= recorded_period:
        return ("multisine", *common(SIZES), f"{recorded_period:.9g}")
    return ("records", *common())


def _period(command: MultiSine, duration: float) -> float | None:
    """Period (s) of a multisine that lasts for one period or more; None for any other."""
    base = base_frequency(command.frequencies)
    return 1.0 / base if base > 0 and duration * base > 1.0 - 1e-6 else None


def _label(group: Sequence[TrialData]) -> str:
    first = group[0].trial
    parts = [first.test]
    if first.task.mode != "recorded":
        parts.append(first.task.mode)
    if first.task.compensation != "none":
        parts.append(first.task.compensation)
    return ", ".join(parts)


def _all_signals(
    group: Sequence[TrialData], bench: Bench, how: ResponseOptions
) -> tuple[list[Signals], list[str]]:
    recorded, refused = [], []
    for trial in group:
        try:
            recorded.append(signals(trial, bench, how.excited))
        except ValueError as error:
            refused.append((trial.trial.label, error))
    if not recorded:
        raise refused[0][1]
    return recorded, sorted({f"{label}: {error}." for label, error in refused})


def _as_rates(measured: MeasuredResponse, told: Signals, side: Side) -> MeasuredResponse:
    """Response of the rate: that of an angle times 2 pi i f."""
    if not told.is_angle(side):
        return measured
    return measured.times(np.asarray(2j * np.pi * measured.frequency))


def _of_sines(name: str, trials: Sequence[Signals], _: ResponseOptions) -> Source:
    remarks: list[str] = []
    points: dict[Side, list[SinePoint]] = {side: [] for side in trials[0].answers}
    loop = []
    for signal in trials:
        task = signal.data.trial.task
        command = task.command
        if not isinstance(command, Sine):
            continue
        cut = _steady(signal)
        frequency, time = command.frequency, signal.time[cut]
        try:
            for side in points:
                if side in signal.answers:
                    answer = signal.answers[side][cut]
                    points[side].append(sine_point(time, signal.torque[cut], answer, frequency))
            if task.mode == "rate" and signal.reference is not None and "load" in signal.answers:
                answer = signal.answers["load"][cut]
                loop.append(sine_point(time, signal.reference[cut], answer, frequency))
        except ValueError as error:
            remarks.append(f"{signal.data.trial.label}: {error}.")
    responses = {
        side: _as_rates(MeasuredResponse.of(make_response(each)), trials[0], side)
        for side, each in points.items()
        if len({point.frequency for point in each}) >= FEWEST_SINES
    }
    if not responses:
        raise ValueError(f"fewer than {FEWEST_SINES} frequencies are no response")
    first = next(iter(responses.values())).frequency
    closed = None
    if len(loop) >= FEWEST_SINES and not trials[0].is_angle("load"):
        closed = make_response(loop)
    commands = [each.data.trial.task.command for each in trials]
    amplitude = max(abs(each.amplitude) for each in commands)  # type: ignore[union-attr]
    in_rate = trials[0].data.trial.task.mode == "rate"
    largest = rate_text(amplitude) if in_rate else torque_text(amplitude, ".4g")
    excitation = (
        f"{len(first)} single sines from {first[0]:.4g} to {first[-1]:.4g} Hz, "
        f"amplitude up to {largest}"
    )
    numbers = tuple(each.data.trial.number for each in trials)
    return Source(name, "sines", excitation, numbers, responses, closed, remarks=tuple(remarks))


def _steady(signal: Signals) -> slice:
    """Samples of the measured window."""
    window, time = steady_window(signal.data.trial), signal.time
    half = 0.5 * (time[1] - time[0])
    first, last = np.searchsorted(time, (window.start - half, window.stop - half))
    return slice(int(first), int(last))


def _of_multisine(name: str, trials: Sequence[Signals], how: ResponseOptions) -> Source:
    remarks: list[str] = []
    rate, first_trial = trials[0].rate, trials[0].data
    period = _period_of(first_trial, how)
    if how.period is None and not isinstance(first_trial.trial.task.command, MultiSine):
        remarks.append(
            f"What excites repeats every {period:.6g} s and has many lines: it is taken for a "
            "multisine of that period. `frequency_response.period` says it otherwise."
        )
    samples = round(period * rate)
    if abs(samples - period * rate) > 1e-3:
        raise ValueError(f"its period of {period:.6g} s is no whole number of samples")
    kept, numbers = [], []
    windows = [_steady(signal) for signal in trials]
    periods = min((window.stop - window.start) // samples for window in windows)
    for signal, window in zip(trials, windows, strict=True):
        trial = signal.data.trial
        parts = [signal.torque, *signal.answers.values()]
        if signal.reference is not None:
            parts.append(signal.reference)
        # The last whole periods leave most time for a transient.
        tail = slice(window.stop - periods * samples, window.stop)
        if periods < 1 or not all(np.all(np.isfinite(part[tail])) for part in parts):
            remarks.append(f"{trial.label}: a period has lost samples; it is left out.")
            continue
        kept.append((signal, tail))
        numbers.append(trial.number)
    if not kept:
        raise ValueError("no whole period without a lost sample")
    with_reference = all(signal.reference is not None for signal, _ in kept)
    reference = _stacked([(s.reference, t) for s, t in kept]) if with_reference else None
    torque = _stacked([(s.torque, t) for s, t in kept])
    lines = _lines(first_trial, period, torque if reference is None else reference, periods)
    acts_on: Excitation = "reference" if reference is not None else "input"
    best: dict[Side, BestLinear] = {}
    responses: dict[Side, MeasuredResponse] = {}
    for side in kept[0][0].answers:
        answer = _stacked([(s.answers[side], t) for s, t in kept])
        linear = best_linear(torque, answer, rate, periods, lines, acts_on, reference)
        best[side], responses[side] = linear, _as_rates(linear.response, kept[0][0], side)
    closed = None
    if first_trial.trial.task.mode == "rate" and reference is not None:
        closed = _loop_of(kept, reference, rate, periods, lines)
    first = next(iter(best.values()))
    remarks += first.undetermined
    return Source(
        name,
        "multisine",
        _named(first, first_trial),
        tuple(numbers),
        responses,
        closed,
        best,
        remarks=tuple(remarks),
    )


def _named(best: BestLinear, trial: TrialData) -> str:
    """Text of the excitation; for a rate loop also the rms of its command."""
    torque = str(replace(best.excitation, unit=pretty_unit(axis_unit("N m"))))
    command = trial.trial.task.command
    if trial.trial.task.mode != "rate" or not isinstance(command, MultiSine):
        return torque
    rms = float(np.sqrt(0.5 * np.sum(np.square(command.amplitudes))))
    return f"{torque}, of a rate of rms {rate_text(rms)} that was asked for"


def _loop_of(
    kept: Sequence[tuple[Signals, slice]],
    reference: Array,
    rate: float,
    periods: int,
    lines: Lines,
) -> Response | None:
    signal = kept[0][0]
    if "load" not in signal.answers or signal.is_angle("load"):
        return None
    answer = _stacked([(s.answers["load"], t) for s, t in kept])
    error = reference - answer
    loop = best_linear(error, answer, rate, periods, lines, "reference", reference).response
    return closed_from_open(loop).response


def _stacked(parts: Sequence[tuple[Array | None, slice]]) -> Array:
    return np.stack([part[cut] for part, cut in parts if part is not None])


def _period_of(trial: TrialData, how: ResponseOptions) -> float:
    task = trial.trial.task
    commanded = (
        _period(task.command, task.duration) if isinstance(task.command, MultiSine) else None
    )
    return commanded or how.period or repeated(trial, how.excited) or task.duration


def _lines(trial: TrialData, period: float, leading: Array, periods: int) -> Lines:
    """Excited lines: those of the command, else the largest lines of the excited signal.

    The widest gap in size is their lower limit: lines from distortion of a drive, or from a loop,
    may reach a tenth of the command.
    """
    command = trial.trial.task.command
    if isinstance(command, MultiSine):
        return np.sort(np.round(np.array(command.frequencies) * period).astype(np.int64))
    size = np.mean(np.abs(np.fft.rfft(leading, axis=1))[:, ::periods], axis=0)
    size[0] = 0.0
    falling = np.sort(size[size > EXCITED_SHARE * np.max(size)])[::-1]
    steps = falling[:-1] / falling[1:]
    least = EXCITED_SHARE * np.max(size)
    if len(steps) and np.max(steps) > GAP:
        least = math.sqrt(float(np.prod(falling[np.argmax(steps) :][:2])))
    return np.flatnonzero(size > least).astype(np.int64)


def _of_records(name: str, trials: Sequence[Signals], how: ResponseOptions) -> Source:
    rates = {round(signal.rate, 6) for signal in trials}
    if len(rates) > 1:
        raise ValueError("its trials were sampled at different rates")
    rate, mode = trials[0].rate, trials[0].data.trial.task.mode
    segment = None if how.resolution is None else round(rate / how.resolution)
    excited: Excitation = "input" if mode == "torque" else "reference"
    if how.excited != "auto":
        excited = how.excited
    responses: dict[Side, MeasuredResponse] = {}
    for side in trials[0].answers:
        records = _records(trials, side, segment or 64, None)
        measured = welch_response(records, excited, how.estimator, segment)
        responses[side] = _as_rates(_coherent(measured), trials[0], side)
    closed = None
    if mode == "rate" and not trials[0].is_angle("load"):
        records = _records(trials, "load", segment or 64, "error")
        loop = _coherent(welch_response(records, "reference", segment=segment))
        closed = closed_from_open(loop.at(slice(None, None, HANN_APART))).response
    first = next(iter(responses.values()))
    if len(first.frequency) < FEWEST_SINES:
        raise ValueError("hardly a frequency is coherent: the recording excites nothing")
    numbers = tuple(each.data.trial.number for each in trials)
    excitation = f"whatever {len(trials)} trials moved by; {first.method}"
    return Source(name, "records", excitation, numbers, responses, closed, every=HANN_APART)


def _records(
    trials: Sequence[Signals], side: Side, shortest: int, what: str | None
) -> list[Record]:
    """Segments without a lost sample; `what`: `error` takes reference less output as the input."""
    records = []
    for signal in trials:
        if side not in signal.answers:
            continue
        answer, reference, input_ = signal.answers[side], signal.reference, signal.torque
        if what == "error" and reference is not None:
            input_ = reference - answer
        parts = [input_, answer] + ([] if reference is None else [reference])
        for cut in whole_stretches(parts, shortest):
            inner = None if reference is None else reference[cut]
            records.append(Record(round(signal.rate, 6), input_[cut], answer[cut], inner))
    if not records:
        raise ValueError("no stretch without a lost sample is long enough")
    return records


def _coherent(found: MeasuredResponse) -> MeasuredResponse:
    """Points whose error is below a fifth of their size."""
    return found.at(found.error < 0.2 * np.abs(found.values))


def fitted_part(source: Source, side: Side, lowest: float, highest: float) -> MeasuredResponse:
    """Points for a fit: within the band, one of `every`; sines with added scatter by friction."""
    measured = source.responses[side].between(lowest, highest).at(slice(None, None, source.every))
    if source.kind != "sines":
        return measured
    scatter = 2.0 * (FRICTION * np.abs(measured.values)) ** 2
    return replace(measured, variance=measured.variance + scatter)
