"""`campaign list`, `campaign show` and `campaign init`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from campaign.archive import RunReader, RunSummary, find_run, list_runs, open_run
from campaign.cli.output import bytes_text, print_line, print_note, print_table
from campaign.resources import copy_shipped
from campaign.trial import Outcome


def list_archives(results: Path) -> None:
    """The runs in `results`, the newest first; one that cannot be read says why."""
    runs = list_runs(results)
    if not runs:
        print_note(f"{results}: there are no runs; `campaign run` makes one")
        return
    headings = ("run", "status", "trials", "failed", "protocol", "backend", "size")
    print_table(headings, [_row(run) for run in reversed(runs)])
    for run in runs:
        if run.problem:
            print_note(f"{run.name}: {run.problem}", style="yellow")


def show_archive(name: str, results: Path) -> None:
    """What a run was, how it ended, its tests, and the trials that failed."""
    run = open_run(find_run(results, name))
    for label, value in _facts(run):
        if value:
            print_line(f"{label + ':':<13}{value}")
    print_line()
    headings = ("test", "kind", "planned", *(outcome.value for outcome in Outcome))
    print_table(headings, _tests(run))
    failed = [trial for trial in run.trials if trial.ending.outcome is not Outcome.COMPLETED]
    if failed:
        print_line()
        rows = [
            (t.trial.name, t.trial.label, t.ending.outcome.value, t.ending.reason) for t in failed
        ]
        print_table(("trial", "what", "outcome", "reason"), rows)


def init_folder(folder: Path) -> None:
    """Copy what is shipped into `folder` and say how to go on."""
    written = copy_shipped(folder)
    print_line(f"{len(written)} files written to {folder}")
    print_line(f"now: campaign run {folder / 'protocols' / 'quickstart.toml'} --report")


def _row(run: RunSummary) -> tuple[str, ...]:
    if run.problem:
        return (run.name, "unreadable", "", "", "", "", bytes_text(run.bytes))
    trials = f"{run.trials}" if run.trials == run.planned else f"{run.trials} of {run.planned}"
    status = run.status.value if run.status else ""
    size = bytes_text(run.bytes)
    return (run.name, status, trials, str(run.failed), run.protocol, run.backend, size)


def _facts(run: RunReader) -> list[tuple[str, str]]:
    header = run.header
    versions = ", ".join(f"{name} {version}" for name, version in header.versions.items())
    return [
        ("run", run.name),
        ("title", header.title),
        ("archive", str(run.path)),
        ("status", f"{run.status.value}{f': {run.reason}' if run.reason else ''}"),
        ("safe state", run.safe_state.value),
        ("started", header.created),
        ("ended", run.ended),
        ("protocol", header.protocol_name),
        ("backend", header.backend),
        ("only", ", ".join(header.only)),
        ("set", "; ".join(f"{path}={value}" for path, value in header.overrides.items())),
        ("operator", header.operator),
        ("notes", header.notes),
        ("tags", ", ".join(header.tags)),
        ("revision", header.git_revision),
        ("versions", versions),
        ("fingerprint", header.fingerprint),
    ]


def _tests(run: RunReader) -> list[tuple[str, ...]]:
    kinds = {planned.test: planned.kind for planned in run.plan}
    planned = Counter(planned.test for planned in run.plan)
    ended = Counter((trial.trial.test, trial.ending.outcome) for trial in run.trials)
    return [
        (test, kind, str(planned[test]), *(str(ended[test, outcome]) for outcome in Outcome))
        for test, kind in kinds.items()
    ]
