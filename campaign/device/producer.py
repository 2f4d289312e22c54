"""Samples of a trial, simulated in a thread ahead of the clock."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

import numpy as np

from campaign.backends.interface import Backend
from campaign.recording import Array, ChannelInfo, Ending, Event, Fault, Outcome
from campaign.trial import Trial

AHEAD = 50_000
"""Largest number of samples in advance, plus up to one block of the simulation."""


class CancelledError(Exception):
    """The controller has discarded the trial; the simulation ends."""


class Producer:
    """Simulation of one trial on `backend` in a thread; the controller takes its samples.

    It is a Recorder for the backend. The thread calls `wake` for new samples and at the end.
    """

    def __init__(self, backend: Backend, trial: Trial, wake: Callable[[], None]) -> None:
        self._backend = backend
        self._trial = trial
        self._wake = wake
        self._changed = threading.Condition()
        self._blocks: deque[Array] = deque()
        self._events: deque[tuple[int, Event]] = deque()
        self._made = 0  # total number of samples
        self._taken = 0
        self._cancelled = False
        self._ending: Ending | None = None
        self.channels: tuple[ChannelInfo, ...] = ()
        self._thread = threading.Thread(target=self._run, name="bench", daemon=True)

    def begin(self) -> None:
        """Start the simulation."""
        self._thread.start()

    def cancel(self) -> None:
        """Cancel the trial; the thread ends after its present block."""
        with self._changed:
            self._cancelled = True
            self._changed.notify_all()

    @property
    def ready(self) -> bool:
        """Whether the first samples, or the ending, are available."""
        with self._changed:
            return self._made > 0 or self._ending is not None

    @property
    def available(self) -> int:
        """Number of samples available now."""
        with self._changed:
            return self._made - self._taken

    @property
    def finished(self) -> bool:
        """Whether the simulation has ended; some samples may still be available."""
        with self._changed:
            return self._ending is not None

    @property
    def ending(self) -> Ending | None:
        """Ending of the simulation; None until it has ended and all its samples are taken."""
        with self._changed:
            return self._ending if self._made == self._taken else None

    def take(self, most: int) -> Array:
        """The next samples, at most `most`, shape (channels, n); n is 0 if there are none."""
        with self._changed:
            if not self._blocks or most <= 0:
                return np.empty((len(self.channels), 0))
            pieces, count = [], 0
            while self._blocks and count < most:
                block = self._blocks.popleft()
                piece, rest = block[:, : most - count], block[:, most - count :]
                pieces.append(piece)
                count += piece.shape[1]
                if rest.shape[1]:
                    self._blocks.appendleft(rest)
            self._taken += count
            self._changed.notify_all()
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=1)

    def take_events(self) -> list[Event]:
        """Events before the next sample."""
        with self._changed:
            due = []
            while self._events and self._events[0][0] <= self._taken:
                due.append(self._events.popleft()[1])
            return due

    # Methods that the backend calls from the thread

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self.channels = channels

    def append(self, time: Array, block: Array) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._cancelled or self._made - self._taken < AHEAD)
            if self._cancelled:
                raise CancelledError
            if block.shape[1]:
                self._blocks.append(block)
                self._made += block.shape[1]
            self._changed.notify_all()
        self._wake()

    def lost(self, time: Array) -> None:
        raise AssertionError("a simulation loses nothing")

    def event(self, event: Event) -> None:
        with self._changed:
            self._events.append((self._made, event))

    def _run(self) -> None:
        try:
            ending = self._backend.execute(self._trial, self, lambda: self._cancelled)
        except CancelledError:
            ending = Ending(Outcome.INTERRUPTED, "cancelled")
        except Exception as error:  # noqa: BLE001 - the controller must report any error
            reason = f"the simulation failed: {type(error).__name__}: {error}"
            ending = Ending(Outcome.FAULT, reason, fault=Fault.OTHER)
        with self._changed:
            self._ending = ending
            self._changed.notify_all()
        self._wake()
