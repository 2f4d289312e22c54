"""Incidents of a run: decisions, operator steps, attempts, faults, drift.

The source is the journal and the trials; a plain simulated run has no incidents.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from campaign.archive.layout.journal import Decision, OperatorStep, RunResumed, TrialsFollowed
from campaign.archive.layout.journal_summary import Lines
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.reason import Cause
from campaign.report.content.drift import drift_figure, drift_table, drifts_of
from campaign.report.content.low_margins import low_margin_table
from campaign.result import Column, Figure, Table, Value

BY_THE_BACKEND = Cause("one number of a backend", "the backend says one number of each trial")


@dataclass(frozen=True)
class Incidents:
    """Incidents of a run; the page has no such section without figures and tables."""

    figures: tuple[Figure, ...]
    tables: tuple[Table, ...]
    problems: tuple[str, ...]
    damaged: tuple[Damage, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.figures or self.tables)


def incidents(run: RunReader) -> Incidents:
    """Incidents from the journal and the trials of a run."""
    story = run.story
    drifts, problems, damaged = drifts_of(run)
    loops, loop_problems = low_margin_table(run)
    tables = [
        _decisions(story),
        _steps(story),
        attempts_table(story),
        _stages(story),
        _faults(run),
        loops,
    ]
    tables += [drift_table(drift) for drift in drifts]
    return Incidents(
        tuple(drift_figure(drift) for drift in drifts),
        tuple(table for table in tables if table.rows),
        (*problems, *loop_problems),
        tuple(damaged),
    )


def _decisions(told: Lines) -> Table:
    rows: list[dict[str, Value]] = []
    for entry in told.entries:
        if isinstance(entry, RunResumed):
            changes = "; ".join(entry.changes) or "nothing had changed"
            rows.append({"at": entry.at, "trial": None, "what": "run resumed", "reason": changes})
        elif isinstance(entry, Decision):
            row = {"at": entry.at, "trial": entry.trial, "what": entry.decision}
            rows.append({**row, "reason": entry.reason})
    columns = (
        Column("at", "When"),
        Column("trial", "Trial", exact=True),
        Column("what", "Decision"),
        Column("reason", "Reason"),
    )
    return Table("decisions", "What the run decided", columns, tuple(rows))


def _steps(told: Lines) -> Table:
    rows: list[dict[str, Value]] = [
        {"at": step.at, "trial": step.trial, "step": step.step, "answer": step.answer}
        for step in told.all(OperatorStep)
    ]
    columns = (
        Column("at", "When"),
        Column("trial", "Before trial", exact=True),
        Column("step", "Step"),
        Column("answer", "Answer"),
    )
    return Table("operator-steps", "What was done by hand", columns, tuple(rows))


def attempts_table(told: Lines) -> Table:
    """Table of all attempts of trials with more than one."""
    often = Counter(entry.trial for entry in told.attempts)
    rows: list[dict[str, Value]] = [
        {
            "trial": entry.trial,
            "attempt": entry.attempt,
            "at": entry.at,
            "outcome": entry.outcome.value,
            "reason": entry.reason,
            "safe": entry.safe_state.value,
        }
        for entry in sorted(told.attempts, key=lambda entry: (entry.trial, entry.attempt))
        if often[entry.trial] > 1
    ]
    columns = (
        Column("trial", "Trial", exact=True),
        Column("attempt", "Attempt", exact=True),
        Column("at", "Ended"),
        Column("outcome", "Outcome"),
        Column("reason", "Reason"),
        Column("safe", "Safe state"),
    )
    note = "The last attempt is the trial; the earlier ones are kept and not analysed."
    return Table("attempts", "Trials executed more than once", columns, tuple(rows), note=note)


def _stages(told: Lines) -> Table:
    rows: list[dict[str, Value]] = []
    for stage in told.all(TrialsFollowed):
        first = stage.trials[0].number if stage.trials else None
        refused = "; ".join(f"{each.label}: {each.why}" for each in stage.refused)
        count, why = len(stage.trials), stage.reason or refused
        rows.append(
            {"at": stage.at, "stage": stage.title, "trials": count, "first": first, "why": why}
        )
    columns = (
        Column("at", "When"),
        Column("stage", "Stage"),
        Column("trials", "Trials that follow", exact=True),
        Column("first", "First of them", exact=True),
        Column("why", "Refused or failed"),
    )
    note = "Trials that follow from what others found are numbered after all planned ones."
    return Table("stages", "Trials that followed", columns, tuple(rows), note=note)


def _faults(run: RunReader) -> Table:
    """Table of trials with a fault or with telemetry of the backend."""
    rows: list[dict[str, Value]] = []
    names: dict[str, None] = {}
    for trial in run.trials:
        ending = trial.ending
        if ending.fault is None and not ending.telemetry:
            continue
        numbers = scalars(ending.telemetry)
        names |= dict.fromkeys(numbers)
        fault = ending.fault.value if ending.fault else ""
        rows.append({"trial": trial.trial.number, "fault": fault, "why": ending.reason, **numbers})
    columns = (
        Column("trial", "Trial", exact=True),
        Column("fault", "Fault"),
        Column("why", "Reason"),
        *(Column(name, _label(name), reason=BY_THE_BACKEND()) for name in names),
    )
    note = "What the backend measured of its own work has its unit in the name."
    return Table("faults", "Faults, and the work of the backend", columns, tuple(rows), note=note)


def _label(name: str) -> str:
    return name.replace("_", " ").replace(".", ", ")


def scalars(telemetry: Mapping[str, object], prefix: str = "") -> dict[str, Value]:
    """Scalars of nested tables by dotted name; lists are omitted."""
    values: dict[str, Value] = {}
    for name, value in telemetry.items():
        if isinstance(value, Mapping):
            values |= scalars(value, f"{prefix}{name}.")
        elif value is None or isinstance(value, str | int | float | bool):
            values[prefix + name] = value
    return values
