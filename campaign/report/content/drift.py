"""Drift of the bench over a run: each check against the first of its kind."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from campaign.api.analysis import one_line
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.sound_samples import Trials, without_damaged
from campaign.channels import DRIVE_TORQUE, GYRO_RATE, MOTOR_CURRENT, POINTING_ERROR, RELATIVE_RATE
from campaign.errors import ArchiveError
from campaign.reason import Cause
from campaign.recording import Outcome, Recording
from campaign.result import Array, Axis, Column, Curve, Figure, Mark, Panel, Table, Value
from campaign.trial import Role, Task

ONE_EACH = Cause(
    "one recording each",
    "one recording each: how they scatter from one to the next is what this table shows",
)


@dataclass(frozen=True)
class Drift:
    """RMS of one channel over the measuring window, per trial, in the channel's SI unit."""

    test: str
    label: str
    unit: str
    display: str
    trials: tuple[ArchivedTrial, ...]
    rms: tuple[float, ...]


def drifts_of(run: RunReader) -> tuple[list[Drift], list[str], list[Damage]]:
    """Drift per test with checks, problems of tests without a drift, damage of the trials."""
    drifts: list[Drift] = []
    problems: list[str] = []
    damaged: list[Damage] = []
    checked = [t.trial for t in run.trials if t.trial.role is Role.CHECK]
    for test in dict.fromkeys(trial.test for trial in checked):
        task = next(trial.task for trial in checked if trial.test == test)
        same = tuple(
            t
            for t in run.trials_of(test)
            if t.trial.task == task
            and t.ending.outcome is Outcome.COMPLETED
            and _comparable(t)
            and not t.not_kept
        )
        try:
            drift, _, damage = without_damaged(run.path, same, partial(_drift, test))
            damaged += damage
        except (ArchiveError, KeyError, ValueError) as error:
            if isinstance(error, ArchiveError):
                damaged.append(Damage.of(run.path, error))
            problems.append(f"the checks of {test}: {one_line(error)}")
            continue
        if drift is not None:
            drifts.append(drift)
    return drifts, problems, damaged


def _comparable(item: ArchivedTrial) -> bool:
    """Whether a trial is a check, or the measurement that checks repeat."""
    trial = item.trial
    return trial.role is Role.CHECK or (trial.role is Role.MEASUREMENT and trial.repeat == 1)


def _drift(test: str, trials: Trials) -> Drift | None:
    if not trials:
        return None
    trials = tuple(t for t in trials if t.trial.bench == trials[-1].trial.bench)
    if len(trials) < 2:
        return None
    recordings = [_window(trial) for trial in trials]
    name = _telling(recordings[0], trials[0].trial.task)
    channel = recordings[0].channels[name]
    rms = tuple(float(np.sqrt(np.mean(recording[name] ** 2))) for recording in recordings)
    return Drift(test, channel.label, channel.unit, channel.display_unit, trials, rms)


def _window(trial: ArchivedTrial) -> Recording:
    return trial.recording().window(*trial.trial.task.window)


def _telling(recording: Recording, task: Task) -> str:
    """Channel that shows a change of the bench: the error if the base moves, else the current."""
    wanted = [MOTOR_CURRENT, DRIVE_TORQUE, GYRO_RATE, RELATIVE_RATE]
    if task.base_acceleration.shape != "zero":
        wanted.insert(0, POINTING_ERROR)
    measured = [name for name, channel in recording.channels.items() if channel.measured]
    return next((name for name in wanted if name in measured), measured[-1])


def drift_table(drift: Drift) -> Table:
    """Table of each trial's RMS and its change from the first."""
    rows: list[dict[str, Value]] = [
        {
            "trial": item.trial.number,
            "role": item.trial.role.value,
            "started": item.started,
            "rms": rms,
            "change": _change(rms, drift.rms[0]),
        }
        for item, rms in zip(drift.trials, drift.rms, strict=True)
    ]
    columns = (
        Column("trial", "Trial", exact=True),
        Column("role", "Role"),
        Column("started", "Started"),
        Column(
            "rms", f"RMS of the {_lower(drift.label)}", drift.unit, drift.display, reason=ONE_EACH()
        ),
        Column("change", "Change from the first", "", "percent", reason=ONE_EACH()),
    )
    title = f"The same trial of {drift.test} again and again"
    return Table(f"drift-{drift.test}", title, columns, tuple(rows))


def drift_figure(drift: Drift) -> Figure:
    """Figure of the change over the trial number."""
    numbers = np.array([float(item.trial.number) for item in drift.trials])
    changes = [_change(rms, drift.rms[0]) for rms in drift.rms]
    y = np.array([np.nan if change is None else change for change in changes])
    return Figure(
        key=f"drift-{drift.test}",
        title=f"Is it still the same bench? Checks of {drift.test}",
        caption=f"RMS of the {_lower(drift.label)} each time the same trial was executed, as a "
        f"change from the first{_largest_words(drift, y)}. A trend is a bench that changed; "
        "scatter is its repeatability.",
        alt="Change of the RMS from the first execution over the number of the trial.",
        panels=(
            Panel(
                Axis("Number of the trial"),
                Axis("Change from the first", "", "percent"),
                [Curve(numbers, y, drift.test, "measured", "line+points")],
                marks=(Mark("first", y=0.0),),
            ),
        ),
        trials=tuple(item.trial.number for item in drift.trials),
    )


def _largest_words(drift: Drift, changes: Array) -> str:
    """`; the largest, -1.2 %, is trial 14`; `changes` as drawn, shape (n,)."""
    if not np.any(np.abs(changes) > 0):
        return ""
    at = int(np.nanargmax(np.abs(changes)))
    return f"; the largest, {100 * changes[at]:+.2g} %, is trial {drift.trials[at].trial.number}"


def _change(rms: float, first: float) -> float | None:
    return rms / first - 1 if first else None


def _lower(label: str) -> str:
    return label[:1].lower() + label[1:]
