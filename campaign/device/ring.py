"""The controller's ring buffer: records of one trial until the host has them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from campaign.wire.device import LostRecords
from campaign.wire.messages import Record


class Ring:
    """Numbered records, the oldest given up for the newest when it is full.

    Attributes:
        capacity: how many it keeps.
        trial: whose records these are; 0 for none.
        first: number of the oldest one kept.
        next: number of the next one to come; the first record of a trial is number 0.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._records: deque[Record] = deque()
        self.trial = 0
        self.first = 0
        self.next = 0

    @property
    def used(self) -> int:
        """Records kept now."""
        return len(self._records)

    @property
    def room(self) -> int:
        """Records that can be added before one is given up."""
        return self.capacity - len(self._records)

    def begin(self, trial: int) -> None:
        """Forget everything; what comes belongs to `trial`."""
        self._records.clear()
        self.trial, self.first, self.next = trial, 0, 0

    def add(self, record: Record) -> None:
        """Keep `record`, whose number is `next`."""
        if not self.room:
            self._records.popleft()
            self.first += 1
        self._records.append(record)
        self.next += 1

    def free(self, before: int) -> None:
        """Give up every record with a number below `before`; the host has it.

        Nothing when there are not so many yet: no host can have what was not made.
        """
        while self._records and self.first < before <= self.next:
            self._records.popleft()
            self.first += 1

    def again(self, first: int, count: int) -> Iterator[Record | LostRecords]:
        """The records asked for again; those no longer kept as one LOST, future ones not at all."""
        end = min(first + count, self.next)
        lost = min(end, self.first) - first
        if lost > 0:
            yield LostRecords(self.trial, first, lost)
        for number in range(max(first, self.first), end):
            yield self._records[number - self.first]
