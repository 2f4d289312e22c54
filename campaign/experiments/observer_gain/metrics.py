"""Metrics of one recording, and of all recordings at one gain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import JsonValue

from campaign.channels import FRICTION_TORQUE, GYRO_RATE, LOAD_RATE
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, multiplied
from campaign.estimation.sine_amplitude import amplitude
from campaign.estimation.stabilization_error import over_blocks, over_trials
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.common import by_value, compensation_of, number_of
from campaign.experiments.shared.pointing_error import error_of, found, measured_part, of_each
from campaign.physics import observer_loop as theory
from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete, control_rate
from campaign.reason import Cause
from campaign.recording import Outcome, Recording
from campaign.result import Array
from campaign.signals import Sine

ERROR = "stabilization_error"
ERROR_THEORY = "error_by_equation_5_4"
NOISE = "noise_rate"
REJECTION = "disturbance_rejection"
BY_THEORY = Cause("by theory", "calculated from an equation, not measured")
TOO_FEW = Cause(
    "too few frequencies",
    "{frequencies} frequencies; from {enough} on their range encloses it",
)
ENOUGH = 6
"""Frequencies whose lowest and highest result enclose the median in 97 % of cases (sign test)."""


@dataclass(frozen=True)
class Rejection:
    """|w/Td| at one frequency (Hz): measured and by Eq. 5.4 (rad/s per N m)."""

    frequency: float
    measured: Estimate
    expected: float


@dataclass(frozen=True)
class Gain:
    """Results at one gain, SI; None where not measured or not stable.

    Attributes:
        corner: Hz; 0 is without observer.
        gain: N K0, N m s/rad at the load.
        error, error_theory: stabilization error (rad).
        noise, noise_theory: true rate of the load from the gyro's noise (rad/s, 1 sigma).
        rejection: by rising frequency.
        unstable: why its trials ended early; empty when they did not.
    """

    corner: float
    gain: float
    error: Estimate | None
    error_theory: Estimate | None
    noise: Estimate | None
    noise_theory: float | None
    rejection: tuple[Rejection, ...]
    unstable: str

    @property
    def stable(self) -> bool:
        """Whether a trial at this gain completed, and none shows that the loop is unstable."""
        return not self.unstable and bool(self.error or self.noise or self.rejection)


def own_observer(bench: Bench, name: str) -> tuple[float, float | None]:
    """Corner frequency (Hz) of the bench's observer, and the inertia it assumes (kg m^2)."""
    observer = compensation_of(bench, name)
    if observer.method != "observer":
        raise ValueError(f"'{name}' is no disturbance observer: its method is '{observer.method}'")
    known = complete(bench, "the theory of an observer")
    return theory.corner_frequency(known, observer.gain, observer.inertia), observer.inertia


def is_noisy(bench: Bench) -> bool:
    """Whether its gyro has noise that a sampled controller sees."""
    return control_rate(bench) is not None and bench.sensors.gyro.noise > 0


def _place(data: TrialData) -> dict[str, JsonValue]:
    """Sweep point of a trial without its gain."""
    return {name: value for name, value in data.trial.point.items() if name != "corner"}


def _inertia(data: TrialData, bench: Bench) -> float | None:
    """The inertia that the observer assumes (kg m^2)."""
    return own_observer(bench, str(data.trial.options["observer"]))[1]


def _bench(data: TrialData) -> CompleteBench:
    return complete(bench_of(data.trial), "the theory of an observer")


def measure(data: TrialData) -> list[Estimate]:
    """Metric of a trial; for an error also the one by Eq. 5.4 from the friction of the trial."""
    return found(_measured(data, measured_part(data)))


def _measured(data: TrialData, cut: Recording) -> Iterator[Estimate]:
    task, measured = data.trial.task, data.trial.point["measured"]
    if measured == "error":
        yield error_of(cut, task)
        if FRICTION_TORQUE in cut.channels:
            bench = _bench(data)
            corner, inertia = number_of(data.trial, "corner"), _inertia(data, bench)
            value = predicted_error(cut, bench, corner, inertia)
            yield Estimate.without_interval(ERROR_THEORY, value, "rad", BY_THEORY())
    elif measured == "noise" and LOAD_RATE in cut.channels:
        yield over_blocks(cut[LOAD_RATE], NOISE, "rad/s")
    elif measured == "rejection" and isinstance(task.disturbance, Sine):
        per_torque = cut[GYRO_RATE] / task.disturbance.amplitude
        frequency = task.disturbance.frequency
        yield amplitude(REJECTION, cut.time, per_torque, frequency, "rad/s/(N m)")


def ends_early(data: TrialData) -> bool:
    """Whether a trial reached a limit or diverged."""
    return data.ending.outcome in (Outcome.LIMIT, Outcome.DIVERGED)


def gain_of(corner: float, group: Sequence[TrialData], without: Sequence[TrialData]) -> Gain:
    """Results of all trials at one corner frequency (Hz).

    An early end is no instability if the same trial of `without` (no observer) ends early too.
    """
    lost = [_place(item) for item in without if ends_early(item)]
    ended = [item for item in group if ends_early(item) and _place(item) not in lost]
    completed = [item for item in group if item.ending.outcome is Outcome.COMPLETED]
    by_kind: dict[str, list[TrialData]] = {"error": [], "noise": [], "rejection": []}
    for item in completed:
        by_kind[str(item.trial.point["measured"])].append(item)
    bench = _bench(group[0])
    inertia = _inertia(group[0], bench)
    return Gain(
        corner=corner,
        gain=2 * np.pi * corner * (inertia or bench.axis.inertia),
        error=_together(by_kind["error"], ERROR),
        error_theory=_together(by_kind["error"], ERROR_THEORY),
        noise=_together(by_kind["noise"], NOISE),
        noise_theory=theory.noise_rate(bench, corner, inertia) if is_noisy(bench) else None,
        rejection=tuple(_rejections(by_kind["rejection"], bench, corner, inertia)),
        unstable=ended[0].ending.reason if ended else "",
    )


def _together(group: Sequence[TrialData], name: str) -> Estimate | None:
    """Metric over the repetitions of a trial; None if no recording has it."""
    estimates = of_each(group, measure, name)
    if not estimates:
        return None
    if name == ERROR_THEORY:
        return replace(estimates[0], value=float(np.mean([each.value for each in estimates])))
    return over_trials(estimates)


def _rejections(
    group: Sequence[TrialData], bench: CompleteBench, corner: float, inertia: float | None
) -> Iterator[Rejection]:
    for frequency, items in by_value(group, "disturbance_frequency").items():
        measured = _together(items, REJECTION)
        expected = abs(theory.rejection(bench, corner, inertia, np.array([frequency]))[0])
        if measured is not None:
            yield Rejection(frequency, measured, float(expected))


def predicted_error(
    recording: Recording, bench: CompleteBench, corner: float, inertia: float | None
) -> float:
    """Error (rad, 1 sigma) by Eq. 5.4 from the friction in a recording of whole cycles.

    The disturbance is the true friction, known to a simulator only. The error is its spectrum times
    w/Td, integrated to an angle with the pointing high-pass.
    """
    time = recording.time
    count = len(time)
    step = float(np.ptp(time)) / (count - 1)
    frequency: Array = np.fft.rfftfreq(count, step)[1:].astype(float)
    torque = np.fft.rfft(recording[FRICTION_TORQUE])[1:] / count
    s = 2j * np.pi * frequency
    high_pass = 2 * np.pi * bench.controller.pointing_high_pass
    angle = torque * theory.rejection(bench, corner, inertia, frequency) / (s + high_pass)
    twice = np.full(len(angle), 2.0)
    if count % 2 == 0:
        twice[-1] = 1.0
    return float(np.sqrt(np.sum(twice * np.abs(angle) ** 2)))


def measured_corner(gain: Gain, without: Gain) -> Estimate | None:
    """Corner frequency (Hz) from the reduction of |w/Td| by the observer; None without reduction.

    By Eq. 5.4 |w/Td| has the ratio s / (s + a) to that without observer: (1 / ratio)^2 - 1 =
    (a / w)^2. The value is the median over the frequencies. The interval, from the lowest to the
    highest result, encloses the median for any distribution of the results.
    """
    known = {point.frequency: point.measured.value for point in without.rejection}
    pairs = [
        (point.frequency, known[point.frequency] / point.measured.value)
        for point in gain.rejection
        if known.get(point.frequency) and point.measured.value > 0
    ]
    corners = [f * np.sqrt(ratio**2 - 1) for f, ratio in pairs if ratio > 1]
    if not corners:
        return None
    name, value = "observer_corner_frequency", float(np.median(corners))
    if len(corners) < ENOUGH:
        reason = TOO_FEW(frequencies=len(corners), enough=ENOUGH)
        return Estimate.without_interval(name, value, "Hz", reason)
    low, high = float(min(corners)), float(max(corners))
    method = f"median and range of what {len(corners)} frequencies say"
    return Estimate(name, value, "Hz", low, high, LEVEL, method)


def worst_ratio(gain: Gain) -> Estimate | None:
    """Measured |w/Td| over that of Eq. 5.4, the ratio farthest from 1; None if not measured."""
    if not gain.rejection:
        return None
    worst = max(gain.rejection, key=lambda point: abs(point.measured.value / point.expected - 1))
    return replace(multiplied(worst.measured, 1.0 / worst.expected), name="ratio", unit="")
