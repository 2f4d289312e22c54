"""The interface of a backend: it executes trials and makes its bench safe."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from campaign.archive import RunReader
from campaign.options import Options
from campaign.recording import Ending, PanicStop, Recorder, SafeState
from campaign.stopwatch import Timing
from campaign.trial import Tree, Trial


class Source(StrEnum):
    """Where a backend's samples come from."""

    SIMULATION = "simulation"
    HARDWARE = "hardware"
    RECORDING = "recording"  # measured before, here or elsewhere


class StopFlag(Protocol):
    """Whether one trial is to end early. Every trial has its own; any thread may ask."""

    def __call__(self) -> bool: ...


@runtime_checkable
class Backend(Protocol):
    """Executes trials. Used as a context manager: entering connects, leaving lets go."""

    def __enter__(self) -> Backend: ...

    def __exit__(self, *exception: object) -> None: ...

    def refuses(self, trial: Trial) -> str | None:
        """Why this backend cannot execute `trial` (naming the field), or None when it can.

        Asked of every trial of a plan, in order, before anything is connected. A live backend is
        asked again, in the same order, once it is, before anything moves: by then its bench may
        have said more. Later trials of a stage are asked of the connected backend only.
        """

    def channels(self, trial: Trial) -> frozenset[str] | None:
        """Names of the channels that `trial` will have; None while only a connection could tell.

        Asked before anything is connected, and again, when that answer was None, once it is.
        """

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Execute `trial`, handing samples to `recorder` as they come; end early when `stop()`.

        A bench that fails, diverges or meets a limit is an Ending, not an exception; samples that
        are lost are named to `recorder.lost`, and the trial then ends as a fault. A backend that
        lost its bench may be asked again: it then tries to find it again. Where several trials at
        a time are possible, it is called from several threads.
        Raises BackendError when the backend itself cannot go on.
        """

    def make_safe(self) -> SafeState:
        """Bring the bench to rest with its drive off, and say whether that was seen.

        May be called at any time from any thread, also while `execute` does not return: it must
        then get through all the same.
        """


@runtime_checkable
class SupportsHolder(Protocol):
    """What a backend does besides when others ask whose bench it is."""

    def introduce(self, run: str) -> None:
        """Told the name of the run before entering: the same when it is resumed."""


@runtime_checkable
class SupportsExternalStop(SupportsHolder, Protocol):
    """What a backend does besides when others can switch its bench off: see `PanicStop`."""

    def panic_stop(self) -> PanicStop | None:
        """The stop that keeps the bench off now, or None. Asked at any time between trials.

        None, too, while the bench cannot be asked: such a stop must then keep the next trial from
        moving, which ends as interrupted.
        """

    def clear_stop(self, count: int) -> None:
        """Let the bench move again after the stop with this count, which a person has seen.

        Raises BackendError when there is none, or a later one.
        """


@runtime_checkable
class StoppedByCommand(Protocol):
    """What a backend has besides when another process can stop its bench, should this one die."""

    def stop_command(self) -> tuple[str, ...]:
        """The program and its arguments. It ends within some seconds and says what it saw."""


@runtime_checkable
class ExecutesTogether(Protocol):
    """What a backend does besides when many trials together cost less than one after the other.

    Attributes:
        fewest_together, most_together: how many at a time are worth it, and possible.
    """

    fewest_together: int
    most_together: int

    def group(self, trial: Trial) -> Hashable:
        """Trials of equal groups can be executed together. Asked of trials that are not refused."""

    def execute_together(
        self, trials: Sequence[Trial], recorders: Sequence[Recorder], stops: Sequence[StopFlag]
    ) -> Iterator[tuple[int, Ending]]:
        """As `execute` of each of these trials of one group, with its own recorder and stop flag.

        Yields place and ending of each as soon as that one has ended. What one of them records
        does not depend on the others. Raises BackendError when the backend cannot go on; then it
        has not executed those whose ending it did not yield.
        """


@dataclass(frozen=True)
class TrialCost:
    """What a trial costs a backend that computes its samples.

    Attributes:
        step: of the integration (s).
        steps: of them in all.
        because: why the step is shorter than it could be; empty when it is not.
    """

    step: float
    steps: int
    because: str = ""


@runtime_checkable
class KnowsCost(Protocol):
    """What a backend does besides when it can say beforehand what a trial costs it."""

    def cost(self, trial: Trial) -> TrialCost:
        """Asked of trials that are not refused."""


@runtime_checkable
class SimulatesTruth(Protocol):
    """What a backend does besides when it can simulate another bench than the stated one."""

    def simulate_instead(self, truths: Mapping[str, Tree]) -> None:
        """Told, before it is asked anything, what `Trial.truth` stands for: plants, by digest.

        See `campaign.physics.truth`.
        """


@runtime_checkable
class SupportsTiming(Protocol):
    """What a backend has besides when it can tell what it spends its time on."""

    timing: Timing
    """Told of it from now on; whoever executes a plan may set it before the first trial."""


@runtime_checkable
class ServesArchive(Protocol):
    """What a backend has besides when its samples come out of an archived run."""

    @property
    def archive(self) -> RunReader:
        """That run: commands say what of it is damaged, on screen and in the new archive."""


@dataclass(frozen=True)
class BackendKind:
    """A backend as `--backend NAME` finds it, with what it declares of itself.

    Attributes:
        options: what it accepts (`--set backend.NAME=...`).
        open: makes one from its options.
        source: where its samples come from.
        live: whether it moves something, in the time of the wall clock: `campaign run` then asks
            before the first motion, a person confirms operator steps, pauses are waited for, and
            a bench that falls silent in mid-trial is made safe.
        by_hand: whether a person executes the trials, and nothing here moves anything: operator
            steps and pauses are a person's as with a live one, but nobody counts how long nothing
            is heard.
        stopped_outside: whether others can switch its bench off: then it is a
            `SupportsExternalStop`.
        several: whether several trials may be executed at a time (`--workers`).
        needs: what it needs of a bench, as dotted paths (`motor.resistance`); a protocol with a
            bench that lacks some is refused, with all of them named.
        picklable: whether worker processes can have copies of its backend.
        simulates: whether it runs the engine of `campaign.physics`, which is compiled at its first
            start.
    """

    name: str
    summary: str
    options: type[Options]
    open: Callable[[Options], Backend]
    source: Source
    live: bool = False
    by_hand: bool = False
    stopped_outside: bool = False
    several: bool = False
    picklable: bool = False
    simulates: bool = False
    needs: tuple[str, ...] = ()
