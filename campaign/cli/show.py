"""`campaign show`: description, course and outcome of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from pydantic import BaseModel

from campaign.archive.layout.header import Truth
from campaign.archive.layout.journal import (
    Decision,
    OperatorStep,
    RunResumed,
    TrialFinished,
    TrialsFollowed,
)
from campaign.archive.layout.journal_summary import Lines
from campaign.archive.layout.record import plain
from campaign.archive.layout.signature_file import has_signature, signature_path
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.cli.damage import say_damaged
from campaign.cli.output import on_a_terminal, print_json, print_line, print_section, print_table
from campaign.errors import ExitCode
from campaign.recording import Outcome
from campaign.text import interval, pretty_unit
from campaign.trial import Tree


def show_archive(
    name: str | None, results: Path, *, as_json: bool, metrics: bool = False
) -> ExitCode:
    """Print a run: facts, ending, tests, failures, decisions and other deviations from the plan.

    `metrics`: also print the archived metrics of each recording.
    """
    run = open_run(find_run(results, name))
    story = run.story
    if as_json:
        print_json(_tree(run, story))
    else:
        _print(run, story)
        if metrics:
            _print_metrics(run)
    return say_damaged(run.path, run.damaged)


def _print(run: RunReader, story: Lines) -> None:
    for label, value in _facts(run):
        if value:
            print_line(f"{label + ':':<13}{value}", 13)
    print_line()
    headings = ("test", "kind", "planned", *(outcome.value for outcome in Outcome))
    tests, shown = _tests(run), on_a_terminal()
    begun = {each.test for each in run.outlines}
    if listed := [row for row in tests if row[0] in begun or not shown]:
        none = [
            each.value for k, each in enumerate(Outcome, 3) if all(row[k] == "0" for row in listed)
        ]
        print_table(headings, listed, spare=(*none, "kind"))
    if idle := [row[0] for row in tests if row[0] not in begun and shown]:
        print_line(f"no trial executed: {', '.join(idle)}")
    failed = [each for each in run.outlines if each.outcome is not Outcome.COMPLETED]
    rows = [(_name(t.number), t.label, t.outcome.value, t.reason) for t in failed]
    print_section(("trial", "what", "outcome", "reason"), rows)
    rows = [(_name(a.trial), str(a.attempt), a.outcome.value, a.reason) for a in _repeated(story)]
    print_section(("trial", "attempt", "outcome", "reason"), rows)
    rows = [(d.at, _name(d.trial), d.decision, d.reason) for d in story.all(Decision)]
    print_section(("when", "trial", "decision", "reason"), rows)
    steps = [(_name(s.trial), s.step, s.answer) for s in story.all(OperatorStep)]
    print_section(("trial", "operator step", "answer"), steps)
    print_section(("stage", "trials", "refused"), [_stage(stage) for stage in run.stages])
    print_section(
        ("resumed", "changes"), [(r.at, "; ".join(r.changes)) for r in story.all(RunResumed)]
    )
    print_section(
        ("damaged", "why"), [(each.place or "the file", each.reason) for each in run.damaged]
    )


def _print_metrics(run: RunReader) -> None:
    rows = [
        (
            trial.trial.name,
            trial.trial.label,
            each.name,
            interval(each.value, *each.combined),
            pretty_unit(each.unit),
            str(each.reason),
        )
        for trial in run.trials
        for each in trial.estimates
    ]
    print_section(("trial", "what", "quantity", "value (95 %)", "unit", "reason"), rows)
    if not rows:
        print_line("this run has no archived metrics")


def _name(trial: int | None) -> str:
    return "" if trial is None else f"trial-{trial:05d}"


def _repeated(story: Lines) -> list[TrialFinished]:
    """All attempts of the trials with more than one."""
    counts = Counter(attempt.trial for attempt in story.attempts)
    several = [attempt for attempt in story.attempts if counts[attempt.trial] > 1]
    return sorted(several, key=lambda attempt: (attempt.trial, attempt.attempt))


def _stage(stage: TrialsFollowed) -> tuple[str, ...]:
    numbers = [trial.number for trial in stage.trials]
    trials = f"{_name(numbers[0])} to {_name(numbers[-1])}" if numbers else "none"
    refused = "; ".join(f"{each.label}: {each.why}" for each in stage.refused)
    return (stage.title, trials, stage.reason or refused)


def _tree(run: RunReader, story: Lines) -> dict[str, object]:
    """JSON tree of the run without samples, SI."""
    return {
        "path": str(run.path),
        "header": run.header.model_dump(
            mode="json", exclude={"sources": True, "truth": {"sources"}}
        ),
        "status": run.status,
        "reason": run.reason,
        "safe_state": run.safe_state,
        "ended": run.ended,
        "trials": [
            {
                "trial": trial.trial.name,
                "test": trial.trial.test,
                "role": trial.trial.role,
                "point": trial.trial.point,
                "outcome": trial.ending.outcome,
                "reason": trial.ending.reason,
                "safe_state": trial.ending.safe_state,
                "started": trial.started,
                "ended": trial.ended,
                "metrics": [
                    plain(asdict(estimate)) | estimate.reason.columns()
                    for estimate in trial.estimates
                ],
                "measured_by": trial.measured_by,
            }
            for trial in run.trials
        ],
        "attempts": _dumped(_repeated(story)),
        "decisions": _dumped(story.all(Decision)),
        "operator_steps": _dumped(story.all(OperatorStep)),
        "stages": [
            {**record, "trials": [trial.number for trial in stage.trials]}
            for record, stage in zip(_dumped(run.stages), run.stages, strict=True)
        ],
        "resumed": _dumped(story.all(RunResumed)),
        "damaged": [vars(damage) for damage in run.damaged],
    }


def _dumped(entries: Iterable[BaseModel]) -> list[dict[str, object]]:
    """Entries of the journal as plain data."""
    return [each.model_dump(mode="json", exclude={"event", "trees"}) for each in entries]


def _facts(run: RunReader) -> list[tuple[str, str]]:
    header = run.header
    versions = ", ".join(f"{name} {version}" for name, version in header.versions.items())
    return [
        ("run", run.name),
        ("status", f"{run.status.value}{f': {run.reason}' if run.reason else ''}"),
        ("safe state", run.safe_state.value),
        ("title", header.title),
        ("archive", str(run.path)),
        ("signature", _signature(run)),
        ("started", header.created),
        ("ended", run.ended),
        ("protocol", header.protocol_name),
        ("backend", header.backend),
        ("only", ", ".join(header.only)),
        ("truth", _truth(header.truth)),
        ("set", "; ".join(f"{path}={value}" for path, value in header.overrides.items())),
        ("operator", header.operator),
        ("notes", header.notes),
        ("tags", ", ".join(header.tags)),
        ("revision", header.git_revision),
        ("versions", versions),
        ("plug-ins", "; ".join(map(_plug_in, header.plugins))),
        ("fingerprint", header.fingerprint),
    ]


def _truth(truth: Truth) -> str:
    """Text on the truths that were simulated in place of the stated benches."""
    if not truth.plants:
        return ""
    names = ", ".join(dict.fromkeys(str(plant.get("name")) for plant in truth.plants.values()))
    return f"{names} ({', '.join(truth.sources)}), simulated in place of the stated bench"


def _signature(run: RunReader) -> str:
    if not (run.sealed and has_signature(run.path)):
        return ""
    return f"{signature_path(run.path).name} (not checked; campaign verify --signer ...)"


def _plug_in(record: Tree) -> str:
    """Text on one kind of an installed package."""
    sha256 = str(record.get("sha256", ""))[:12]
    package = f"{record.get('distribution')} {record.get('version')}"
    return f"{record.get('room')} {record.get('name')} of {package}, sources {sha256}"


def _tests(run: RunReader) -> list[tuple[str, ...]]:
    kinds = {planned.test: planned.kind for planned in run.plan}
    planned = Counter(planned.test for planned in run.plan)
    ended = Counter((each.test, each.outcome) for each in run.outlines)
    return [
        (test, kind, str(planned[test]), *(str(ended[test, outcome]) for outcome in Outcome))
        for test, kind in kinds.items()
    ]
