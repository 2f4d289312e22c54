"""Batches of trials that are executed together: one group within the lookahead."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import islice

from campaign.backends.calls import called
from campaign.backends.interface import Backend, ExecutesTogether
from campaign.trial import Trial

LOOK_AHEAD = 512
"""Number of trials of the plan that are searched for companions."""


class Batches:
    """Queue of trials, taken singly, or in batches if the backend executes trials together.

    A batch may change the order of the plan. A trial that `stays` keeps its place: neither it nor
    a later trial is moved forward past it.
    """

    def __init__(
        self, trials: Iterable[Trial], backend: Backend, workers: int, *, live: bool = False
    ) -> None:
        """`live`: whether a bench moves; each trial is then supervised and executed alone."""
        self._waiting = deque(trials)
        self._together: ExecutesTogether | None = None
        if isinstance(backend, ExecutesTogether) and not live:
            self._together = backend
        self._workers = workers

    @property
    def first(self) -> Trial | None:
        """The next trial; None if none are left."""
        return self._waiting[0] if self._waiting else None

    def insert(self, trials: Sequence[Trial]) -> None:
        """Put `trials` first, in their order."""
        self._waiting.extendleft(reversed(trials))

    def take(self, seconds: float, stays: Callable[[Trial], bool]) -> tuple[Trial, ...]:
        """Take the next trial and those that are executed together with it, in plan order.

        Args:
            seconds: available bench time; one trial is taken in any case.
            stays: whether an operator step is due before a trial.
        """
        first = self._waiting.popleft()
        together = self._together
        if together is None or (group := _group(together, first)) is None:
            return (first,)
        companions = []
        for trial in islice(self._waiting, LOOK_AHEAD):
            if stays(trial):
                break
            if _group(together, trial) == group:
                companions.append(trial)
        # An equal share per worker, unless single execution costs less.
        share = -(-(1 + len(companions)) // self._workers)
        batch, left = [first], seconds - first.task.duration
        for trial in companions[: min(share, together.most_together) - 1]:
            left -= trial.task.duration
            if left < 0.0:
                break
            batch.append(trial)
        if len(batch) < together.fewest_together:
            return (first,)
        taken = {trial.number for trial in batch}
        ahead = [self._waiting.popleft() for _ in range(min(LOOK_AHEAD, len(self._waiting)))]
        self._waiting.extendleft(t for t in reversed(ahead) if t.number not in taken)
        return tuple(batch)


def _group(backend: ExecutesTogether, trial: Trial) -> Hashable | None:
    """Group of a trial; None on an error: it is then executed alone, which reports the error."""
    try:
        group: Hashable = called(backend, "group", trial)
        return group
    except Exception:  # noqa: BLE001 - a bug in a backend must not cost the archive
        return None
