"""Latency of delivered samples: wall clock against bench clock."""

from __future__ import annotations

from dataclasses import dataclass

SAME_PACE = 0.05
"""Share by which the two clocks may differ over a trial that runs at the pace of the wall clock; a
rehearsal at another speed has no samples that are late."""


@dataclass
class Pace:
    """Of one trial.

    Attributes:
        longest: between two hand-overs (s of the wall clock).
        at: bench time (s) of the first sample that was handed over after it.
    """

    longest: float = 0.0
    at: float = 0.0
    _first: tuple[float, float] | None = None  # wall clock, bench time
    _last: tuple[float, float] | None = None
    _least: float = 0.0  # of wall clock minus bench time, and the most
    _most: float = 0.0

    def handed_over(self, now: float, begin: float, end: float) -> None:
        """Samples from `begin` to `end` (s of bench time) came at `now` (wall clock)."""
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
        """Whether a second of the trial took a second, as far as can be told."""
        if self._first is None or self._last is None:
            return False
        wall, bench = (self._last[i] - self._first[i] for i in (0, 1))
        return abs(wall - bench) <= SAME_PACE * bench + self.longest

    @property
    def oldest(self) -> float:
        """How much later (s) than the timeliest one the latest hand-over was."""
        return self._most - self._least
