"""Supervision of trials: backend facts, time limits, observers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from campaign.backends.interface import Source
from campaign.recording import Array, ChannelInfo
from campaign.stopwatch import UNTIMED, Timing
from campaign.trial import Trial

Subscriber = Callable[[Trial, tuple[ChannelInfo, ...], Array, Array], None]
"""Receives every archived block: its trial, channels, time (n,), block (channels, n).

It is called in the trial's thread while the backend waits: it must return immediately and change
nothing. After an exception it is not called again in that trial.
"""


@dataclass(frozen=True)
class Patience:
    """Time limits (s of wall clock) for a live backend.

    Attributes:
        first: until the first samples: configuring, arming, warming up.
        silence: between two deliveries of samples.
        closing: from the last sample until `execute` returns: braking, coming to rest.
        grace: from setting the stop flag until `make_safe` is called, if `execute` does not return.
        giving_up: from the call of `make_safe` until the trial is abandoned, if `execute` does not
            return; at least `grace` after the answer of `make_safe`.
        tick: between two checks of the clock.
        asleep: delay of a check from which this program itself was suspended: that time does not
            count as silence.
        late: maximum delay of samples until their delivery.
    """

    first: float = 15.0
    silence: float = 5.0
    closing: float = 15.0
    grace: float = 0.5
    giving_up: float = 5.0
    tick: float = 0.05
    asleep: float = 1.0
    late: float = 0.2


@dataclass(frozen=True)
class Supervision:
    """Settings of the supervision of all trials of a run.

    Attributes:
        source, live: as declared by the backend's `BackendKind`.
        clock: monotonic clock (s).
        timing: stopwatch for the trial's thread.
    """

    source: Source = Source.SIMULATION
    live: bool = False
    patience: Patience = Patience()
    subscribers: tuple[Subscriber, ...] = ()
    clock: Callable[[], float] = time.monotonic
    timing: Timing = UNTIMED


class TrialStop:
    """Stop flag of one trial: set by a stop of the run, or by the trial's recorder."""

    def __init__(self, halted: Callable[[], bool]) -> None:
        self._halted = halted
        self._tripped = threading.Event()

    def __call__(self) -> bool:
        return self._tripped.is_set() or self._halted()

    @property
    def halted(self) -> bool:
        """Whether the run is to end."""
        return self._halted()

    def trip(self) -> None:
        """End this trial only."""
        self._tripped.set()


class SilenceWatch:
    """Measures the silence of a backend, without the time in which this program was suspended."""

    def __init__(self, asleep: float, now: float) -> None:
        self._asleep = asleep
        self._since = self._looked = now

    def look(self, now: float, heard: float | None) -> float:
        """Silence (s) at `now`; `heard` is the time of the last samples, None before any."""
        if now - self._looked > self._asleep:
            self._since = now
        self._looked = now
        if heard is not None:
            self._since = max(self._since, heard)
        return now - self._since
