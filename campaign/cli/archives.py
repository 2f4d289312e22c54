"""`campaign list`."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from campaign.archive import RunSummary, list_runs
from campaign.archive.writing.remnants import find_remnants
from campaign.cli.output import bytes_text, print_json, print_note, print_table
from campaign.cli.selection import Selection

_HEADINGS = (
    "run", "status", "date", "duration", "trials", "failed", "protocol", "backend", "tags", "size",
)  # fmt: skip

_SPARE = ("size", "tags", "backend", "protocol", "date", "duration")
"""What a narrow terminal does without first; the name of a run begins with its date."""


def list_archives(results: Path, selection: Selection, *, as_json: bool) -> None:
    """The runs in `results`, the newest first; one that cannot be read says why."""
    runs = list_runs(results)
    shown = selection.of(runs)[::-1]
    if as_json:
        print_json([_tree(run) for run in shown])
    elif not runs:
        print_note(f"{results}: there are no runs; `campaign run` makes one")
    elif not shown:
        print_note(f"{results}: none of {len(runs)} runs is like that")
    else:
        print_table(_HEADINGS, [_row(run) for run in shown], spare=_SPARE)
    for path, what in find_remnants(results).items():
        print_note(f"{path}: is {what}; it can be removed", style="yellow")
    for run in runs:
        if run.problem:
            print_note(f"{run.name}: {run.problem}", style="yellow")


def _row(run: RunSummary) -> tuple[str, ...]:
    size = bytes_text(run.bytes)
    if run.problem:
        return (run.name, "unreadable", "", "", "", "", "", "", "", size)
    return (
        run.name,
        run.status.value if run.status else "",
        f"{datetime.fromisoformat(run.created):%Y-%m-%d %H:%M}",
        _duration(run),
        f"{run.trials}" if run.trials == run.planned else f"{run.trials} of {run.planned}",
        str(run.failed),
        run.protocol,
        run.backend,
        ", ".join(run.tags),
        size,
    )


def _seconds(run: RunSummary) -> float | None:
    """From the run's start to its end (s); None while it has none."""
    try:
        passed = datetime.fromisoformat(run.ended) - datetime.fromisoformat(run.created)
    except (ValueError, TypeError):
        return None
    return passed.total_seconds()


def _duration(run: RunSummary) -> str:
    seconds = _seconds(run)
    if seconds is None:
        return ""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"


def _tree(run: RunSummary) -> dict[str, object]:
    more = {"path": str(run.path), "duration_s": _seconds(run)}
    return vars(run) | more
