"""Detection of a stop from outside at any moment of a run."""

from __future__ import annotations

import time
from collections.abc import Callable

from campaign.backends import calls
from campaign.backends.interface import Backend, SupportsExternalStop
from campaign.execution.safety import describe
from campaign.execution.stop import StopSwitch
from campaign.recording import PanicStop

INTERVAL = 0.1
"""s between two questions to the bench."""


class OutsideWatch:
    """The stop switch of a run, whose asking asks the bench as well: for between trials only.

    Rests, pauses before a retry, and prompts ask it instead of the switch; a running trial finds a
    stop by itself. A stop that nobody asks about in time keeps the next trial from moving.

    Attributes:
        stop: the panic stop that was found, or None.
    """

    def __init__(
        self,
        backend: Backend,
        switch: StopSwitch,
        found: Callable[[PanicStop], None] = lambda stop: None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """`found` is told once, before the run is asked to stop."""
        self._bench = backend if isinstance(backend, SupportsExternalStop) else None
        self._switch = switch
        self._found = found
        self._now = now
        self._due = now()
        self.stop: PanicStop | None = None

    def __call__(self) -> bool:
        if not self._switch() and self._now() >= self._due:
            self.look()
        return self._switch()

    def look(self) -> None:
        """Ask the bench now, also after the run was asked to stop."""
        if self._bench is None or self.stop is not None:
            return
        try:
            stop = calls.panic_stop(self._bench)
        except Exception as error:  # noqa: BLE001 - who cannot be asked may have been stopped
            self._switch.request(f"the bench, which cannot be asked: {describe(error)}")
            return
        self._due = self._now() + INTERVAL
        if stop is not None:
            self.stop = stop
            self._found(stop)
            self._switch.request(str(stop))
