"""The clock of the emulated controller: wall time, scaled, or message-driven."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

Now = Callable[[], float]
"""A steady clock (s)."""


class Pace:
    """How many samples of a trial are due.

    Everything is reckoned from the instant at which the trial began, so that no error adds up: the
    n-th sample is due at n / rate after it, however late the one before was sent.

    Attributes:
        speed: seconds of the trial per second of the wall clock; infinite for as fast as the host
            takes them.
    """

    def __init__(self, speed: float, now: Now = time.monotonic) -> None:
        self.speed = speed
        self._now = now
        self._began = now()

    @property
    def unlimited(self) -> bool:
        """Whether the clock is that of the messages."""
        return math.isinf(self.speed)

    def begin(self) -> None:
        """The trial begins now."""
        self._began = self._now()

    def due(self, rate: float) -> float:
        """Samples that the trial has had time for at `rate` (Hz); infinite at unlimited speed."""
        if self.unlimited:
            return math.inf
        elapsed = (self._now() - self._began) * self.speed
        return math.floor(elapsed * rate + 1e-6) + 1  # the first one is due at time zero

    def deadline(self, sample: int, rate: float) -> float:
        """When (of the steady clock) the `sample`-th, from 0, is due; now at unlimited speed."""
        if self.unlimited:
            return self._now()
        return self._began + sample / (rate * self.speed)
