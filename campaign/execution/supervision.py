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
"""Is handed every block that is archived: its trial, the channels, time (n,), block (channels, n).

Called from the trial's own thread, before the backend goes on: it must return at once and change
nothing. One that raises is not called again in that trial.
"""


@dataclass(frozen=True)
class Patience:
    """How long (s, of the wall clock) a live backend is waited for.

    Attributes:
        first: until the first samples: configuring, arming, warming up.
        silence: between two hand-overs of samples.
        closing: for `execute` to return once nothing more is to come: braking, coming to rest.
        grace: for `execute` to return once its stop flag was set, until `make_safe` is called.
        giving_up: for `execute` to return once `make_safe` was called, and at least `grace` after
            its answer, until the trial is given up.
        tick: between two looks at the clock.
        asleep: a look that comes so late says that this program itself did not run: what was not
            heard meanwhile is nobody's silence.
        late: what samples may wait until they are handed over.
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
    """What the recorder of every trial of a run is told.

    Attributes:
        source, live: as the backend's `BackendKind` declares.
        clock: a steady one (s).
        timing: told what the trial's own thread does.
    """

    source: Source = Source.SIMULATION
    live: bool = False
    patience: Patience = Patience()
    subscribers: tuple[Subscriber, ...] = ()
    clock: Callable[[], float] = time.monotonic
    timing: Timing = UNTIMED


class TrialStop:
    """The stop flag of one trial: the run is to halt, or the trial's own recorder has ended it."""

    def __init__(self, halted: Callable[[], bool]) -> None:
        self._halted = halted
        self._tripped = threading.Event()

    def __call__(self) -> bool:
        return self._tripped.is_set() or self._halted()

    @property
    def halted(self) -> bool:
        """Whether it is the run that is to end."""
        return self._halted()

    def trip(self) -> None:
        """End this trial, and no other."""
        self._tripped.set()


class SilenceWatch:
    """Counts how long nothing was heard, but for the time in which this program did not run."""

    def __init__(self, asleep: float, now: float) -> None:
        self._asleep = asleep
        self._since = self._looked = now

    def look(self, now: float, heard: float | None) -> float:
        """How long (s) nothing was heard; `heard` is when something was last, None if never."""
        if now - self._looked > self._asleep:
            self._since = now
        self._looked = now
        if heard is not None:
            self._since = max(self._since, heard)
        return now - self._since
