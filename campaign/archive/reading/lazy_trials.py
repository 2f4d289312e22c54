"""The executed trials of a run, each parsed when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from sys import intern
from typing import NamedTuple, Self, overload
from weakref import WeakValueDictionary

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.recording import Outcome


class Outline(NamedTuple):
    """What stays of a trial that was parsed and let go of."""

    number: int
    test: str
    kind: str
    label: str
    outcome: Outcome
    reason: str

    @classmethod
    def of(cls, archived: ArchivedTrial) -> Self:
        """Of a trial; equal texts are kept once."""
        trial, ending = archived.trial, archived.ending
        test, kind, label = intern(trial.test), intern(trial.kind), intern(trial.label)
        return cls(trial.number, test, kind, label, ending.outcome, intern(ending.reason))


class LazyTrials(Sequence[ArchivedTrial]):
    """Trials that are parsed when they are asked for, and kept as long as somebody holds them."""

    def __init__(
        self,
        outlines: Sequence[Outline],
        read: Callable[[int], ArchivedTrial],
        parsed: WeakValueDictionary[int, ArchivedTrial] | None = None,
    ) -> None:
        """`read` parses the trial of a number; `parsed` are those that somebody holds."""
        self.outlines = outlines
        self._read = read
        self._parsed = WeakValueDictionary() if parsed is None else parsed

    def of(self, test: str) -> LazyTrials:
        """Those of one test."""
        wanted = [outline for outline in self.outlines if outline.test == test]
        return LazyTrials(wanted, self._read, self._parsed)

    def __reduce__(self) -> tuple[object, ...]:
        return LazyTrials, (self.outlines, self._read)

    def __eq__(self, other: object) -> bool:
        """As a tuple of them."""
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    def __len__(self) -> int:
        return len(self.outlines)

    @overload
    def __getitem__(self, place: int) -> ArchivedTrial: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[ArchivedTrial]: ...
    def __getitem__(self, place: int | slice) -> ArchivedTrial | Sequence[ArchivedTrial]:
        if isinstance(place, slice):
            return LazyTrials(self.outlines[place], self._read, self._parsed)
        number = self.outlines[place].number
        if (found := self._parsed.get(number)) is None:
            found = self._parsed[number] = self._read(number)
        return found
