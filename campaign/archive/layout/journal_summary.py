"""The state of a run from its journal, including one with damaged lines."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from campaign.archive.layout.journal import (
    Entry,
    RunEnded,
    RunResumed,
    RunStarted,
    TrialFinished,
    TrialMeasured,
)
from campaign.archive.layout.json_lines import parse_at_once
from campaign.trial import Outcome

_ENTRY: TypeAdapter[Entry] = TypeAdapter(Entry)
_ENTRIES: TypeAdapter[list[Entry]] = TypeAdapter(list[Entry])
_MEASURED = re.compile(rb'"event":"trial measured","record":"([0-9a-f]{64})"')
"""In a line as it is written; within a text, quotes have a backslash."""
_Kind = TypeVar("_Kind", bound=Entry)


@dataclass(frozen=True)
class Lines:
    """A journal, read line by line.

    Attributes:
        entries: the lines that can be understood, in order.
        damaged: numbers, from 1, of those that cannot.
        torn: whether a last line was begun and never reported, which is no damage.
        content: the lines that were reported, damaged ones included.
        measured: lines that tell what was measured, by the digest of the trial's record, as far as
            they were asked to be kept so; `entries` is without them.
    """

    entries: tuple[Entry, ...]
    damaged: tuple[int, ...]
    torn: bool
    content: bytes = field(repr=False)
    measured: Mapping[str, bytes] = field(default_factory=dict, repr=False)

    @property
    def whole(self) -> bool:
        """Whether it begins as a journal does, and every line can be understood."""
        begins = bool(self.entries) and isinstance(self.entries[0], RunStarted)
        return begins and not self.damaged and not self.torn

    @property
    def text(self) -> str:
        """Of `content`; what is no text in it is replaced."""
        return self.content.decode("utf-8", "replace")

    @cached_property
    def finished(self) -> dict[int, TrialFinished]:
        """By trial, in the order of their numbers; of several attempts the last one counts."""
        return dict(sorted({e.trial: e for e in self.all(TrialFinished)}.items()))

    @property
    def interrupted(self) -> int:
        """How many trials somebody stopped, which have not failed."""
        return sum(each.outcome is Outcome.INTERRUPTED for each in self.finished.values())

    @cached_property
    def attempts(self) -> list[TrialFinished]:
        """Every finished attempt, in the order they finished; a line that was repeated once."""
        return list({(e.trial, e.attempt): e for e in self.all(TrialFinished)}.values())

    @property
    def ended(self) -> RunEnded | None:
        """How the run ended; None while it is in progress, or when it was resumed since."""
        for entry in reversed(self.entries):
            if isinstance(entry, RunEnded):
                return entry
            if isinstance(entry, RunResumed):
                return None
        return None

    def measured_of(self, record: str) -> TrialMeasured | None:
        """What a line of `measured` tells."""
        entry = _parse(self.measured.get(record, b""))
        return entry if isinstance(entry, TrialMeasured) else None

    def all(self, kind: type[_Kind]) -> list[_Kind]:
        """The lines of one kind."""
        return [entry for entry in self.entries if isinstance(entry, kind)]


def read_lines(content: bytes, *, lean: bool = False) -> Lines:
    """Read a journal, whatever is left of it.

    `lean`: keep what was measured as it is written, which takes a tenth of the memory.
    """
    *lines, rest = content.split(b"\n")
    found = [_MEASURED.search(line) if lean else None for line in lines]
    left = {match[1].decode(): match.string for match in found if match}
    numbers = [number for number, match in enumerate(found, start=1) if match is None]
    told = [lines[number - 1] for number in numbers]
    together = parse_at_once(_ENTRIES, told)
    parsed: list[Entry | None] = list(together or map(_parse, told))
    entries = [entry for entry in parsed if entry is not None]
    damaged = [number for number, entry in zip(numbers, parsed, strict=True) if entry is None]
    torn = bool(rest)
    if damaged and damaged[-1] == len(lines):  # a power cut may leave a last line of rubbish
        lines, damaged, torn = lines[:-1], damaged[:-1], True
    return Lines(
        entries=tuple(entries),
        damaged=tuple(damaged),
        torn=torn,
        content=b"".join(line + b"\n" for line in lines),
        measured=left,
    )


def _parse(line: bytes) -> Entry | None:
    with suppress(ValidationError):
        return _ENTRY.validate_json(line)  # takes half the time, and refuses lone surrogates
    try:
        return _ENTRY.validate_python(json.loads(line))
    except (ValidationError, ValueError, RecursionError):
        return None
