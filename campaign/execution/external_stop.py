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
"""s between two polls of the bench."""


class OutsideWatch:
    """Stop switch of a run that also polls the bench; for use between trials only.

    Rests, pauses before a retry, and prompts call it instead of the switch. A running trial detects
    a stop itself. A stop between two polls prevents the motion of the next trial.

    Attributes:
        stop: the detected panic stop, or None.
    """

    def __init__(
        self,
        backend: Backend,
        switch: StopSwitch,
        found: Callable[[PanicStop], None] = lambda stop: None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """`found` is called once with the stop, before the run is requested to stop."""
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
        """Poll the bench now, also after a stop request to the run."""
        if self._bench is None or self.stop is not None:
            return
        try:
            stop = calls.panic_stop(self._bench)
        except Exception as error:  # noqa: BLE001 - a bench without answer may be stopped
            self._switch.request(f"the bench, which cannot be asked: {describe(error)}")
            return
        self._due = self._now() + INTERVAL
        if stop is not None:
            self.stop = stop
            self._found(stop)
            self._switch.request(str(stop))
