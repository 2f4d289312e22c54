"""Stabilization under base motion: pointing error of each compensation.

The hull swings, the rate command is zero, and the standard deviation of the integrated gyro rate is
the stabilization error (sections 5.2 and 5.3): over whole cycles where the motion is sinusoidal,
over the whole window where it is a measured series or a ship's roll.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from pydantic import Field

from campaign.channels import (
    BASE_RATE,
    COMPENSATION_TORQUE,
    FRICTION_TORQUE,
    GYRO_RATE,
    POINTING_ERROR,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    missing,
)
from campaign.estimate import Estimate
from campaign.estimation.intervals import of_next
from campaign.estimation.sampled_curve import LOST, drop_interval_if_deterministic
from campaign.estimation.stabilization_error import BLOCKS, over_trials, whole_cycles
from campaign.estimation.time_stuck import UNRESOLVED, over_recordings, time_stuck
from campaign.experiments.interface import Experiment, TestData, TrialData, key
from campaign.experiments.shared import default_options
from campaign.experiments.shared.common import conditions, grouped, swept
from campaign.experiments.shared.detected_trials import hull_sine
from campaign.experiments.shared.pointing_error import (
    MEASURED,
    SineMotionOptions,
    error_of,
    found,
    largest_of,
    measured_part,
    of_each,
    rate_of,
    rest_task,
    seen_through,
    windows_of,
)
from campaign.experiments.stabilization.comparisons import (
    beside_rows,
    beside_table,
    compared,
    preload_of,
)
from campaign.experiments.stabilization.errors import BY_METHOD
from campaign.experiments.stabilization.figures import stabilization_figures
from campaign.experiments.stabilization.hull_motion import (
    Motion,
    SeriesMotion,
    ShipMotion,
    SineMotion,
)
from campaign.physics.bench import Bench
from campaign.reason import Cause, Reason
from campaign.recording import Recording
from campaign.result import Cell, Column, Finding, Result, Table, Value
from campaign.signals import Sine
from campaign.trial import OfferedRecording, Trial, TrialRequest

SAMPLES_PER_CYCLE = 10
"""Fewest samples in a cycle: the standard deviation needs the shape of the error."""
LARGEST = "largest_error"
OF_A_RECORD = Cause("largest of its record", "the largest value of a record grows with its length")
SPREAD = Cause(
    "spread of the trials", "the standard deviation of the trials about the error before it"
)
STUCK = "time_stuck"
SHOW_STUCK = (BASE_RATE, RELATIVE_ANGLE, GYRO_RATE)
"""Channels of the time stuck: rate of the hull, and those that resolve the relative rate."""


class StabilizationOptions(SineMotionOptions):
    """Options of a stabilization test."""

    motion: Motion = SineMotion()
    """Motion of the hull; frequency, acceleration and cycles are those of a sine."""
    compensation: str = "none"
    """Name of a compensation of the bench, or none."""
    cycles: int = Field(default=6, ge=1, le=10_000)
    """Whole cycles of the base motion to measure."""
    settle_cycles: int = Field(default=2, ge=0, le=1_000)
    """Cycles before them, for the transient to decay."""

    def without_effect(self) -> frozenset[str]:
        return frozenset(() if isinstance(self.motion, SineMotion) else OF_A_SINE)


OF_A_SINE = ("frequency", "acceleration", "cycles", "settle_cycles")


def _trials(options: StabilizationOptions, bench: Bench) -> Iterator[TrialRequest]:
    if not isinstance(options.motion, SineMotion):
        yield _irregular(options, options.motion)
        return
    if options.sample_rate < SAMPLES_PER_CYCLE * options.frequency:
        raise ValueError(
            f"a recording at {options.sample_rate:.4g} Hz shows fewer than {SAMPLES_PER_CYCLE} "
            f"samples per cycle of a {options.frequency:.4g} Hz motion; raise sample_rate"
        )
    task = options.task(options.compensation)
    note = f"{options.cycles} cycles measured after {options.settle_cycles} to settle"
    yield TrialRequest(task, note=note, can_use=_can_use(options), windows=windows_of(task))


def _found(
    options: StabilizationOptions, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """Trial of the sinusoidal hull motion in an unplanned recording."""
    request = hull_sine(offered, MEASURED, options.settle_cycles)
    compensated = request.task.model_copy(update={"compensation": options.compensation})
    yield replace(
        request, task=compensated, can_use=_can_use(options), windows=windows_of(compensated)
    )


def _irregular(options: StabilizationOptions, motion: SeriesMotion | ShipMotion) -> TrialRequest:
    """Trial of a motion that is no sine: the measurement starts after the settling time."""
    given = [name for name in OF_A_SINE if name in options.model_fields_set]
    if given:
        raise ValueError(
            f"{', '.join(given)}: for a sinusoidal motion only, and this one is of kind "
            f"'{motion.kind}'; remove one or the other"
        )
    signal, start, stop = motion.signal()
    rate, name = options.sample_rate, options.compensation
    task = rest_task(name, start, stop, rate, base_acceleration=signal)
    note = f"{stop - start:.4g} s measured after {start:.4g} s to settle"
    return TrialRequest(task, note=note, can_use=_can_use(options), windows=windows_of(task))


def _can_use(options: StabilizationOptions) -> tuple[str, ...]:
    """Channels of the figures; with a compensation also its torque and the friction torque."""
    rates = (BASE_RATE, RELATIVE_RATE, RELATIVE_ANGLE, GYRO_RATE)
    if options.compensation == "none":
        return rates
    return (*rates, COMPENSATION_TORQUE, FRICTION_TORQUE)


def _measure(data: TrialData) -> list[Estimate]:
    """Error (rad, 1 sigma), largest deviation from the mean (rad), time stuck of one trial."""
    recording = measured_part(data)
    if len(recording.time) < 2:
        raise ValueError("nothing was recorded in the window that is measured")
    peak = largest_of(recording[POINTING_ERROR])
    largest = Estimate.without_interval(LARGEST, peak, "rad", OF_A_RECORD(), kind="quantile")
    error = error_of(recording, data.trial.task)
    return found([error, largest, *_time_stuck(recording, data.trial)])


def _time_stuck(recording: Recording, trial: Trial) -> Iterator[Estimate]:
    """Share of time in which the load moves with the hull; nothing without the channels."""
    if missing(SHOW_STUCK, recording.channels):
        return
    signal, rate = trial.task.base_acceleration, rate_of(recording)
    cycles = (
        whole_cycles(len(recording.time), rate / signal.frequency)
        if isinstance(signal, Sine)
        else 0
    )
    parts = 2 * cycles if cycles else BLOCKS
    base, angle, gyro = (recording[name] for name in SHOW_STUCK)
    yield time_stuck(base, angle, gyro, 1.0 / rate, parts)


def _told(data: TrialData, columns: Sequence[str]) -> dict[str, Value]:
    """Conditions of the trial: of an irregular motion its kind, not frequency and acceleration."""
    motion = data.trial.options.get("motion")
    kind = motion.get("kind", "sine") if isinstance(motion, Mapping) else "sine"
    if kind == "sine":
        return conditions(data, *columns)
    stated = conditions(data, "compensation")
    return {**stated, "motion": str(kind)}


def _analyse(data: TestData) -> Result:
    groups = grouped(data.completed())
    paths = swept(data)
    columns = ("compensation", "frequency", "acceleration")
    findings: list[Finding] = []
    rows: list[dict[str, Cell]] = []
    for group in groups.values():
        point = _told(group[0], columns) | preload_of(group[0])
        row = _row(group)
        cells = (row["error"], row.get("next"))
        findings += [Finding.of(cell, point) for cell in cells if isinstance(cell, Estimate)]
        rows.append({**point, **row})
    firsts = [group[0] for group in groups.values()]
    errors = [finding for finding in findings if finding.quantity == "stabilization_error"]
    findings += compared(errors)
    figures = list(stabilization_figures(firsts, paths, rows))
    extra = [path for path in paths if path not in columns]
    tables = [_table(rows, extra, seen_through(firsts[0].trial) if firsts else "")]
    beside = tuple(beside_rows(rows))
    if beside:
        tables.insert(0, beside_table(beside, extra))  # first, as the purpose of such a test
    errors_shown = [figure.key for figure in figures if "error" in figure.key]
    # By method last, because the table has the same numbers.
    telling = min(errors_shown, key=lambda key: key == BY_METHOD, default="")
    return Result(tuple(tables), tuple(figures), tuple(findings), telling=telling)


def _row(group: Sequence[TrialData]) -> dict[str, Cell]:
    """Cells of one condition, from one or more repetitions."""
    errors = of_each(group, _measure, "stabilization_error")
    peaks = of_each(group, _measure, LARGEST)
    stuck = over_recordings(of_each(group, _measure, STUCK))
    shown = any(not missing(SHOW_STUCK, data.channel_names()) for data in group)
    row: dict[str, Cell] = {
        "error": over_trials(errors) if errors else _nothing("stabilization_error", LOST()),
        "peak": over_trials(peaks) if peaks else _nothing(LARGEST, LOST()),
        "stuck": stuck or (_nothing(STUCK, UNRESOLVED()) if shown else None),
        "repeats": len(group),
    }
    if len(errors) > 1:
        values = [error.value for error in errors]
        row["spread"] = float(np.std(values, ddof=1))
        following = of_next("stabilization_error_of_one_trial", values, "rad")
        row["next"] = drop_interval_if_deterministic(following, following.value)
    return row


def _nothing(name: str, reason: Reason) -> Estimate:
    return Estimate.without_interval(name, math.nan, "", reason)


def _table(rows: Sequence[Mapping[str, Cell]], extra: Sequence[str], remark: str) -> Table:
    irregular = any("motion" in row for row in rows)
    sines = any("frequency" in row for row in rows)
    columns = [Column("compensation", "Compensation")]
    if irregular:
        columns.append(Column("motion", "Motion"))
    if sines:
        columns += [
            Column("frequency", "Frequency", "Hz", "Hz", exact=True),
            Column("acceleration", "Base acceleration", "rad/s^2", "deg/s^2", exact=True),
        ]
    columns += [
        *(Column(path, path, exact=True) for path in extra),
        Column("error", "Error (1σ)", "rad", "mrad"),
        Column("peak", "Largest error", "rad", "mrad"),
    ]
    if any(row["stuck"] is not None for row in rows):
        columns.append(Column("stuck", "Time stuck", "", "percent"))
    if any(row["repeats"] != 1 for row in rows):
        columns += [
            Column("repeats", "Repeats", exact=True),
            Column("spread", "Spread (1σ)", "rad", "mrad", reason=SPREAD()),
            Column("next", "One more trial", "rad", "mrad"),
        ]
    return Table(
        key="stabilization-error",
        title="Stabilization error by compensation method",
        columns=tuple(columns),
        rows=tuple(rows),
        thesis=("5.2", "5.8", "5.4", "5.10", "5.5", "5.11", "5.6", "5.12", "5.7", "5.13"),
        note="The error is the standard deviation of the integrated gyro rate over "
        + ("the measured time." if irregular else "whole cycles.")
        + remark,
    )


EXPERIMENT = Experiment(
    name="stabilization",
    summary="stabilization error under base motion, by compensation (Tables 5.2 and 5.8)",
    options=StabilizationOptions,
    trials=_trials,
    analyse=_analyse,
    fit=default_options.base_motion,
    recorded=_found,
    windows=(MEASURED,),
    measure=_measure,
    needs_samples=False,
    requires={POINTING_ERROR: "the stabilization error"},
    can_use={
        BASE_RATE: "time stuck, and no figure of the relative rate",
        RELATIVE_RATE: "figure of the relative rate",
        RELATIVE_ANGLE: "time stuck",
        GYRO_RATE: "time stuck",
        COMPENSATION_TORQUE: "figure of what the compensation adds",
        FRICTION_TORQUE: "true friction beside the compensation torque",
    },
    key_numbers=(
        key("error_growth"),
        key("stabilization_error"),
        key("error_reduction"),
    ),
)
