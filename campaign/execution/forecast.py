"""Remaining time of a run from its progress."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.trial import Trial

SURE_AFTER = 2.0
"""s of work required for a forecast, or alternatively"""
SURE_SHARE = 0.05
"""this share of all work."""
UNEVEN_SHARE = 0.2
"""Required share if work pauses: a pause then counts at most five times its length."""
PER_TRIAL = 20.0
"""s of bench time that a computed trial costs additionally, to begin, archive, read and measure it.
This value minimizes the largest forecast error over the thesis' 1 712 trials of 1 to 120 s."""

BYTES = 8
"""Bytes per sample of one channel."""


def worth(trial: Trial, *, computed: bool) -> float:
    """Cost of a trial in s of bench time; `computed`: the backend computes its samples.

    For a trial that is read from files it is the number of sample bytes: the duration of a
    recording does not determine the time to read it.
    """
    if trial.recording:
        return BYTES * trial.task.duration * trial.task.sample_rate * _channels(trial)
    return trial.task.duration + (PER_TRIAL if computed else 0.0)


def _channels(trial: Trial) -> int:
    channels = trial.recording.get("channels")
    return max(1, len(channels)) if isinstance(channels, list) else 1


@dataclass
class Forecast:
    """Forecast from the rate since the first work; time before was for compiling or connecting.

    `uneven`: work pauses for seconds, e.g. while a file is opened and checked before its first
    sample. The forecast then requires a share of the work, not an elapsed time.
    """

    uneven: bool = False
    _begin: tuple[float, float] | None = None  # wall clock, cost done until then

    def time_left(self, now: float, done: float, left: float) -> float | None:
        """Remaining wall-clock time (s); None without sufficient data.

        Args:
            now: time of a clock (s).
            done, left: completed and remaining cost of trials (`worth`).
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
