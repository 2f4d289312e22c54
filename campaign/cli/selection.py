"""Selection of runs for `campaign list`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from fnmatch import fnmatchcase

from campaign.archive import RunStatus, RunSummary
from campaign.errors import UsageError


@dataclass(frozen=True)
class Selection:
    """What a run must be. Of several values of one kind any will do, but every tag must be there.

    Attributes:
        protocols, benches: names, or patterns such as `veloc*`.
        since, until: ISO 8601, a day or a time; in UTC where there is no zone. A day is whole.
    """

    protocols: Sequence[str] = ()
    since: str = ""
    until: str = ""
    backends: Sequence[str] = ()
    benches: Sequence[str] = ()
    statuses: Sequence[RunStatus] = ()
    tags: Sequence[str] = ()

    def of(self, runs: Sequence[RunSummary]) -> list[RunSummary]:
        """The runs that are so; one that cannot be read is so only when nothing is asked for."""
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
    """The moment that `text` means; of a day its beginning, or that of the next one."""
    if not text:
        return None
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise UsageError(
            f"{option} {text!r}: is no date; write 2026-11-21 or 2026-11-21T09:30"
        ) from None
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    whole_day = len(text) <= len("2026-11-21")
    return moment + timedelta(days=1) if at_end and whole_day else moment


def statuses(words: Sequence[str]) -> tuple[RunStatus, ...]:
    """Statuses by name, a hyphen for a space; UsageError naming them all."""
    known = {status.value.replace(" ", "-"): status for status in RunStatus}
    for word in words:
        if word.replace(" ", "-") not in known:
            raise UsageError(f"--status {word!r}: is none of {', '.join(known)}")
    return tuple(known[word.replace(" ", "-")] for word in words)
