"""Writing one trial of a run, and its line in the run's journal."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from campaign.archive.journal import Entry, TrialAbandoned, TrialFinished
from campaign.estimate import Estimate, Window
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import ChannelInfo, Ending, Event, Trial

if TYPE_CHECKING:
    from campaign.archive.measured import Measure
    from campaign.archive.trial_file import TrialFile

Array = NDArray[np.float64]


class TrialWriter:
    """Takes one trial's recording: a `campaign.trial.Recorder` that ends in a file.

    Use it from one thread; several may be open at once. End it with `finish` or `abandon`.
    """

    def __init__(
        self,
        trial: Trial,
        attempt: int,
        file: TrialFile,
        note: Callable[[Entry], None],
        timing: Timing = UNTIMED,
    ) -> None:
        """`note` puts a line into the run's journal."""
        self._trial = trial
        self._attempt = attempt
        self._file = file
        self._note = note
        self._timing = timing
        self._open = True

    @property
    def attempt(self) -> int:
        """How often the trial is executed with this one, from 1."""
        return self._attempt

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        self._file.start(channels)

    def append(self, time: Array, block: Array) -> None:
        with self._timing.span(Work.TRIAL_FILES):
            self._file.append(time, block)

    def event(self, event: Event) -> None:
        self._file.event(event)

    @property
    def is_open(self) -> bool:
        """Whether it was neither finished nor abandoned."""
        return self._open

    def finish(
        self,
        ending: Ending,
        started: str,
        ended: str,
        *,
        windows: Iterable[Window] = (),
        estimates: Iterable[Estimate] = (),
        measure: Measure | None = None,
    ) -> None:
        """Keep the trial. When this returns, no crash can lose it.

        Args:
            ending: however it ended: a failed trial is kept too.
            started, ended: ISO 8601 with a time zone.
            windows, estimates: what was found of it meanwhile; kept with it.
            measure: looks at its samples once they are written; what it finds is kept as well.

        Raises:
            ArchiveError: it could not be written; nothing of it remains.
        """
        self._open = False
        with self._timing.span(Work.TRIAL_FILES):
            file = self._file.close(ending, started, ended, windows, estimates, measure)
            self._note(
                TrialFinished(
                    at=ended,
                    trial=self._trial.number,
                    attempt=self._attempt,
                    file=file.name,
                    sha256=file.sha256,
                    record=file.record,
                    bytes=file.bytes,
                    outcome=ending.outcome,
                    reason=ending.reason,
                    safe_state=ending.safe_state,
                )
            )

    def abandon(self, at: str, reason: str = "") -> None:
        """Keep nothing of the trial but that it was begun."""
        if not self._open:
            return
        self._open = False
        self._file.discard()
        self._note(TrialAbandoned(at=at, trial=self._trial.number, reason=reason))
