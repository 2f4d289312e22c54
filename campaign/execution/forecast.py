"""Remaining time of a run from its progress."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.trial import Trial

SURE_AFTER = 2.0
"""Seconds of work behind a forecast, or else"""
SURE_SHARE = 0.05
"""this share of all that is to be done."""
UNEVEN_SHARE = 0.2
"""The same where work halts: a halt counts as five times its length at most."""
PER_TRIAL = 20.0
"""Seconds of bench time that a computed trial costs besides its own: being begun, archived, read
and measured. Of the thesis' 1 712 trials, of 1 to 120 s, it makes the worst forecast best."""

BYTES = 8
"""of a sample of one channel."""


def worth(trial: Trial, *, computed: bool) -> float:
    """What a trial costs, in seconds of bench time; `computed`: nobody waits for a bench.

    Of a trial that is read from files it is the bytes of its samples: how long it once took says
    nothing of how long it takes to read.
    """
    if trial.recording:
        return BYTES * trial.task.duration * trial.task.sample_rate * _channels(trial)
    return trial.task.duration + (PER_TRIAL if computed else 0.0)


def _channels(trial: Trial) -> int:
    told = trial.recording.get("channels")
    return max(1, len(told)) if isinstance(told, list) else 1


@dataclass
class Forecast:
    """The pace since the first sign of work: what came before was compiling, or connecting.

    `uneven`: work halts for seconds, as where a file is opened and looked through before the first
    of its samples comes; then only a share of it tells a pace, and time that has passed does not.
    """

    uneven: bool = False
    _begin: tuple[float, float] | None = None  # wall clock, what was done by then

    def time_left(self, now: float, done: float, left: float) -> float | None:
        """Wall-clock time to the end (s); None while there is too little to go by.

        Args:
            now: a clock (s).
            done, left: what trials cost (`worth`) that is behind and before the run.
        """
        if done <= 0.0:
            return None
        if self._begin is None:
            self._begin = (now, done)
        passed, worked = now - self._begin[0], done - self._begin[1]
        share = UNEVEN_SHARE if self.uneven else SURE_SHARE
        enough = worked >= share * (done + left)
        if worked <= 0.0 or not (enough or (passed >= SURE_AFTER and not self.uneven)):
            return None
        return passed * left / worked
