"""Consistency of a run: journal, plan, fingerprints and trials."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from campaign.archive.layout.followup_trials import planned_in, stages_in
from campaign.archive.layout.full_plan import FullPlan
from campaign.archive.layout.header import PlannedTrial, RunHeader
from campaign.archive.layout.journal import RunStarted, TrialFinished, TrialMeasured
from campaign.archive.layout.journal_summary import Lines
from campaign.archive.layout.names import entry_names
from campaign.archive.layout.record import TrialRecord
from campaign.archive.reading.damage import DamageList
from campaign.errors import ArchiveError
from campaign.trial import Trial, canonical_json

_BESIDE = {"published", "policy"}
"""Keys of the normalised protocol that determine no trial; its fingerprint excludes them."""


@dataclass(frozen=True)
class TrialFacts:
    """Facts of an archived trial that are compared, without bench and samples.

    Attributes:
        place: path of the trial, for messages.
    """

    place: str
    number: int
    test: str
    kind: str
    role: str
    fingerprint: str
    outcome: str
    reason: str
    safe_state: str

    @classmethod
    def of(cls, place: str, record: TrialRecord, fingerprint: str) -> TrialFacts:
        return cls(
            place=place,
            number=record.number,
            test=str(record.trial["test"]),
            kind=str(record.trial["kind"]),
            role=str(record.trial.get("role", "measurement")),
            fingerprint=fingerprint,
            outcome=record.outcome,
            reason=record.reason,
            safe_state=record.safe_state,
        )


def check_journal(story: Lines, header: RunHeader, place: str, found: DamageList) -> None:
    """Check that all lines are undamaged and that the first line agrees with the header."""
    for number in story.damaged:
        found.add(f"{place}:{number}", "is not a line of a journal")
    started = story.entries[0] if story.entries else None
    if not isinstance(started, RunStarted):
        found.add(place, "does not begin with the start of a run")
    elif started.run != header.name:
        found.add(place, f"is of the run {started.run!r}, not of {header.name!r}")
    elif started.trials != header.trials:
        found.add(place, f"states {started.trials} trials; {header.trials} are planned")


def check_measured(story: Lines, place: str, found: DamageList) -> None:
    """Check that metrics belong to finished trials, and to each at most once."""
    finished: set[str] = set()
    measured: set[str] = set()
    for entry in story.entries:
        if isinstance(entry, TrialFinished):
            finished.add(entry.record)
        elif isinstance(entry, TrialMeasured):
            if entry.record not in finished:
                found.add(place, f"has metrics of trial {entry.trial}, which had not finished")
            if entry.record in measured:
                found.add(place, f"has metrics of trial {entry.trial} twice")
            measured.add(entry.record)


def check_stages(story: Lines, header: RunHeader, place: str, found: DamageList) -> None:
    """Check that follow-up trials continue the plan's numbers and each stage is decided once."""
    stages = stages_in(story.entries)
    numbers = [trial.number for trial in planned_in(stages)]
    if numbers != list(range(header.trials + 1, header.trials + 1 + len(numbers))):
        found.add(place, "numbers trials of later stages otherwise than after the plan's")
    counts = Counter(canonical_json([s.test, s.stage, s.point]) for s in stages)
    for text, count in counts.items():
        if count > 1:
            found.add(place, f"names the trials of a stage {count} times at {text}")


def check_trials(
    story: Lines, there: Mapping[str, TrialFacts], unreadable: Iterable[str], found: DamageList
) -> None:
    """Check that finished trials exist with the journal's ending; `unreadable` are reported."""
    attempts = entry_names(story.attempts)
    for entry in attempts.keys() - there.keys() - set(unreadable):
        found.add(f"/{entry}", "is missing, and the journal says that it finished")
    for entry, trial in there.items():
        finished = attempts.get(entry)
        if finished is None:
            found.add(trial.place, "is there, and no line of the journal says that it finished")
            continue
        for what in ("outcome", "reason", "safe_state"):
            actual, expected = str(getattr(trial, what)), str(getattr(finished, what))
            if actual != expected:
                found.add(trial.place, f"has {what} {actual!r}, and the journal says {expected!r}")


def check_plan(
    plan: tuple[PlannedTrial, ...],
    header: RunHeader,
    there: Iterable[TrialFacts],
    place: str,
    found: DamageList,
    followed: int = 0,
) -> None:
    """Check each executed trial against the plan, which has `followed` more than the header."""
    if len(plan) - followed != header.trials:
        what = f"has {len(plan) - followed} trials, and the header says {header.trials}"
        found.add(place, what)
    planned = {trial.number: trial for trial in plan}
    for trial in there:
        wanted = planned.get(trial.number)
        if wanted is None:
            found.add(trial.place, "is not in the plan")
            continue
        for what in ("test", "kind", "role", "fingerprint"):
            actual, expected = getattr(trial, what), str(getattr(wanted, what))
            if actual != expected:
                found.add(trial.place, f"has {what} {actual!r}, and the plan says {expected!r}")


def check_full_plan(
    full: FullPlan,
    plan: tuple[PlannedTrial, ...],
    place: str,
    found: DamageList,
) -> None:
    """Check the full description of each planned trial against its fingerprint in the plan."""
    if len(full) != len(plan):
        found.add(place, f"has {len(full)} trials, and the plan has {len(plan)}")
        return
    for planned in plan:
        with found.noting():
            trial: Trial = full.trial(planned.number)
            if trial.fingerprint != planned.fingerprint:
                raise ArchiveError(
                    f"{found.path}: {place}: trial {planned.number} does not match its fingerprint"
                )


def check_protocol(header: RunHeader, place: str, found: DamageList) -> None:
    """Check the normalised protocol against its fingerprint in the header."""
    if not header.fingerprint and not header.normalised:
        return
    what = {name: tree for name, tree in header.normalised.items() if name not in _BESIDE}
    digest = hashlib.sha256(canonical_json(what).encode()).hexdigest()
    if digest != header.fingerprint:
        found.add(place, "the normalised protocol does not match its fingerprint")
