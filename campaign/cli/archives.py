"""`campaign list`: runs of a results folder, all or a selection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from fnmatch import fnmatchcase
from pathlib import Path

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.run_list import list_runs
from campaign.archive.reading.summary import RunSummary
from campaign.archive.writing.remnants import find_remnants
from campaign.cli.output import bytes_text, print_json, print_note, print_table, print_warning
from campaign.errors import UsageError
from campaign.text import clock

_HEADINGS = (
    "run", "status", "date", "duration", "trials", "failed", "protocol", "backend", "tags", "size",
)  # fmt: skip

_SPARE = ("size", "tags", "backend", "protocol", "date", "duration")
"""Columns that a narrow terminal omits, in this order; the name of a run begins with its date."""


@dataclass(frozen=True)
class Selection:
    """Filter of runs. One of several values of a field must match, but all tags.

    Attributes:
        protocols, benches: names, or patterns such as `veloc*`.
        since, until: ISO 8601, a day or a time; UTC without a zone. A day counts as a whole.
    """

    protocols: Sequence[str] = ()
    since: str = ""
    until: str = ""
    backends: Sequence[str] = ()
    benches: Sequence[str] = ()
    statuses: Sequence[RunStatus] = ()
    tags: Sequence[str] = ()

    def of(self, runs: Sequence[RunSummary]) -> list[RunSummary]:
        """Runs that match; unreadable ones match only an empty selection."""
        first = _time("--since", self.since, at_end=False)
        last = _time("--until", self.until, at_end=True)
        if self == Selection():
            return list(runs)
        return [run for run in runs if not run.problem and self._has(run, first, last)]

    def _has(self, run: RunSummary, first: datetime | None, last: datetime | None) -> bool:
        began = datetime.fromisoformat(run.created)
        return (
            (first is None or began >= first)
            and (last is None or began < last)
            and _any(self.protocols, [run.protocol])
            and _any(self.benches, run.benches)
            and _any(self.backends, [run.backend])
            and (not self.statuses or run.status in self.statuses)
            and set(self.tags) <= set(run.tags)
        )


def _any(wanted: Sequence[str], there: Sequence[str]) -> bool:
    return not wanted or any(fnmatchcase(name, pattern) for pattern in wanted for name in there)


def _time(option: str, text: str, *, at_end: bool) -> datetime | None:
    """Time of `text`; for a day its start, or with `at_end` the start of the next day."""
    if not text:
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UsageError(
            f"{option} {text!r}: is not a date; write 2026-11-21 or 2026-11-21T09:30"
        ) from None
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    whole_day = len(text) <= len("2026-11-21")
    return moment + timedelta(days=1) if at_end and whole_day else moment


def statuses(words: Sequence[str]) -> tuple[RunStatus, ...]:
    """Statuses by name, with a hyphen or a space. Raises UsageError for an unknown one."""
    known = {status.value.replace(" ", "-"): status for status in RunStatus}
    for word in words:
        if word.replace(" ", "-") not in known:
            raise UsageError(f"--status {word!r}: is none of {', '.join(known)}")
    return tuple(known[word.replace(" ", "-")] for word in words)


def list_archives(results: Path, selection: Selection, *, as_json: bool) -> None:
    """Print the selected runs in `results`, the newest first, and why a run is unreadable."""
    runs = list_runs(results)
    shown = selection.of(runs)[::-1]
    if as_json:
        print_json(
            [vars(run) | {"path": str(run.path), "duration_s": _seconds(run)} for run in shown]
        )
    elif not runs:
        print_note(f"{results}: there are no runs; `campaign run` makes one")
    elif not shown:
        print_note(f"{results}: none of {len(runs)} runs matches")
    else:
        print_table(_HEADINGS, [_row(run) for run in shown], spare=_SPARE)
    for path, what in find_remnants(results).items():
        print_warning(f"{path}: is {what}; it can be removed")
    for run in runs:
        if run.problem:
            print_warning(f"{run.name}: {run.problem}")


def _row(run: RunSummary) -> tuple[str, ...]:
    size, seconds = bytes_text(run.bytes), _seconds(run)
    if run.problem:
        return (run.name, "unreadable", "", "", "", "", "", "", "", size)
    return (
        run.name,
        run.status.value if run.status else "",
        f"{datetime.fromisoformat(run.created):%Y-%m-%d %H:%M}",
        "" if seconds is None else clock(seconds),
        f"{run.trials}" if run.trials == run.planned else f"{run.trials} of {run.planned}",
        str(run.failed),
        run.protocol,
        run.backend,
        ", ".join(run.tags),
        size,
    )


def _seconds(run: RunSummary) -> float | None:
    """Duration of the run (s); None without an end."""
    try:
        passed = datetime.fromisoformat(run.ended) - datetime.fromisoformat(run.created)
    except (ValueError, TypeError):
        return None
    return passed.total_seconds()
