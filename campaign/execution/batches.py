"""Trials that are executed together: one group within the lookahead."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import islice

from campaign.backends.calls import called
from campaign.backends.interface import Backend, ExecutesTogether
from campaign.trial import Trial

LOOK_AHEAD = 512
"""Trials of the plan among which companions are looked for."""


class Batches:
    """The trials that wait, handed out one by one or, where the backend gains by it, several.

    A trial may come before others of the plan then. It does not where the order means something:
    no trial is taken over one that `stays`, and none of those is.
    """

    def __init__(
        self, trials: Iterable[Trial], backend: Backend, workers: int, *, live: bool = False
    ) -> None:
        """`live`: whether something moves: each trial then has somebody who watches it alone."""
        self._waiting = deque(trials)
        self._together: ExecutesTogether | None = None
        if isinstance(backend, ExecutesTogether) and not live:
            self._together = backend
        self._workers = workers

    @property
    def first(self) -> Trial | None:
        """The next one in the order of the plan; None when there are no more."""
        return self._waiting[0] if self._waiting else None

    def again(self, trial: Trial) -> None:
        """It is the next one once more."""
        self._waiting.appendleft(trial)

    def insert(self, trials: Sequence[Trial]) -> None:
        """They are the next ones, in that order."""
        self._waiting.extendleft(reversed(trials))

    def take(self, seconds: float, stays: Callable[[Trial], bool]) -> tuple[Trial, ...]:
        """The next trial, and those that are executed together with it, in plan order.

        Args:
            seconds: of bench time that there are for them; one trial is taken in any case.
            stays: whether something has to be done before a trial.
        """
        first = self._waiting.popleft()
        together = self._together
        if together is None or (group := _group(together, first)) is None:
            return (first,)
        found = []
        for trial in islice(self._waiting, LOOK_AHEAD):
            if stays(trial):
                break
            if _group(together, trial) == group:
                found.append(trial)
        # As many as every worker gets of these, unless alone would cost less.
        share = -(-(1 + len(found)) // self._workers)
        batch, left = [first], seconds - first.task.duration
        for trial in found[: min(share, together.most_together) - 1]:
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
    """None for a trial that the backend cannot place: it goes alone, and what is wrong is said."""
    try:
        group: Hashable = called(backend, "group", trial)
        return group
    except Exception:  # noqa: BLE001 - a bug in a backend must not cost the archive
        return None
