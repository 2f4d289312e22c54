"""The state of a run from its journal, including one with damaged lines."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from campaign.archive.layout.files import read_errors
from campaign.archive.layout.header import PlannedTrial
from campaign.archive.layout.journal import (
    ENTRY,
    Entry,
    RunEnded,
    RunResumed,
    RunStarted,
    TrialFinished,
    TrialMeasured,
    TrialsFollowed,
)
from campaign.archive.layout.json_lines import line_places, parse_at_once
from campaign.errors import ArchiveError
from campaign.trial import Outcome

_ENTRIES: TypeAdapter[list[Entry]] = TypeAdapter(list[Entry])
_MEASURED = re.compile(rb'"event":"trial measured","record":"([0-9a-f]{64})"')
"""Matches a written line only: within a text, quotes have a backslash."""
_Kind = TypeVar("_Kind", bound=Entry)


@dataclass(frozen=True)
class Lines:
    """A journal, read line by line.

    Attributes:
        entries: the valid lines, in order.
        damaged: numbers of the invalid lines, from 1.
        torn: whether the last line is incomplete; it was never reported, so it is no damage.
        size: of the reported lines (bytes), damaged ones included.
        content: the reported lines; empty from `read_journal`.
        measured: places (bytes) of unparsed lines with metrics, by the digest of the trial's
            record; filled only in lean reading, and then `entries` does not contain them.
    """

    entries: tuple[Entry, ...]
    damaged: tuple[int, ...]
    torn: bool
    size: int
    content: bytes = field(repr=False)
    measured: Mapping[str, slice] = field(default_factory=dict, repr=False)

    @property
    def begins(self) -> bool:
        """Whether the first line is the start of a run."""
        return bool(self.entries) and isinstance(self.entries[0], RunStarted)

    @property
    def whole(self) -> bool:
        """Whether it begins with the start of a run, and all lines are complete and valid."""
        return self.begins and not self.damaged and not self.torn

    @property
    def text(self) -> str:
        """`content` as text; invalid bytes are replaced."""
        return self.content.decode("utf-8", "replace")

    @cached_property
    def finished(self) -> dict[int, TrialFinished]:
        """The last attempt of each trial, by trial number, in their order."""
        return dict(sorted({e.trial: e for e in self.attempts}.items()))

    @property
    def interrupted(self) -> int:
        """Number of interrupted trials, which do not count as failed."""
        return sum(each.outcome is Outcome.INTERRUPTED for each in self.finished.values())

    @cached_property
    def attempts(self) -> list[TrialFinished]:
        """All finished attempts, in the order of finishing; of repeated lines the last counts."""
        attempts: dict[tuple[int, int], TrialFinished] = {}
        for each in self.all(TrialFinished):
            attempts.pop((each.trial, each.attempt), None)
            attempts[each.trial, each.attempt] = each
        return list(attempts.values())

    @cached_property
    def stages(self) -> tuple[TrialsFollowed, ...]:
        """The stages, in order."""
        return tuple(self.all(TrialsFollowed))

    @property
    def followed(self) -> tuple[PlannedTrial, ...]:
        """The trials of the stages, as lines of a plan."""
        return tuple(trial for stage in self.stages for trial in stage.trials)

    @property
    def ended(self) -> RunEnded | None:
        """The end of the run; None if it is in progress or was resumed later."""
        for entry in reversed(self.entries):
            if isinstance(entry, RunEnded):
                return entry
            if isinstance(entry, RunResumed):
                return None
        return None

    def measured_of(self, record: str) -> TrialMeasured | None:
        """The parsed line of `measured` for the digest of a record, or None."""
        entry = _parse(self.content[self.measured.get(record, slice(0))])
        return entry if isinstance(entry, TrialMeasured) else None

    def all(self, kind: type[_Kind]) -> list[_Kind]:
        """The lines of one kind."""
        return [entry for entry in self.entries if isinstance(entry, kind)]


def read_journal(path: Path) -> Lines:
    """Read the journal of a folder without metrics. Raises ArchiveError with an invalid line."""
    with read_errors(path):
        lines = read_lines(path.read_bytes(), lean=True)
    for number in lines.damaged:
        raise ArchiveError(f"{path}:{number}: is not a line of a journal")
    if not lines.begins:
        raise ArchiveError(f"{path}: does not begin with the start of a run")
    return replace(lines, content=b"")


def read_lines(content: bytes, *, lean: bool = False) -> Lines:
    """Read a journal that may be damaged.

    `lean`: keep lines with metrics unparsed, which takes a tenth of the memory.
    """
    places = list(line_places(content))
    measured: dict[str, slice] = {}
    numbers = []
    for number, place in enumerate(places, start=1):
        match = _MEASURED.search(content, place.start, place.stop) if lean else None
        if match is None:
            numbers.append(number)
        else:
            measured[match[1].decode()] = place
    to_parse = [content[places[number - 1]] for number in numbers]
    parsed: list[Entry | None] = list(parse_at_once(_ENTRIES, to_parse) or map(_parse, to_parse))
    damaged = [number for number, entry in zip(numbers, parsed, strict=True) if entry is None]
    whole = len(places)
    if damaged and damaged[-1] == whole:  # a power cut may leave an invalid last line
        whole -= 1
        damaged.pop()
    end = places[whole - 1].stop + 1 if whole else 0
    return Lines(
        entries=tuple(entry for entry in parsed if entry is not None),
        damaged=tuple(damaged),
        torn=end < len(content),
        size=end,
        content=content[:end],
        measured=measured,
    )


def _parse(line: bytes) -> Entry | None:
    with suppress(ValidationError):
        return ENTRY.validate_json(line)  # takes half the time, but rejects lone surrogates
    try:
        return ENTRY.validate_python(json.loads(line))
    except (ValidationError, ValueError, RecursionError):
        return None
