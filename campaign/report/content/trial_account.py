"""Content of a trial's page, in display units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from campaign.api.analysis import AnalysedTest
from campaign.api.quantity_words import plain
from campaign.archive.layout.journal import Decision, OperatorStep
from campaign.archive.layout.journal_summary import Lines
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import trial_number
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.sound_samples import sound_part
from campaign.axis_kind import axis_terms, in_axis_terms, sides_in
from campaign.channels import COMMAND
from campaign.errors import ArchiveError, CampaignError
from campaign.estimate import Estimate, Window
from campaign.experiments.interface import Experiment, bench_of, options_of
from campaign.recording import Recording
from campaign.report.content.incidents import attempts_table, scalars
from campaign.report.content.settings import (
    point_settings,
    settings_of,
    task_settings,
    tree_settings,
)
from campaign.result import Column, Table, Value
from campaign.text import interval, number, pretty_unit
from campaign.trial import Role, Trial
from campaign.units import convert

SHOWN = {"rad/s": "deg/s", "rad/s^2": "deg/s^2", "m/s": "mm/s", "m/s^2": "mm/s^2"}
"""Display unit by the SI unit of a metric."""
COARSE_AND_FINE = {"rad": ("deg", "mrad"), "m": ("mm", "um")}
"""Display units of large and of small values, by SI unit."""
SHARES = ("time_stuck",)
"""Metrics that are a share of the time."""
ONE_STEP = 1.5
"""Tolerance in sampling steps: one step and rounding."""
SMALL = 0.01
"""rad."""
SMALL_TRAVEL = 1e-4
"""m."""
POINT = "Place in the sweep"
WITHOUT = ("name", "description", "known")
"""Fields of a bench that are shown elsewhere, or are no physical properties."""

Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class TrialAccount:
    """Content of a trial's page, independent of the page.

    Attributes:
        number: number of the trial.
        title: title of its test.
        heading: title with role and sweep point of the trial.
        label: label in plan and commands.
        facts: outcome, times, seed and so on.
        digests: group in the archive, and fingerprint.
        settings: name and text of each setting, by group (`Task`, `Options of the test`, ...).
        tables: metrics, events, attempts, decisions; only those with rows.
        windows: recorded parts of the analysis windows.
        recording: without damaged channels; None without samples.
        why_empty: reason for missing samples; empty with samples.
        damaged: damage of the trial.
        not_reached: sentences on windows that were not recorded completely.
    """

    number: int
    title: str
    heading: str
    label: str
    facts: Pairs
    digests: Pairs
    settings: Mapping[str, Pairs]
    tables: tuple[Table, ...]
    windows: tuple[Window, ...]
    recording: Recording | None
    why_empty: str
    damaged: tuple[Damage, ...]
    not_reached: tuple[str, ...] = ()


def account_of(
    run: RunReader, archived: ArchivedTrial, story: Lines, test: AnalysedTest | None
) -> TrialAccount:
    """Account of an executed trial; `story` is the run's journal."""
    with axis_terms(sides_in(archived.trial.bench)):
        return _account(run, archived, story, test)


def _account(
    run: RunReader, archived: ArchivedTrial, story: Lines, test: AnalysedTest | None
) -> TrialAccount:
    trial = archived.trial
    recording, damaged = sound_part(run.path, archived)
    known = [damage for damage in run.damaged if trial_number(damage) == trial.number]
    if recording is not None and not recording.channels and not damaged:
        recording = None
    settings = _settings(archived, test.experiment if test else None)
    title = test.title if test else trial.test
    point = ", ".join(f"{name} {value}" for name, value in settings.get(POINT, ()))
    wanted = archived.windows or trial.windows or (Window("window", *trial.task.window),)
    windows, not_reached = _recorded(wanted, recording)
    role = "" if trial.role is Role.MEASUREMENT else f" ({trial.role})"
    return TrialAccount(
        trial.number,
        title,
        f"{title}{role}{f': {point}' if point else ''}",
        trial.label,
        tuple((name, value) for name, value in _facts(archived, recording) if value),
        (*_place(archived.entry), ("Fingerprint of bench, task and seed", trial.fingerprint)),
        settings,
        tuple(table for table in _tables(archived, recording, story) if table.rows),
        windows,
        recording,
        "" if recording is not None else _why_empty(archived, damaged),
        tuple(dict.fromkeys((*known, *damaged))),
        not_reached,
    )


def _recorded(
    wanted: Iterable[Window], recording: Recording | None
) -> tuple[tuple[Window, ...], tuple[str, ...]]:
    """Recorded parts of windows, and sentences on the missing parts; both empty without samples.

    A window excludes a sample at its end. Therefore one step after the last sample counts as
    recorded.
    """
    if recording is None or not len(recording.time):
        return (), ()
    first, last = float(recording.time[0]), float(recording.time[-1])
    step = (last - first) / max(len(recording.time) - 1, 1)
    windows, missing = [], []
    for each in wanted:
        span = f"{each.name}, {number(each.start)} to {number(each.stop)} s"
        if each.start > last:
            missing.append(f"Not reached: {span}; the recording ends at {number(last)} s.")
            continue
        if each.stop <= first:
            missing.append(f"Not recorded: {span}; the recording begins at {number(first)} s.")
            continue
        stop = each.stop
        if stop > last + ONE_STEP * step:
            stop = last
            missing.append(f"Not recorded to its end: {span}; the recording ends before.")
        start = each.start if first <= each.start + ONE_STEP * step else first
        windows.append(replace(each, start=start, stop=stop))
    return tuple(windows), tuple(missing)


def lost_account(run: RunReader, lost: int) -> TrialAccount:
    """Account of an executed trial that cannot be read, from the plan."""
    damaged = tuple(damage for damage in run.damaged if trial_number(damage) == lost)
    planned = next((each for each in run.plan if each.number == lost), None)
    label = planned.label if planned else f"trial {lost}"
    facts = (("Test", f"{planned.test} ({planned.kind})"),) if planned else ()
    digests = (("Fingerprint of bench, task and seed", planned.fingerprint),) if planned else ()
    why = "The trial cannot be read."
    return TrialAccount(lost, label, label, label, facts, digests, {}, (), (), None, why, damaged)


def _place(entry: str) -> Pairs:
    return (("Group in the archive", entry),) if entry else ()


def _why_empty(archived: ArchivedTrial, damaged: tuple[Damage, ...]) -> str:
    if archived.not_kept:
        return f"Its samples were not kept: {archived.not_kept}."
    return "Its samples cannot be read." if damaged else "It recorded no samples."


def _facts(archived: ArchivedTrial, recording: Recording | None) -> Iterator[tuple[str, str]]:
    trial, ending = archived.trial, archived.ending
    yield "Test", trial.test
    yield "Experiment", trial.kind
    yield "Purpose", str(trial.role)
    yield "Repetition", str(trial.repeat) if trial.repeat > 1 else ""
    yield "Outcome", f"{ending.outcome}{f': {ending.reason}' if ending.reason else ''}"
    yield "Fault", str(ending.fault or "")
    yield "Safe state afterwards", str(ending.safe_state)
    yield "Started", archived.started
    yield "Ended", archived.ended
    if recording is not None and len(recording.time):
        yield "Recorded", f"{len(recording.time)} samples, {number(recording.time[-1], 6)} s"
    yield "Seed", str(trial.seed)
    yield "Note of the plan", trial.note
    yield "Done by hand before", "; ".join(trial.setup)
    yield "Measured by", archived.measured_by


def _settings(archived: ArchivedTrial, experiment: Experiment | None) -> dict[str, Pairs]:
    trial = archived.trial
    options = _options(trial, experiment)
    try:
        bench = bench_of(trial)
        properties = tuple(settings_of(bench, WITHOUT))
    except (ValueError, CampaignError):  # another version, or a plug-in that is not installed
        bench, properties = None, tuple(tree_settings(trial.bench))
    command = _command(archived)
    groups = {
        POINT: tuple(point_settings(trial.point, options, bench)),
        "Task": tuple(task_settings(trial.task, command)),
        "Options of the test": tuple(
            tree_settings(trial.options)
            if options is None
            # Analyses add defaults; an imported trial was not executed with them.
            else settings_of(
                options,
                (*options.without_effect(), *(type(options).model_fields.keys() - trial.options)),
            )
        ),
        "Bench": (("name", bench.name), *properties) if bench else properties,
        "Work of the backend": tuple(
            (name.replace(".", ": ").replace("_", " "), plain(value))
            for name, value in scalars(archived.ending.telemetry).items()
            if value not in (None, "")
        ),
    }
    return {name: pairs for name, pairs in groups.items() if pairs}


def _options(trial: Trial, experiment: Experiment | None) -> Any:
    try:
        return None if experiment is None else options_of(experiment, trial.options)
    except (ValueError, CampaignError):  # another version of the experiment
        return None


def _command(archived: ArchivedTrial) -> Any:
    try:
        return next((each for each in archived.channels() if each.name == COMMAND), None)
    except ArchiveError:
        return None


def _tables(archived: ArchivedTrial, recording: Recording | None, story: Lines) -> Iterator[Table]:
    """Tables of metrics, events, attempts and decisions of the trial."""
    yield Table(
        "metrics",
        "Metrics of the recording",
        (
            Column("name", "Quantity"),
            Column("value", "Value, 95 % interval"),
            Column("unit", "Unit"),
            Column("reason", "Remark on the interval"),
        ),
        tuple(map(_metric, archived.estimates)),
    )
    events = recording.events if recording is not None else ()
    yield Table(
        "events",
        "What happened meanwhile",
        (Column("time", "Time", "s", "s", exact=True), Column("text", "Event")),
        tuple({"time": event.time, "text": event.text} for event in events),
    )
    attempts = attempts_table(story)
    yield replace(
        attempts,
        title="Attempts",
        columns=tuple(each for each in attempts.columns if each.name != "trial"),
        rows=tuple(row for row in attempts.rows if row["trial"] == archived.trial.number),
    )
    yield Table(
        "decisions",
        "What was decided and done by hand",
        (Column("at", "When"), Column("what", "What"), Column("why", "Reason or answer")),
        tuple(_decisions(archived.trial.number, story)),
    )


def _metric(found: Estimate) -> Mapping[str, Value]:
    unit = "percent" if found.name in SHARES else SHOWN.get(found.unit, found.unit)
    if unit in COARSE_AND_FINE:
        coarse, fine = COARSE_AND_FINE[unit]
        small = SMALL if unit == "rad" else SMALL_TRAVEL
        unit = fine if abs(found.value) < small else coarse
    ends = (found.value, *found.combined)
    value, low, high = (None if e is None else convert(e, found.unit, unit) for e in ends)
    return {
        "name": in_axis_terms(found.name.replace("_", " ")),
        "value": interval(value, low, high),
        "unit": pretty_unit(unit),
        "reason": str(found.reason),
    }


def _decisions(trial: int, story: Lines) -> Iterator[Mapping[str, Value]]:
    for entry in story.entries:
        if isinstance(entry, Decision) and entry.trial == trial:
            yield {"at": entry.at, "what": entry.decision, "why": entry.reason}
        elif isinstance(entry, OperatorStep) and entry.trial == trial:
            yield {"at": entry.at, "what": entry.step, "why": entry.answer}
