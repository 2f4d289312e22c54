"""Ordered records of a trial: received, missing, to be requested again.

A device numbers all records of a trial in one sequence. This module sorts them, drops duplicates,
and requests missing records again at increasing intervals. Pure: time is an argument, and the
caller sends the requests.
"""

from __future__ import annotations

from dataclasses import dataclass

from campaign.link.errors import ViolationError
from campaign.wire.messages import End, Record

FIRST_PATIENCE = 0.1
"""Interval (s) from the first request to the next; each request doubles it."""
LONGEST_PATIENCE = 0.5
TRIES = 12
"""Requests until a record counts as lost: more than 4 s."""
MOST = 32
"""Largest number of records per request, so that answers do not delay new records."""


FARTHEST = 1_000_000
"""Largest lead of a device (records): above any ring buffer, and limited in memory here."""


@dataclass(frozen=True)
class MissingRecords:
    """Records `first` to `first + count - 1` are lost."""

    first: int
    count: int


@dataclass
class _Wanted:
    due: float
    tries: int = 0


class RecordOrder:
    """The records of one trial, from number 0.

    Attributes:
        next: number of the next record that `take` returns.
        resends: number of requests.
    """

    def __init__(self) -> None:
        self.next = 0
        self.resends = 0
        self._come: dict[int, Record] = {}
        self._lost: set[int] = set()
        self._wanted: dict[int, _Wanted] = {}
        self._beyond = 0  # all records before this number are known to exist
        self._end: int | None = None

    def add(self, record: Record, now: float) -> None:
        """Add a received record, in any order."""
        number = record.number
        if number < self.next or number in self._come:
            return
        self._come[number] = record
        self._lost.discard(number)
        self._wanted.pop(number, None)
        if isinstance(record, End):
            self._end = number
        self.exists(number + 1, now)

    def exists(self, beyond: int, now: float) -> None:
        """Note that every record before number `beyond` exists and was sent once.

        Raises ViolationError for a number that no device can have reached.
        """
        if beyond - self.next > FARTHEST:
            raise ViolationError(f"the controller announces record {beyond - 1} after {self.next}")
        if self._end is not None:
            beyond = min(beyond, self._end + 1)
        for number in range(max(self._beyond, self.next), beyond):
            if number not in self._come and number not in self._lost:
                self._wanted[number] = _Wanted(now)
        self._beyond = max(self._beyond, beyond)

    def lost(self, first: int, count: int) -> None:
        """Note that the device no longer has these records."""
        for number in range(max(first, self.next), min(first + count, self._beyond)):
            if number not in self._come:
                self._lost.add(number)
                self._wanted.pop(number, None)

    def take(self) -> list[Record | MissingRecords]:
        """Remove and return the next records in order; a run of lost ones as a MissingRecords."""
        taken: list[Record | MissingRecords] = []
        while True:
            if self.next in self._come:
                taken.append(self._come.pop(self.next))
            elif self.next in self._lost:
                self._lost.remove(self.next)
                last = taken[-1] if taken else None
                if isinstance(last, MissingRecords):
                    taken[-1] = MissingRecords(last.first, last.count + 1)
                else:
                    taken.append(MissingRecords(self.next, 1))
            else:
                return taken
            self.next += 1

    def requests(self, now: float) -> list[tuple[int, int]]:
        """Ranges (first, count) to request now; records beyond TRIES requests become lost."""
        due = []
        for number, wanted in sorted(self._wanted.items()):
            if wanted.due > now:
                continue
            if wanted.tries == TRIES:
                self._lost.add(number)
                del self._wanted[number]
                continue
            wanted.due = now + min(LONGEST_PATIENCE, FIRST_PATIENCE * 2**wanted.tries)
            wanted.tries += 1
            due.append(number)
        runs: list[tuple[int, int]] = []
        for number in due:
            first, count = runs[-1] if runs else (number, 0)
            if first + count == number and count < MOST:
                runs[-1:] = [(first, count + 1)]
            else:
                runs.append((number, 1))
        self.resends += len(runs)
        return runs
