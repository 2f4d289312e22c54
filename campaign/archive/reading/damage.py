"""Damage of a run, item by item; the rest stays readable."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self, TypeVar

from campaign.archive.layout.names import TRIAL_FILE
from campaign.errors import ArchiveError

_Read = TypeVar("_Read")

_ENTRY = re.compile(r"trial_(\d{5,10})(?:_attempt_(\d{1,6}))?(?:/(?:data|preview)/(\w+))?")


@dataclass(frozen=True)
class Damage:
    """An item of a run that is unreadable or wrong.

    Attributes:
        place: in the archive, e.g. `/trial_00002/data/gyro_rate`, `journal.jsonl:3` or
            `trial-00002.trial`; empty for the file as a whole.
        reason: the problem, in one line.
        trial: the trial's name, e.g. `trial-00002`, or `trial-00002 (attempt 1)` for an earlier
            attempt. Empty if the damage is not of one trial.
        channel: the channel's name, if its samples are damaged.
    """

    place: str
    reason: str
    trial: str = ""
    channel: str = ""

    def __str__(self) -> str:
        return f"{self.place}: {self.reason}" if self.place else self.reason

    @classmethod
    def at(cls, place: str, reason: str) -> Self:
        """Damage at a place in the archive; trial and channel follow from the place."""
        match = _ENTRY.search(place) or TRIAL_FILE.search(place)
        if match is None:
            return cls(place, reason)
        number, attempt, *channel = match.groups(default="")
        trial = f"trial-{number}" + (f" (attempt {attempt})" if attempt else "")
        return cls(place, reason, trial, channel[0] if channel else "")

    @classmethod
    def of(cls, path: Path, error: ArchiveError) -> Self:
        """Damage from an error with a message like `file: /place/in/it: what is wrong`.

        Args:
            path: the sealed file, or the folder of a run in progress.
            error: raised while reading it.
        """
        text = str(error)
        if not text.startswith(str(path)):
            return cls("", text)
        file, _, what = text.removeprefix(str(path)).lstrip("/").partition(": ")
        inner = ""
        if what.startswith("/") and ": " in what:
            inner, _, what = what.partition(": ")
        return cls.at(file + inner, what)


class DamageList:
    """List of the damage found while reading the run at `path`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: list[Damage] = []

    def add(self, place: str, reason: str) -> None:
        self.found.append(Damage.at(place, reason))

    def note(self, error: ArchiveError) -> None:
        """Add the damage that an error reports."""
        self.found.append(Damage.of(self.path, error))

    def read(self, what: Callable[[], _Read], instead: _Read) -> _Read:
        """Result of `what`; if it raises ArchiveError, note the damage and return `instead`."""
        try:
            return what()
        except ArchiveError as error:
            self.note(error)
            return instead

    @contextlib.contextmanager
    def noting(self) -> Iterator[None]:
        """Note an ArchiveError raised in the block; execution continues after the block."""
        try:
            yield
        except ArchiveError as error:
            self.note(error)
