"""Frequency response by stepped sine: closed or open loop, with each compensation (5.2.2, 5.3.4).

One trial per frequency. A sine of the rate command excites a closed loop, a sine of the torque an
open one. The load starts where its swing around the middle begins, so that it does not drift.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from campaign.channels import COMMAND, DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Estimate, Window
from campaign.estimation.frequency_response import Response, make_response
from campaign.estimation.intervals import with_error
from campaign.estimation.refinement import MOST as MOST_REFINED
from campaign.estimation.refinement import PHASE_SHARE, refinement
from campaign.estimation.servo import characteristics
from campaign.estimation.sine_point import SinePoint, sine_point
from campaign.experiments.frequency_response.figures import closed_loop_figures, torque_figure
from campaign.experiments.frequency_response.marks import place_names, servo_figure
from campaign.experiments.frequency_response.model.analysis import MODEL, identified
from campaign.experiments.frequency_response.tables import (
    Sweep,
    changes,
    closed_findings,
    closed_notes,
    closed_tables,
    falling_amplitude,
    method,
    modes,
    quality_note,
)
from campaign.experiments.interface import (
    Experiment,
    Stage,
    TestData,
    TrialData,
    bench_of,
    key,
    metrics,
)
from campaign.experiments.responses.signals import STEADY, steady_window
from campaign.experiments.shared import default_options
from campaign.experiments.shared.common import conditions, grouped, method_label, number_of, swept
from campaign.experiments.shared.detected_trials import sine_response
from campaign.experiments.shared.rig import Rig
from campaign.experiments.shared.swept_words import words
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate, inertia_of, limits_of
from campaign.physics.limits import worst_friction
from campaign.reason import Cause
from campaign.result import Figure, Finding, Result, Table
from campaign.signals import Sine
from campaign.trial import NONE_MORE, Most, OfferedRecording, Task, TrialRequest
from campaign.units import (
    Angle,
    AngularAcceleration,
    AngularRate,
    Frequency,
    Time,
    Torque,
    angle_text,
    rate_text,
    torque_text,
)

FREQUENCY = "frequency"
AT_HAND = Cause("describes the recording at hand", "it describes the recording at hand")
NYQUIST_SHARE = 0.4
"""Highest measurable frequency over the controller's sample rate."""
MOST_FREQUENCIES = 10_000
"""Most frequencies of a sweep."""


class FrequencyResponseOptions(Options):
    """Options of a frequency response test."""

    loop: Literal["closed", "open"] = "closed"
    """closed: from rate command to gyro rate; open: from drive torque to gyro rate."""
    compensation: str = "none"
    """Name of a compensation of the bench, or none."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """First frequency of the sweep."""
    highest: Frequency = Field(default=100.0, gt=0)
    """Last frequency of the sweep."""
    step: Frequency = Field(default=0.5, gt=0)
    """Step of the frequencies of the sweep."""
    frequencies: tuple[Frequency, ...] = ()
    """Your own frequencies instead of lowest, highest and step."""
    amplitude: AngularRate = Field(default=float(np.deg2rad(30.0)), gt=0)
    """Closed loop: amplitude of the rate command. Friction makes the response depend on it."""
    max_acceleration: AngularAcceleration | None = Field(default=None, gt=0)
    """Closed loop: largest commanded acceleration; the amplitude decreases with frequency for it.
    Absent: nine tenths of what the bench's limits of acceleration, torque and current allow."""
    torque: Torque = Field(default=60.0, gt=0)
    """Open loop: amplitude of the torque at the load, above breakaway. If friction differs by
    direction, the load drifts in the direction of lower friction."""
    cycles: int = Field(default=16, ge=1, le=10_000)
    """Whole cycles to measure at each frequency."""
    settle_cycles: int = Field(default=3, ge=0, le=1_000)
    """Fewest whole cycles before them, for the transient to decay."""
    settle_time: Time = Field(default=0.3, ge=0)
    """Shortest time of these cycles."""
    samples_per_cycle: int = Field(default=20, ge=8, le=10_000)
    """Samples per cycle of the recording, at most those of a sampled controller."""
    position: Angle = 0.0
    """Angle of the load relative to the hull around which it swings."""
    refine: bool = False
    """Closed loop: measure more frequencies after the sweep, around the crossings of -3 dB and 0
    dB, and around a phase crossover within the sweep."""

    def without_effect(self) -> frozenset[str]:
        swept = {"lowest", "highest", "step"} if self.frequencies else set()
        closed = {"amplitude", "max_acceleration", "refine"}
        return frozenset(swept | ({"torque"} if self.loop == "closed" else closed))


def swept_frequencies(options: FrequencyResponseOptions) -> tuple[float, ...]:
    """Frequencies (Hz), rising. Raises ValueError for an empty or endless sweep."""
    if options.frequencies:
        if min(options.frequencies) <= 0:
            raise ValueError("frequencies must be greater than zero")
        return tuple(sorted(set(options.frequencies)))
    if options.highest < options.lowest:
        raise ValueError("highest must not be below lowest")
    count = math.floor((options.highest - options.lowest) / options.step + 1e-9) + 1
    if count > MOST_FREQUENCIES:
        raise ValueError(f"a sweep of {count} frequencies; at most {MOST_FREQUENCIES} are allowed")
    return tuple(round(options.lowest + k * options.step, 9) for k in range(count))


def _trials(options: FrequencyResponseOptions, bench: Bench) -> Iterator[TrialRequest]:
    for frequency in swept_frequencies(options):
        yield _request(options, bench, frequency)


def _request(options: FrequencyResponseOptions, bench: Bench, frequency: float) -> TrialRequest:
    """Trial at one frequency (Hz). Raises ValueError if it is beyond the bench's limits."""
    rate = _sample_rate(options, bench, frequency)
    settle = max(options.settle_cycles, math.ceil(options.settle_time * frequency - 1e-9))
    start, stop = settle / frequency, (settle + options.cycles) / frequency
    closed = options.loop == "closed"
    if closed:
        command, swing = rate_sine(bench, frequency, options.amplitude, options.max_acceleration)
        size = rate_text(command.amplitude)
    else:
        command, swing = torque_sine(bench, frequency, options.torque, options.position)
        size = torque_text(command.amplitude)
    return TrialRequest(
        Task(
            mode="rate" if closed else "torque",
            command=command,
            compensation=options.compensation,
            duration=stop,
            window=(start, stop),
            sample_rate=rate,
            start_angle=options.position - swing,
        ),
        point={FREQUENCY: frequency},
        note=f"{options.cycles} cycles after {settle} to settle; amplitude {size}",
        requires=(GYRO_RATE, _excitation("rate" if closed else "torque")),
        windows=(Window(STEADY, start, stop),),
    )


def _found(
    options: FrequencyResponseOptions, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """Request of the sine in a recording of one frequency."""
    mode: Literal["rate", "torque"] = "rate" if options.loop == "closed" else "torque"
    times = options.settle_cycles, options.settle_time
    yield sine_response(offered, mode, _excitation(mode), STEADY, *times)


def _refined_range(options: FrequencyResponseOptions, bench: Bench) -> tuple[float, float]:
    """Lowest and highest frequency (Hz) of a refinement: a little more than the sweep, as far as
    the controller's sample rate shows them.
    """
    swept, control = swept_frequencies(options), control_rate(bench)
    highest = swept[-1] * (1.0 + PHASE_SHARE)
    seen = highest if control is None else NYQUIST_SHARE * control
    return swept[0] * (1.0 - PHASE_SHARE), min(highest, seen)


def _most_refined(options: FrequencyResponseOptions, bench: Bench) -> Most:
    """Upper limit of a refinement: all of its trials at its lowest frequency."""
    if not options.refine or options.loop != "closed":
        return NONE_MORE
    lowest, highest = _refined_range(options, bench)
    settle = max(float(options.settle_cycles), options.settle_time * highest + 1.0)
    longest = max(options.settle_cycles / lowest, options.settle_time + 1.0 / lowest)
    # A whole share of the controller's rate is less than twice the requested rate.
    samples = 2 * options.samples_per_cycle * math.ceil(settle + options.cycles)
    duration = longest + options.cycles / lowest
    return Most(MOST_REFINED, MOST_REFINED * duration, MOST_REFINED * samples)


def _refined(
    options: FrequencyResponseOptions, bench: Bench, data: TestData
) -> Iterator[TrialRequest]:
    """Requests at the frequencies of `refinement` in the sweep that the bench can show."""
    points = []
    for item in data.completed():
        with suppress(ValueError):  # the analysis reports it
            points.append(_point(item))
    if not points:
        return
    lowest, highest = _refined_range(options, bench)
    for frequency in refinement(make_response(points)):
        if lowest <= frequency <= highest:
            request = _request(options, bench, round(float(frequency), 9))
            yield replace(request, note=f"refinement; {request.note}")


def _excitation(mode: str) -> str:
    """Channel of the excitation, to which the gyro's rate responds."""
    return COMMAND if mode == "rate" else DRIVE_TORQUE


def _sample_rate(options: FrequencyResponseOptions, bench: Bench, frequency: float) -> float:
    """Sample rate (Hz) of `samples_per_cycle`, or a whole share of the controller's rate."""
    control = control_rate(bench)
    if control is None:
        return options.samples_per_cycle * frequency
    if frequency > NYQUIST_SHARE * control:
        raise ValueError(
            f"{frequency:g} Hz is above {NYQUIST_SHARE:g} of the controller's sample rate "
            f"({control:g} Hz); lower the highest frequency"
        )
    return control / max(1, math.floor(control / (options.samples_per_cycle * frequency)))


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Response to one sine: its real and imaginary part, and the coherence."""
    task, window = data.trial.task, steady_window(data.trial)
    frequency = number_of(data.trial, FREQUENCY)
    recording = data.recording().window(window.start, window.stop)
    drive = recording[_excitation(task.mode)]
    point = sine_point(recording.time, drive, recording[GYRO_RATE], frequency)
    unit = "" if task.mode == "rate" else TORQUE_TO_RATE
    method = "least squares over whole cycles"
    parts = (("response_real", point.response.real), ("response_imag", point.response.imag))
    return (
        *(with_error(name, part, unit, point.error, math.inf, method) for name, part in parts),
        Estimate("coherence", point.coherence, "", reason=AT_HAND()),
    )


COUNTS = 3.0
"""Least response in counts of its sensor: a staircase of fewer is off by more than 3 %."""
TORQUE_TO_RATE = "rad/s/(N m)"


def _point(data: TrialData) -> SinePoint:
    """Sine of a trial, from its metrics. Raises ValueError if there is none."""
    values = metrics(data, _measure)
    real, imaginary = values["response_real"], values["response_imag"]
    if not math.isfinite(real.value + imaginary.value):
        raise ValueError("its signals have no numbers")
    task, frequency = data.trial.task, number_of(data.trial, FREQUENCY)
    response = complex(real.value, imaginary.value)
    if isinstance(task.command, Sine) and not data.trial.recording:
        count = Rig(bench_of(data.trial)).rate_count(2.0 * math.pi * frequency)
        if not abs(response) * task.command.amplitude > COUNTS * count:
            raise ValueError(f"its response is below {COUNTS:g} counts of the rate's sensor")
    error = real.standard_error or 0.0
    return SinePoint(frequency, response, error, values["coherence"].value)


def _analyse(data: TestData) -> Result:
    if data.model is not None:
        return identified(data)
    notes: list[str] = []
    paths = [path for path in swept(data, own=(FREQUENCY,)) if path != "loop"]
    sweeps: list[Sweep] = []
    for group in grouped(data.completed(), own=(FREQUENCY,)).values():
        points = []
        for item in group:
            try:
                points.append(_point(item))
            except ValueError as error:
                notes.append(f"{item.trial.label}: {error}.")
        notes += falling_amplitude(group)
        if points:
            sweeps.append(_sweep(group[0], make_response(points), paths))
    closed = [sweep for sweep in sweeps if sweep.loop == "closed"]
    opened = [sweep for sweep in sweeps if sweep.loop == "open"]
    tables: list[Table] = []
    figures: list[Figure] = []
    findings: list[Finding] = []
    if closed:
        tables += closed_tables(closed, paths)
        shown = [(s.label, method(s), s.response) for s in closed]
        figures += servo_figure(closed)
        figures += closed_loop_figures(shown, [s.found for s in closed], place_names(closed))
        findings += [finding for sweep in closed for finding in closed_findings(sweep)]
        findings += changes(closed)
        notes += closed_notes(closed)
    if opened:
        table, peaks, absent = modes(opened, paths)
        tables.append(table)
        findings += peaks
        notes += absent
        figures.append(torque_figure([(s.label, method(s), s.response) for s in opened], peaks))
    notes += quality_note(sweeps)
    return Result(tuple(tables), tuple(figures), tuple(findings), tuple(notes))


def _sweep(first: TrialData, response: Response, paths: list[str]) -> Sweep:
    place = conditions(first, "compensation", "loop")
    place.pop(FREQUENCY, None)
    loop = "closed" if first.trial.task.mode == "rate" else "open"
    label = method_label(str(place["compensation"]))
    swept = {path: place.get(path) for path in paths if path != "compensation"}
    others = words(swept, first.trial)
    servo = characteristics(response) if loop == "closed" else None
    return Sweep(place, loop, ", ".join([label, *others]), response, servo)


LIMIT_SHARE = 0.9
"""Share of the bench's limits that a rate command's amplitude may use."""


def rate_sine(
    bench: Bench, frequency: float, largest: float, acceleration: float | None
) -> tuple[Sine, float]:
    """Rate command and half its angle of swing (rad); it starts at rest.

    Its amplitude is `largest` (rad/s), or less for `acceleration` (rad/s^2); None: for the bench's
    limits. Raises ValueError if these do not overcome the bench's friction.
    """
    rig, omega = Rig(bench), 2.0 * math.pi * frequency
    if acceleration is None:
        torque = rig.torque - worst_friction(bench, largest)
        if torque <= 0:
            raise ValueError("the bench's torque and current limits do not overcome its friction")
        acceleration = LIMIT_SHARE * min(rig.limits.acceleration, rig.accelerated_by(torque))
    amplitude = min(largest, acceleration / omega)
    return Sine(amplitude=amplitude, frequency=frequency), amplitude / omega


def torque_sine(
    bench: Bench, frequency: float, torque: float, position: float
) -> tuple[Sine, float]:
    """Torque and half the angle (rad) that a load without friction would swing.

    Around `position` (rad), with amplitude `torque` (N m). It starts at its peak: a free load's
    rate then has no offset, and its angle no drift. Raises ValueError beyond the bench's limits.
    """
    omega = 2.0 * math.pi * frequency
    limits = limits_of(bench)
    rate = torque / (inertia_of(bench, "the swing of a free load") * omega)
    swing = rate / omega
    if abs(position) + swing > limits.angle or rate > limits.rate:
        raise ValueError(
            f"{torque_text(torque, 'g')} at {frequency:g} Hz would swing a load without friction "
            f"by {angle_text(swing)} at {rate_text(rate)}, beyond the bench's limits; lower torque "
            "or raise lowest"
        )
    return Sine(amplitude=torque, frequency=frequency, phase=0.5 * math.pi), swing


EXPERIMENT = Experiment(
    name="frequency_response",
    summary="stepped-sine response, bandwidth and margins (Tables 5.3 and 5.9, Figure 4.5)",
    options=FrequencyResponseOptions,
    trials=_trials,
    analyse=_analyse,
    measure=_measure,
    needs_samples=False,
    fit=default_options.frequency_response,
    recorded=_found,
    windows=(STEADY,),
    requires={
        GYRO_RATE: "the response",
        COMMAND: "what a closed loop responds to",
        DRIVE_TORQUE: "what an open loop responds to",
    },
    stages=(
        Stage(
            name="refinement",
            why="bandwidth and margins are read between frequencies: more of them around "
            "each crossing",
            most=_most_refined,
            trials=_refined,
        ),
    ),
    model=MODEL,
    key_numbers=(
        key("bandwidth"),
        key("phase_margin"),
        key("gain_margin"),
        key("elastic_mode_frequency"),
    ),
)
