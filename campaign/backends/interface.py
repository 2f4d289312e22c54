"""The interface of a backend: it executes trials and makes its bench safe."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol, runtime_checkable

from campaign.archive.reading.run_reader import RunReader
from campaign.options import Options
from campaign.recording import Ending, PanicStop, Recorder, SafeState
from campaign.stopwatch import Timing
from campaign.trial import Tree, Trial


class Source(StrEnum):
    """Source of a backend's samples."""

    SIMULATION = "simulation"
    HARDWARE = "hardware"
    RECORDING = "recording"  # an existing recording


StopFlag = Callable[[], bool]
"""Whether one trial is to end early. Each trial has its own flag; any thread may call it."""


@runtime_checkable
class Backend(Protocol):
    """Executes trials. A context manager: entering connects, leaving disconnects."""

    def __enter__(self) -> Backend: ...

    def __exit__(self, *exception: object) -> None: ...

    def refuses(self, trial: Trial) -> str | None:
        """Why this backend cannot execute `trial` (naming the field); None if it can.

        Called for all trials of a plan, in order, before connecting. For a live backend it is
        called again, in the same order, after connecting and before any motion: the bench may then
        provide more data. For trials of later stages it is called after connecting only.
        """

    def channels(self, trial: Trial) -> frozenset[str] | None:
        """Names of the channels of `trial`; None if they are unknown before connecting.

        Called before connecting, and again after it if the answer was None.
        """

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Execute `trial`; pass samples to `recorder` as they come; end early if `stop()`.

        A failing or diverging bench and a reached limit result in an Ending, not in an exception.
        Lost samples are passed to `recorder.lost`, and the trial ends as a fault. After the loss of
        its bench the backend may be called again, and tries to reconnect. If several trials at a
        time are possible, several threads call it.
        Raises BackendError if the backend itself cannot continue.
        """

    def make_safe(self) -> SafeState:
        """Bring the bench to rest with its drive off; whether that is confirmed.

        It may be called at any time from any thread, and must also work while `execute` hangs.
        """


@runtime_checkable
class SupportsHolder(Protocol):
    """Additional interface of a backend that reports the holder of its bench to other hosts."""

    def introduce(self, run: str) -> None:
        """Receive the name of the run, before entering; a resumed run has the same name."""


@runtime_checkable
class SupportsExternalStop(SupportsHolder, Protocol):
    """Additional interface of a backend whose bench can be stopped externally: see `PanicStop`."""

    def panic_stop(self) -> PanicStop | None:
        """The stop that keeps the bench off now, or None. Called at any time between trials.

        Also None while the bench does not answer: the stop must then prevent the motion of the next
        trial, which ends as interrupted.
        """

    def clear_stop(self, count: int) -> None:
        """Clear the stop with this count, which a person has seen; the bench can move again.

        Raises BackendError if there is no stop, or a later one.
        """


@runtime_checkable
class StoppedByCommand(Protocol):
    """Additional interface of a backend whose bench another process can stop, if this one dies."""

    def stop_command(self) -> tuple[str, ...]:
        """Program and arguments. The program ends within some seconds and reports the result."""


@runtime_checkable
class ExecutesTogether(Protocol):
    """Additional interface of a backend that executes trials together at lower cost.

    Attributes:
        fewest_together: smallest number of trials with a lower cost.
        most_together: largest possible number of trials.
    """

    fewest_together: int
    most_together: int

    def group(self, trial: Trial) -> Hashable:
        """Group of a trial that is not refused; trials of equal groups can be executed together."""

    def execute_together(
        self, trials: Sequence[Trial], recorders: Sequence[Recorder], stops: Sequence[StopFlag]
    ) -> Iterator[tuple[int, Ending]]:
        """Execute trials of one group, as `execute`, each with its own recorder and stop flag.

        Yields index and ending of each trial when it has ended. The samples of a trial are
        independent of the others. Raises BackendError if the backend cannot continue; trials
        without a yielded ending are then not executed.
        """


@dataclass(frozen=True)
class TrialCost:
    """Cost of a trial for a backend that computes its samples.

    Attributes:
        step: integration step (s).
        steps: number of steps.
        because: why the step is shortened; empty if it is not.
    """

    step: float
    steps: int
    because: str = ""


@runtime_checkable
class KnowsCost(Protocol):
    """Additional interface of a backend that can predict the cost of a trial."""

    def cost(self, trial: Trial) -> TrialCost:
        """Cost of a trial that is not refused."""


@runtime_checkable
class SimulatesTruth(Protocol):
    """Additional interface of a backend that can simulate another bench than the stated one."""

    def simulate_instead(self, truths: Mapping[str, Tree]) -> None:
        """Receive the plants that `Trial.truth` refers to, by digest; called before all else.

        See `campaign.physics.truth`.
        """


@runtime_checkable
class SupportsTiming(Protocol):
    """Additional interface of a backend that measures its time by kind of work."""

    timing: Timing
    """Timing sink. Set it before the first trial."""


@runtime_checkable
class ServesArchive(Protocol):
    """Additional interface of a backend whose samples come from an archived run."""

    @property
    def archive(self) -> RunReader:
        """The archived run; commands report its damage, on screen and in the new archive."""


@dataclass(frozen=True)
class BackendKind:
    """A backend for `--backend NAME`, with its declarations.

    Attributes:
        options: class of its options (`--set backend.NAME=...`).
        open: creates a backend from its options, an object of that class.
        source: source of its samples.
        live: whether it moves a bench in wall-clock time: `campaign run` then prompts before the
            first motion, a person confirms operator steps, pauses take their time, and a bench
            without samples during a trial is made safe.
        by_hand: whether a person executes the trials and the program moves nothing: operator steps
            and pauses are as for a live backend, but silence has no time limit.
        stopped_outside: whether its bench can be stopped externally; it is then a
            `SupportsExternalStop`.
        several: whether several trials may be executed at a time (`--workers`).
        needs: bench fields that it needs, as dotted paths (`motor.resistance`); a protocol with a
            bench without some of them is refused, with all of them named.
        picklable: whether worker processes can have copies of its backend.
        simulates: whether it runs the engine of `campaign.physics`, which is compiled at its first
            start.
    """

    name: str
    summary: str
    options: type[Options]
    open: Callable[[Any], Backend]
    source: Source
    live: bool = False
    by_hand: bool = False
    stopped_outside: bool = False
    several: bool = False
    picklable: bool = False
    simulates: bool = False
    needs: tuple[str, ...] = ()
