"""Frequency response by stepped sine: closed or open loop, with each compensation (5.2.2, 5.3.4).

One trial per frequency. A closed loop is driven by a sine of the rate command, an open one by a
sine of the torque. The load starts where a swing around the middle begins, so that neither drifts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from campaign.experiments.common import conditions, failures_note, grouped, method_label, swept
from campaign.experiments.frequency_response_figures import closed_loop_figures, torque_figure
from campaign.experiments.interface import Experiment, TestData, TrialData
from campaign.identification.elastic_mode import elastic_mode
from campaign.identification.frequency_response import (
    Response,
    ServoCharacteristics,
    SinePoint,
    characteristics,
    make_response,
    sine_point,
)
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.limits import worst_friction
from campaign.result import Column, Figure, Finding, Result, Table, Value
from campaign.signals import Sine
from campaign.trial import Task, TrialRequest
from campaign.units import Angle, AngularAcceleration, AngularRate, Frequency, Time, Torque

LIMIT_SHARE = 0.9
"""of the bench's limits that the amplitude of a rate command may use."""
NYQUIST_SHARE = 0.4
"""of the controller's sample rate: the highest frequency that can be told."""
MOST_FREQUENCIES = 10_000


class FrequencyResponseOptions(Options):
    """Options of a frequency response test."""

    loop: Literal["closed", "open"] = "closed"
    """closed: from rate command to gyro rate; open: from drive torque to gyro rate."""
    compensation: str = "none"
    """Compensation method, by its name on the bench; none for none."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """First frequency of the sweep."""
    highest: Frequency = Field(default=100.0, gt=0)
    """Last frequency of the sweep."""
    step: Frequency = Field(default=0.5, gt=0)
    """Between the frequencies of the sweep."""
    frequencies: tuple[Frequency, ...] = ()
    """Frequencies of your own instead of lowest, highest and step."""
    amplitude: AngularRate = Field(default=float(np.deg2rad(30.0)), gt=0)
    """Closed loop: amplitude of the rate command. Friction makes the response depend on it."""
    max_acceleration: AngularAcceleration | None = Field(default=None, gt=0)
    """Closed loop: the amplitude falls with frequency so that the command does not exceed this;
    absent: nine tenths of what the bench's limits of acceleration, torque and current allow."""
    torque: Torque = Field(default=60.0, gt=0)
    """Open loop: amplitude of the torque at the load; above the breakaway torque. Friction that
    differs by direction lets the load creep towards the easier one while it swings."""
    cycles: int = Field(default=16, ge=1, le=10_000)
    """Whole cycles that are measured at each frequency."""
    settle_cycles: int = Field(default=3, ge=0, le=1_000)
    """Whole cycles before them, at least, for the transient to pass ..."""
    settle_time: Time = Field(default=0.3, ge=0)
    """... and as many more as last this long."""
    samples_per_cycle: int = Field(default=20, ge=8, le=10_000)
    """of the recording, as far as a sampled controller has them."""
    position: Angle = 0.0
    """Angle of the load relative to the hull around which it swings."""


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
        rate = _sample_rate(options, bench, frequency)
        settle = max(options.settle_cycles, math.ceil(options.settle_time * frequency - 1e-9))
        start, stop = settle / frequency, (settle + options.cycles) / frequency
        closed = options.loop == "closed"
        command, swing = (_rate_sine if closed else _torque_sine)(options, bench, frequency)
        yield TrialRequest(
            Task(
                mode="rate" if closed else "torque",
                command=command,
                compensation=options.compensation,
                duration=stop,
                window=(start, stop),
                sample_rate=rate,
                start_angle=options.position - swing,
            ),
            point={"frequency": frequency},
            note=f"{options.cycles} cycles after {settle} to settle; {_amplitude(command, closed)}",
        )


def _amplitude(command: Sine, closed: bool) -> str:
    if closed:
        return f"amplitude {np.rad2deg(command.amplitude):.3g} deg/s"
    return f"amplitude {command.amplitude:.3g} N m"


def _sample_rate(options: FrequencyResponseOptions, bench: Bench, frequency: float) -> float:
    """Of the recording (Hz): `samples_per_cycle`, or a whole share of the controller's rate."""
    control = bench.controller.sample_rate
    if control is None:
        return options.samples_per_cycle * frequency
    if frequency > NYQUIST_SHARE * control:
        raise ValueError(
            f"{frequency:g} Hz is above {NYQUIST_SHARE:g} of the controller's sample rate "
            f"({control:g} Hz); lower the highest frequency"
        )
    return control / max(1, math.floor(control / (options.samples_per_cycle * frequency)))


def _rate_sine(
    options: FrequencyResponseOptions, bench: Bench, frequency: float
) -> tuple[Sine, float]:
    """The rate command and half the angle it swings (rad); it starts at rest."""
    limits, omega = bench.limits, 2.0 * math.pi * frequency
    acceleration = options.max_acceleration
    if acceleration is None:
        torque = min(limits.torque, limits.current * bench.torque_per_current)
        torque -= worst_friction(bench, options.amplitude)
        if torque <= 0:
            raise ValueError("the bench's torque and current limits do not overcome its friction")
        acceleration = LIMIT_SHARE * min(limits.acceleration, torque / bench.axis.inertia)
    amplitude = min(options.amplitude, acceleration / omega)
    return Sine(amplitude=amplitude, frequency=frequency), amplitude / omega


def _torque_sine(
    options: FrequencyResponseOptions, bench: Bench, frequency: float
) -> tuple[Sine, float]:
    """The torque and half the angle (rad) that it would swing a load without friction.

    It starts at its peak: the rate of a free load then has no offset, and the angle no drift.
    """
    omega = 2.0 * math.pi * frequency
    rate = options.torque / (bench.axis.inertia * omega)
    swing = rate / omega
    if abs(options.position) + swing > bench.limits.angle or rate > bench.limits.rate:
        raise ValueError(
            f"{options.torque:g} N m at {frequency:g} Hz would swing a load without friction by "
            f"{np.rad2deg(swing):.3g} deg at {np.rad2deg(rate):.3g} deg/s, beyond the bench's "
            "limits; lower torque or raise lowest"
        )
    return Sine(amplitude=options.torque, frequency=frequency, phase=0.5 * math.pi), swing


@dataclass(frozen=True)
class Sweep:
    """One response of the test: its place in the matrix, and what was found in it."""

    place: dict[str, Value]
    loop: str
    label: str
    response: Response
    found: ServoCharacteristics | None


def _point(data: TrialData) -> SinePoint:
    task = data.trial.task
    recording = data.recording().window(*task.window)
    drive = recording["command" if task.mode == "rate" else "drive_torque"]
    frequency = float(str(data.trial.point["frequency"]))
    return sine_point(recording.time, drive, recording["gyro_rate"], frequency)


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    paths = [path for path in swept(data, own=("frequency",)) if path != "loop"]
    sweeps: list[Sweep] = []
    for group in grouped(data.completed(), own=("frequency",)).values():
        points = []
        for item in group:
            try:
                points.append(_point(item))
            except ValueError as error:
                notes.append(f"{item.trial.label}: {error}.")
        notes += _falling_amplitude(group)
        if points:
            sweeps.append(_sweep(group[0], make_response(points), paths))
    closed = [sweep for sweep in sweeps if sweep.loop == "closed"]
    opened = [sweep for sweep in sweeps if sweep.loop == "open"]
    tables: list[Table] = []
    figures: list[Figure] = []
    findings: list[Finding] = []
    if closed:
        tables += _closed_tables(closed, paths)
        figures += closed_loop_figures([(s.label, _method(s), s.response) for s in closed])
        findings += [finding for sweep in closed for finding in _closed_findings(sweep)]
        findings += _changes(closed)
        notes += _closed_notes(closed)
    if opened:
        table, found, doubts = _modes(opened, paths)
        tables.append(table)
        findings += found
        notes += doubts
        figures.append(torque_figure([(s.label, _method(s), s.response) for s in opened], found))
    notes += _quality_note(sweeps)
    return Result(tuple(tables), tuple(figures), tuple(findings), tuple(dict.fromkeys(notes)))


def _sweep(first: TrialData, response: Response, paths: list[str]) -> Sweep:
    place = conditions(first, "compensation", "loop")
    place.pop("frequency", None)
    loop = "closed" if first.trial.task.mode == "rate" else "open"
    label = method_label(str(place["compensation"]))
    others = [f"{path} = {_told(place.get(path))}" for path in paths if path != "compensation"]
    found = characteristics(response) if loop == "closed" else None
    return Sweep(place, loop, ", ".join([label, *others]), response, found)


def _falling_amplitude(group: tuple[TrialData, ...]) -> Iterator[str]:
    """A sentence where limits lowered the amplitude of a rate command along the sweep."""
    sines = [i.trial.task.command for i in group if i.trial.task.mode == "rate"]
    full = [s for s in sines if isinstance(s, Sine)]
    if not full:
        return
    largest = max(sine.amplitude for sine in full)
    lowered = [sine for sine in full if sine.amplitude < largest * (1 - 1e-9)]
    if lowered:
        first = min(lowered, key=lambda sine: sine.frequency)
        least = max(lowered, key=lambda sine: sine.frequency)
        yield (
            f"The command's amplitude was {np.rad2deg(largest):.3g} deg/s below "
            f"{first.frequency:.4g} Hz; from there on its acceleration was kept, down to "
            f"{np.rad2deg(least.amplitude):.3g} deg/s at {least.frequency:.4g} Hz. Where friction "
            "matters, other amplitudes give other responses."
        )


def _told(value: Value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _method(sweep: Sweep) -> str:
    return str(sweep.place["compensation"])


QUANTITIES = (
    ("bandwidth", "Bandwidth", "Hz", "Hz"),
    ("gain_margin", "Gain margin", "dB", ""),
    ("phase_margin", "Phase margin", "rad", "deg"),
)


def _values(found: ServoCharacteristics) -> dict[str, float]:
    return {
        "bandwidth": found.bandwidth,
        "gain_margin": found.gain.margin,
        "phase_margin": found.phase.margin,
    }


def _closed_findings(sweep: Sweep) -> Iterator[Finding]:
    if sweep.found is not None:
        values = _values(sweep.found)
        for name, _, unit, _ in QUANTITIES:
            yield Finding(name, values[name], unit, sweep.place)


def _pairs(sweeps: list[Sweep]) -> Iterator[tuple[Sweep, Sweep]]:
    """Each compensated sweep and the one without compensation, where all else is equal."""

    def rest(sweep: Sweep) -> dict[str, Value]:
        return {k: v for k, v in sweep.place.items() if k != "compensation"}

    for sweep in sweeps:
        for bare in sweeps:
            if _method(bare) == "none" != _method(sweep) and rest(bare) == rest(sweep):
                yield bare, sweep


def _changes(sweeps: list[Sweep]) -> Iterator[Finding]:
    for bare, sweep in _pairs(sweeps):
        if bare.found is not None and sweep.found is not None:
            before, after = _values(bare.found), _values(sweep.found)
            for name, _, unit, _ in QUANTITIES:
                yield Finding(f"{name}_change", after[name] - before[name], unit, sweep.place)


def _closed_tables(sweeps: list[Sweep], paths: list[str]) -> Iterator[Table]:
    extra = [path for path in paths if path != "compensation"]
    rows: list[dict[str, Value]] = []
    for sweep in sweeps:
        found = sweep.found
        if found is None:
            continue
        row: dict[str, Value] = {**sweep.place, **_values(found)}
        row |= {
            "bandwidth_error": found.bandwidth_error,
            "gain_margin_error": found.gain_margin_error,
            "phase_margin_error": found.phase_margin_error,
            "gain_crossover": found.phase.frequency,
            "phase_crossover": found.gain.frequency,
            "crossover": _read(found),
        }
        rows.append({key: _or_none(value) for key, value in row.items()})
    yield Table(
        key="servo-characteristics",
        title="Bandwidth and stability margins from the measured response",
        columns=(
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in extra),
            Column("bandwidth", "Bandwidth", "Hz", "Hz"),
            Column("bandwidth_error", "± (1σ)", "Hz", "Hz"),
            Column("gain_margin", "Gain margin", "dB"),
            Column("gain_margin_error", "± (1σ)", "dB"),
            Column("phase_margin", "Phase margin", "rad", "deg"),
            Column("phase_margin_error", "± (1σ)", "rad", "deg"),
        ),
        rows=tuple(rows),
        thesis=("5.3", "5.9"),
        note="Bandwidth is where the gain of the closed loop falls to -3 dB of unity, which its "
        "integral action gives it at zero frequency. Margins are of the open loop T / (1 - T). "
        "Deviations are those of the noise, not of friction from trial to trial.",
    )
    yield Table(
        key="crossovers",
        title="Where the margins were read",
        columns=(
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in extra),
            Column("gain_crossover", "Gain crossover", "Hz", "Hz"),
            Column("phase_crossover", "Phase crossover", "Hz", "Hz"),
            Column("crossover", "Phase crossover is"),
        ),
        rows=tuple(rows),
    )
    changes = [
        {**{k: sweep.place.get(k) for k in ("compensation", *extra)}, **_difference(bare, sweep)}
        for bare, sweep in _pairs(sweeps)
    ]
    if changes:
        yield Table(
            key="compensation-effect",
            title="What compensation changes",
            columns=(
                Column("compensation", "Compensation"),
                *(Column(path, path) for path in extra),
                *(Column(name, f"{label}, change", u, d) for name, label, u, d in QUANTITIES),
            ),
            rows=tuple(changes),
            note="Against the same loop without compensation.",
        )


def _read(found: ServoCharacteristics) -> str | None:
    if not math.isfinite(found.gain.margin):
        return None
    return "extrapolated" if found.gain.extrapolated else "measured"


def _difference(bare: Sweep, sweep: Sweep) -> dict[str, Value]:
    if bare.found is None or sweep.found is None:
        return {}
    before, after = _values(bare.found), _values(sweep.found)
    return {name: _or_none(after[name] - before[name]) for name in after}


def _or_none(value: Value) -> Value:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _closed_notes(sweeps: list[Sweep]) -> Iterator[str]:
    for sweep in sweeps:
        found, highest = sweep.found, sweep.response.frequency[-1]
        if found is None:
            continue
        if not math.isfinite(found.bandwidth):
            yield f"With {sweep.label} the gain does not fall through -3 dB within the sweep."
        if not math.isfinite(found.phase.margin):
            yield f"With {sweep.label} the open loop does not cross 0 dB in or near the sweep."
        elif not math.isfinite(found.gain.margin):
            yield f"With {sweep.label} the phase does not cross -180° in or near the sweep."
        elif found.gain.extrapolated:
            yield (
                f"With {sweep.label} the phase crosses -180° at {found.gain.frequency:.4g} Hz, "
                f"above the sweep's {highest:.4g} Hz: the gain margin is extrapolated, from an "
                "integrator and a delay fitted to the upper part of the sweep."
            )


def _quality_note(sweeps: list[Sweep]) -> Iterator[str]:
    for sweep in sweeps:
        coherence = sweep.response.coherence
        worst = int(np.argmin(coherence))
        yield (
            f"{sweep.label[0].upper()}{sweep.label[1:]}, {sweep.loop} loop: at least "
            f"{100 * coherence[worst]:.3g} % of the response's power is at the excitation "
            f"frequency (least at {sweep.response.frequency[worst]:.4g} Hz); the rest is noise and "
            "harmonics that friction makes."
        )


def _modes(
    sweeps: list[Sweep], paths: list[str]
) -> tuple[Table, tuple[Finding, ...], tuple[str, ...]]:
    rows: list[dict[str, Value]] = []
    findings: list[Finding] = []
    notes: list[str] = []
    for sweep in sweeps:
        mode = elastic_mode(sweep.response)
        row: dict[str, Value] = {**sweep.place}
        if mode is None:
            notes.append(f"With {sweep.label} the open loop shows no elastic mode in the sweep.")
        else:
            row |= {
                "frequency": mode.frequency,
                "antiresonance": mode.antiresonance,
                "damping_ratio": mode.damping_ratio,
            }
            findings.append(Finding("elastic_mode_frequency", mode.frequency, "Hz", sweep.place))
        rows.append(row)
    table = Table(
        key="elastic-mode",
        title="First elastic mode in the torque-to-rate response",
        columns=(
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in paths if path != "compensation"),
            Column("frequency", "Resonance", "Hz", "Hz"),
            Column("antiresonance", "Antiresonance", "Hz", "Hz"),
            Column("damping_ratio", "Damping ratio"),
        ),
        rows=tuple(rows),
        note="A resonance and an antiresonance fitted on top of a smooth response.",
    )
    return table, tuple(findings), tuple(notes)


EXPERIMENT = Experiment(
    name="frequency_response",
    summary="stepped-sine response, bandwidth and margins (Tables 5.3 and 5.9, Figure 4.5)",
    options=FrequencyResponseOptions,
    trials=_trials,
    analyse=_analyse,
)
