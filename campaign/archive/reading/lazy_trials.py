"""The executed trials of a run, each parsed on access."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from sys import intern
from typing import NamedTuple, Self, overload
from weakref import WeakValueDictionary

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.recording import Outcome


class Outline(NamedTuple):
    """Short description of a trial, kept in place of the parsed trial."""

    number: int
    test: str
    kind: str
    label: str
    outcome: Outcome
    reason: str

    @classmethod
    def of(cls, archived: ArchivedTrial) -> Self:
        """Outline of a trial; equal texts share memory."""
        trial, ending = archived.trial, archived.ending
        test, kind, label = intern(trial.test), intern(trial.kind), intern(trial.label)
        return cls(trial.number, test, kind, label, ending.outcome, intern(ending.reason))


class LazyTrials(Sequence[ArchivedTrial]):
    """Trials that are parsed on access, and cached while referenced elsewhere."""

    def __init__(
        self,
        outlines: Sequence[Outline],
        read: Callable[[int], ArchivedTrial],
        parsed: WeakValueDictionary[int, ArchivedTrial] | None = None,
    ) -> None:
        """`read` parses the trial of a number; `parsed` is the cache of referenced trials."""
        self.outlines = outlines
        self._read = read
        self._parsed = WeakValueDictionary() if parsed is None else parsed

    def of(self, test: str) -> LazyTrials:
        """The trials of one test."""
        wanted = [outline for outline in self.outlines if outline.test == test]
        return LazyTrials(wanted, self._read, self._parsed)

    def __reduce__(self) -> tuple[object, ...]:
        return LazyTrials, (self.outlines, self._read)

    def __eq__(self, other: object) -> bool:
        """Compare as tuples of trials."""
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
        if (trial := self._parsed.get(number)) is None:
            trial = self._parsed[number] = self._read(number)
        return trial
