"""Records, tables, figures and remarks of a joint fit below breakaway."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE, RELATIVE_RATE
from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import shifted_by
from campaign.estimation.presliding import damping_by_ratio
from campaign.estimation.presliding_dynamics.driven_torque import Driven, driven_torques
from campaign.estimation.presliding_dynamics.plant import Appendage
from campaign.estimation.presliding_dynamics.presliding_fit import PreslidingDynamics
from campaign.estimation.presliding_dynamics.record import Assumptions, Record
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.presliding_multisine.held_current import between_samples
from campaign.experiments.shared.captions import amount
from campaign.experiments.shared.common import correlations
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_systematic
from campaign.physics.bench import Bench
from campaign.physics.loop import viscous_at_load
from campaign.result import Array, Axis, Cell, Column, Curve, Figure, Mark, Panel, Table
from campaign.signals import MultiSine

NAMES = {"bristle_stiffness": "stiffness_at_rest", "damping": "damping_at_rest"}
"""Names here of estimates below the first slip: they are sums over all interfaces."""
BY_TORQUE = ("stiffness_at_rest", "damping_at_rest", "inertia", "appendage_inertia")
"""Estimates with the relative error of the torque constant."""
QUANTITIES = ("stiffness_at_rest", "damping_at_rest", "inertia")
SPLIT = ("bristle_damping", "viscous_friction")
"""Parameters of which small motions determine the sum, but seldom each."""
ACCURACY = 1e-4
"""Relative error of the simulation, as a share of the rate."""
SHOWN = 2000
"""Samples of a record in a figure."""
LAGS = 60
"""Lags of the autocorrelation in a figure."""
TIME, RATE = Axis("Time", "s", "s"), Axis("Rate", "rad/s", "mrad/s")


def record_of(data: TrialData, period: float | None = None) -> Record:
    """Torque and motion of a trial that begins at rest, from the best of its sensors.

    Raises ValueError without a sensor, or if the record is too short.
    """
    recording = data.recording()
    rate = next((name for name in (GYRO_RATE, RELATIVE_RATE) if name in recording.channels), None)
    angle = (
        recording[RELATIVE_ANGLE] if rate is None and RELATIVE_ANGLE in recording.channels else None
    )
    return Record(
        1.0 / data.trial.task.sample_rate,
        recording[DRIVE_TORQUE],
        rate=None if rate is None else recording[rate],
        angle=angle,
        period=period,
        label=data.trial.label,
    )  # fmt: skip


def with_torques_known(
    trials: Sequence[TrialData], records: Sequence[Record], motions: Sequence[Array] = ()
) -> list[Record]:
    """Records with corrected torques of the trials that a multisine excites.

    The correction removes the noise of the torque sensor and adds the torque between samples and
    the torque's uncertainty. All trials are of one bench. motions: of the load, from a fit.
    """
    commands = {
        number: command
        for number, (trial, record) in enumerate(zip(trials, records, strict=True))
        if (command := _multisine(trial)) is not None and record.at_rest
    }
    corrected, doubts, moved = list(records), 0, dict(enumerate(motions))
    for step in sorted({records[number].step for number in commands}):
        alike = [number for number in commands if records[number].step == step]
        driven = [Driven(records[n].torque, commands[n].sample, moved.get(n)) for n in alike]
        highest = max(max(commands[n].frequencies) for n in alike)
        torques = driven_torques(driven, step, highest)
        for number, (torque, doubt) in zip(alike, torques, strict=True):
            columns = np.column_stack([np.zeros((len(torque), doubts)), doubt])
            corrected[number] = replace(records[number], torque=torque, doubt=columns)
        doubts = max(doubts, *(corrected[number].doubts.shape[1] for number in alike))
    corrected = [each.with_doubts(doubts) for each in corrected]
    if not commands:
        return corrected
    for number, each in enumerate(corrected):
        missing, more = np.zeros(len(each.torque)), np.zeros(len(each.torque))
        if number in commands:
            bench = bench_of(trials[number].trial)
            missing, more = between_samples(each.time, commands[number], bench)
        # This error is the same in all trials.
        columns = np.column_stack([each.doubts, more])
        corrected[number] = replace(each, torque=each.torque + missing, doubt=columns)
    return corrected


def _multisine(data: TrialData) -> MultiSine | None:
    """Commanded torque of a trial, if it is a multisine."""
    task = data.trial.task
    return task.command if task.mode == "torque" and isinstance(task.command, MultiSine) else None


def assumed_of(bench: Bench, span: tuple[float, float]) -> Assumptions:
    """Assumptions from a bench: a first guess of viscous friction, and its appendage.

    Both dampings are free. Interfaces with different bristles yield with different shares of
    damping and stiffness; only the sum of all damping is the same for them and for one bristle.
    span: lowest and highest frequency of the excitation (Hz); an appendage within is fitted, too.
    """
    viscous = viscous_of(bench)
    if bench.appendage is None:
        return Assumptions(viscous)
    part = bench.appendage
    free = span[0] < part.frequency < span[1]
    appendage = Appendage(part.inertia, part.frequency, part.damping_ratio)
    return Assumptions(viscous, appendage, appendage_free=free)


def viscous_of(bench: Bench) -> float:
    """sigma2 at the load that a bench states, summed over all interfaces (N m s/rad)."""
    return sum(viscous_at_load(each, bench) for each in bench.friction.values())


def estimates_of(found: PreslidingDynamics, bench: Bench) -> dict[str, Estimate]:
    """Estimates by their names here, with uncertainties that no repetition would show."""
    estimates = {}
    for name, estimate in found.estimates.items():
        own = replace(estimate, name=NAMES.get(name, name))
        if own.has_interval and not name.endswith("delay"):
            own = shifted_by(own, "simulation", ACCURACY * abs(own.value))
        if own.has_interval and own.name in BY_TORQUE and bench.motor is not None:
            own = with_systematic(own, bench, TORQUE_CONSTANT, own.value)
        estimates[own.name] = own
    return estimates


def table_of(rows: Sequence[Mapping[str, Cell]]) -> Table:
    """One row per record, and one for all records together."""
    return Table(
        key="presliding-dynamics",
        title="Stiffness, damping and inertia below breakaway",
        columns=(
            Column("amplitude", "Largest torque", "N m", "N m", exact=True),
            Column("stiffness_at_rest", "Stiffness at rest", "N m/rad", "N m/rad"),
            Column("damping_at_rest", "Damping at rest", "N m s/rad", "N m s/rad"),
            Column("inertia", "Inertia", "kg m^2", "kg m^2"),
            Column("damping_ratio", "Damping ratio"),
            Column("natural_frequency", "Natural frequency", "Hz", "Hz"),
        ),
        rows=tuple(rows),
        note="Fitted to the whole motion by its simulation; the last row to all trials at once. "
        "Stiffness and damping are the sums over all interfaces, before any of them slips; damping "
        "is bristles' and viscous friction's together, which small motions do not separate.",
    )


def figures_of(found: PreslidingDynamics) -> Iterator[Figure]:
    """Measured and simulated motion, and residuals."""
    largest = int(np.argmax([record.amplitude for record in found.fit.records]))
    yield _answer_figure(found, largest)
    yield _left_figure(found)


def _answer_figure(found: PreslidingDynamics, number: int) -> Figure:
    record, channel = found.fit.records[number], found.fit.channels[number][0]
    simulated = found.fit.answers(number)[0]
    seen = channel.there > 0
    x = np.linspace(-1.0, 1.0, len(simulated))
    off = np.polyfit(x[seen], (channel.samples - simulated)[seen], 1)
    simulated = simulated + np.polyval(off, x)
    measured = np.where(channel.kept, channel.samples, np.nan)
    cut = slice(len(measured) // 2, len(measured) // 2 + SHOWN)
    time, axis = record.time, RATE if channel.name == "rate" else Axis("Angle", "rad", "mrad")
    return Figure(
        key="answer",
        title="Motion below breakaway, measured and simulated",
        caption=f"A part of the trial with {amount(record.amplitude, 'N m')}: torque, measured and "
        "simulated motion (with the sensor's offset and drift), and their difference.",
        alt="Torque over time, measured and simulated motion over time, and their difference.",
        panels=(
            Panel(
                TIME,
                Axis("Drive torque", "N m", "N m"),
                [Curve(time[cut], record.torque[cut], "", "measured")],
            ),
            Panel(
                TIME,
                axis,
                [
                    Curve(time[cut], measured[cut], "measured", "measured", "thin"),
                    Curve(time[cut], simulated[cut], "simulated", "fit"),
                ],
            ),
            Panel(
                TIME,
                replace(axis, label="Residual"),
                [Curve(time[cut], (measured - simulated)[cut], "", "measured", "thin")],
            ),
        ),
    )


def _left_figure(found: PreslidingDynamics) -> Figure:
    lags = np.arange(1.0, LAGS + 1.0)
    bands = found.misfit.bands
    step = found.fit.records[0].step
    curves = [
        Curve(lags * step, _autocorrelation(left[0]), _label(record), _label(record), "thin")
        for record, left in zip(found.fit.records, found.fit.residuals, strict=True)
    ]
    chance = 1.96 / np.sqrt(min(len(record.torque) for record in found.fit.records))
    frequency = np.array([band.frequency for band in bands])
    error = np.array([abs(band.error) for band in bands])
    return Figure(
        key="left-over",
        title="Residual of the fit",
        caption="Autocorrelation of the residuals, with the noise taken for an autoregression: "
        "between the lines is what white noise has. Beside it the residuals' share of the motion "
        "by frequency: an elastic part or a second inertia would stand out.",
        alt="Autocorrelation of residuals over lag, and share of the motion left over by "
        "frequency.",
        panels=(
            Panel(
                Axis("Lag", "s", "ms"),
                Axis("Autocorrelation"),
                curves,
                marks=(Mark("95 %, white", y=chance), Mark("", y=-chance)),
            ),
            Panel(
                Axis("Frequency", "Hz", "Hz", "log"),
                Axis("Left over", "", "percent"),
                [Curve(frequency, error, "", "measured", "line+points")],
            ),
        ),
        across=2,
    )


def _label(record: Record) -> str:
    return amount(record.amplitude, "N m")


def _autocorrelation(residuals: Array) -> Array:
    """Autocorrelation at lags of 1 to `LAGS` samples."""
    energy = float(residuals @ residuals) or 1.0
    return np.array([residuals[lag:] @ residuals[:-lag] / energy for lag in range(1, LAGS + 1)])


def damping_figure(
    amplitudes: Array,
    alone: Sequence[Estimate],
    joint: Mapping[str, Estimate],
    ratio: float,
) -> Figure:
    """Damping of each record and of all records, and the damping by a rule of thumb.

    amplitudes (N m), shape (n,), belong to `alone`, which may be empty: then they are a range.
    """
    stiffness, inertia = joint["stiffness_at_rest"], joint["inertia"]
    rule = damping_by_ratio(stiffness.value, inertia.value, 0.0, ratio)
    ends = np.array([float(np.min(amplitudes)), float(np.max(amplitudes))])
    together = Curve.of(ends, [joint["damping_at_rest"]] * 2, "all together", "fit", "line")
    each = [Curve.of(amplitudes, alone, "each trial", "measured")] if alone else []
    return Figure(
        key="damping",
        title="Damping of the bristles, measured and assumed",
        caption=f"Measured: {amount(joint['damping_at_rest'].value, 'N m s/rad')}. A damping ratio "
        f"of {ratio:g}, as it is assumed where nothing was measured (Equation 4.12), would make it "
        f"{amount(rule, 'N m s/rad')}.",
        alt="Damping over the largest torque of each trial, the joint fit, and the assumed one.",
        panels=(
            Panel(
                Axis("Largest torque", "N m", "N m"),
                Axis("Damping at rest", "N m s/rad", "N m s/rad", scale="log"),
                [*each, together],
                marks=(Mark("assumed", y=rule),),
            ),
        ),
    )


def remarks(found: PreslidingDynamics) -> Iterator[str]:
    """Notes on a fit: refused results and correlated parameters."""
    if found.reason:
        yield f"No interval: {found.reason}."
    for name, each in found.estimates.items():
        if name in SPLIT:
            continue  # only their sum is reported
        if each.origin in (Origin.NOT_DETERMINED, Origin.AT_BOUND) and not found.reason:
            yield f"{NAMES.get(name, name).replace('_', ' ').capitalize()}: {each.reason}."
    pairs = correlations(found.fit.parameters.names, found.spread.correlation)
    for (one, other), share in pairs.items():
        if abs(share) >= 0.9 and not {one, other} & {*SPLIT, "yielding"}:
            pair = [NAMES.get(n, n).replace("_", " ") for n in (other, one)]
            yield f"{pair[0]} and {pair[1]} are correlated ({share:.3f})."
    if np.any(np.isfinite(found.spread.freedom)):
        yield (
            "The trials differ by more than their noise: intervals are from how they differ. "
            "Friction has changed between them, or its curve is not a single bristle's."
        )
