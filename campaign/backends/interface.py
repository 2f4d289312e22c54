"""What a backend is: it executes one trial at a time and can bring the bench to rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from campaign.options import Options
from campaign.trial import Ending, Recorder, SafeState, Trial


class Backend(Protocol):
    """Executes trials. Used as a context manager: entering connects, leaving lets go."""

    def __enter__(self) -> Backend: ...

    def __exit__(self, *exception: object) -> None: ...

    def refuses(self, trial: Trial) -> str | None:
        """Why this backend cannot execute `trial` (naming the field), or None when it can.

        Asked of every trial of a plan, in order, before anything is connected.
        """

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        """Execute `trial`, appending samples to `recorder`; end early when `stopped()` is true.

        A bench that fails, diverges or meets a limit is an Ending, not an exception; samples that
        are missing are NaN, each gap is an event, and the trial ends as a fault. A backend that
        lost its bench may be asked again: it then tries to find it again.
        Raises BackendError when the backend itself cannot go on.
        """

    def make_safe(self) -> SafeState:
        """Bring the bench to rest with its drive off, and say whether that was seen."""


@dataclass(frozen=True)
class BackendKind:
    """A backend as `--backend NAME` finds it.

    Attributes:
        options: what it accepts (`--set backend.NAME=...`).
        open: makes one from its options.
        parallel: whether several trials may be executed at once (`--workers`).
        attended: whether something real moves: `campaign run` then asks before the first motion,
            operator steps are confirmed by a person, and pauses are really waited for.
    """

    name: str
    summary: str
    options: type[Options]
    open: Callable[[Options], Backend]
    parallel: bool = False
    attended: bool = False
