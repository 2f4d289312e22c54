"""The controller's ring buffer: records of one trial until the host has received them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from campaign.wire.device import LostRecords
from campaign.wire.messages import Record


class Ring:
    """Buffer of numbered records; if it is full, a new record replaces the oldest.

    Attributes:
        capacity: largest number of records.
        trial: trial of the records; 0 for none.
        first: number of the oldest stored record.
        next: number of the next new record; the first record of a trial is number 0.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._records: deque[Record] = deque()
        self.trial = 0
        self.first = 0
        self.next = 0

    @property
    def used(self) -> int:
        """Number of stored records."""
        return len(self._records)

    def begin(self, trial: int) -> None:
        """Delete all records; further records belong to `trial`."""
        self._records.clear()
        self.trial, self.first, self.next = trial, 0, 0

    def add(self, record: Record) -> None:
        """Store `record`, which has the number `next`."""
        if self.used == self.capacity:
            self._records.popleft()
            self.first += 1
        self._records.append(record)
        self.next += 1

    def free(self, before: int) -> None:
        """Delete every record with a number below `before`, which the host has received.

        Does nothing if `before` is above `next`: a host cannot have future records.
        """
        while self._records and self.first < before <= self.next:
            self._records.popleft()
            self.first += 1

    def again(self, first: int, count: int) -> Iterator[Record | LostRecords]:
        """Requested records again; deleted ones as one LOST, future ones not at all."""
        end = min(first + count, self.next)
        lost = min(end, self.first) - first
        if lost > 0:
            yield LostRecords(self.trial, first, lost)
        for number in range(max(first, self.first), end):
            yield self._records[number - self.first]
