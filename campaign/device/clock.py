"""The clock of the emulated controller: wall time, scaled, or message-driven."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

Now = Callable[[], float]
"""A steady clock (s)."""


class Pace:
    """Clock that determines the number of due samples of a trial.

    All times count from the start of the trial, so errors do not accumulate: sample n is due
    n / rate after it, even if earlier samples were sent late.

    Attributes:
        speed: seconds of the trial per second of the wall clock; infinite: as fast as the host
            takes samples.
    """

    def __init__(self, speed: float, now: Now = time.monotonic) -> None:
        self.speed = speed
        self._now = now
        self._began = now()

    @property
    def unlimited(self) -> bool:
        """Whether the messages of the host drive the clock."""
        return math.isinf(self.speed)

    def begin(self) -> None:
        """Start the trial now."""
        self._began = self._now()

    def due(self, rate: float) -> float:
        """Number of samples due now at `rate` (Hz); infinite at unlimited speed."""
        if self.unlimited:
            return math.inf
        elapsed = (self._now() - self._began) * self.speed
        return math.floor(elapsed * rate + 1e-6) + 1  # the first sample is due at time zero

    def deadline(self, sample: int, rate: float) -> float:
        """Due time (steady clock, s) of sample number `sample` (from 0); now at unlimited speed."""
        if self.unlimited:
            return self._now()
        return self._began + sample / (rate * self.speed)
