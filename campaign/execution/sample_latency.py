"""Latency of delivered samples: wall clock against bench clock."""

from __future__ import annotations

from dataclasses import dataclass

SAME_PACE = 0.05
"""Permitted relative difference of the two clocks over a trial in real time; a rehearsal at another
speed has no late samples."""


@dataclass
class Pace:
    """Latency statistics of one trial.

    Attributes:
        longest: longest gap between two deliveries (s of wall clock).
        at: bench time (s) of the first sample after it.
    """

    longest: float = 0.0
    at: float = 0.0
    _first: tuple[float, float] | None = None  # wall clock, bench time
    _last: tuple[float, float] | None = None
    _least: float = 0.0  # minimum and maximum of wall clock minus bench time
    _most: float = 0.0

    def handed_over(self, now: float, begin: float, end: float) -> None:
        """Add samples from `begin` to `end` (s of bench time), delivered at `now` (wall clock)."""
        if self._last is None:
            self._first = (now, end)
            self._least = self._most = now - end
        elif now - self._last[0] > self.longest:
            self.longest, self.at = now - self._last[0], begin
        self._last = (now, end)
        self._least = min(self._least, now - end)
        self._most = max(self._most, now - end)

    @property
    def is_of_the_wall_clock(self) -> bool:
        """Whether the trial ran in real time, within SAME_PACE and the longest gap."""
        if self._first is None or self._last is None:
            return False
        wall, bench = (self._last[i] - self._first[i] for i in (0, 1))
        return abs(wall - bench) <= SAME_PACE * bench + self.longest

    @property
    def oldest(self) -> float:
        """Largest delay (s) of a delivery relative to the earliest delivery."""
        return self._most - self._least
