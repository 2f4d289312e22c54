"""Calls into a backend: time limit, checked answer, named faults.

A backend may be the code of anybody. Whatever it raises is a BackendError here that names its
package; an error of this program's own backends stays what it is, a bug. A call that exceeds its
limit is left behind in a thread that keeps no program from ending.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, Generic, TypeVar

from campaign.backends.interface import (
    Backend,
    BackendKind,
    StopFlag,
    StoppedByCommand,
    SupportsExternalStop,
)
from campaign.entry_points import blamed, one_line, provider
from campaign.errors import BackendError, CampaignError
from campaign.options import Options
from campaign.plain_text import storable
from campaign.recording import Ending, Fault, Outcome, PanicStop, Recorder, SafeState
from campaign.trial import Trial

CONNECTING, MAKING_SAFE, LEAVING, LOOKING = 25.0, 10.0, 4.0, 20.0
"""s that `__enter__`, `make_safe`, `__exit__`, and any question may take. With the patience of a
trial (`supervision.py`) a bench is seen safe, or said not to be, within 40 s."""
TICK = 0.05
"""s between two looks at the clock."""
METHODS: Mapping[type, tuple[str, ...]] = {
    Backend: ("__enter__", "__exit__", "refuses", "channels", "execute", "make_safe"),
    SupportsExternalStop: ("introduce", "panic_stop", "clear_stop"),
}
_MAIN = threading.main_thread()
T = TypeVar("T")


class HangsError(BackendError):
    """A backend did not answer in time."""


class Heartbeat:
    """Signs of life from the loops that watch a bench. Each sends its own: a thread beside them
    would send while they hang.

    Attributes:
        interval: s between two.
        tell: where they go; False for the last one until a loop begins again.
    """

    interval = 0.5

    def __init__(self) -> None:
        self.tell: Callable[[bool], None] = lambda more: None
        self._loops, self._due = 0, 0.0
        self._counting = threading.Lock()

    @contextmanager
    def expected(self) -> Iterator[None]:
        """Inside the block somebody expects `beat`."""
        with self._counting:
            self._loops += 1
            self.tell(True)
        try:
            yield
        finally:
            with self._counting:
                self._loops -= 1
                if not self._loops:
                    self.tell(False)

    def beat(self) -> None:
        """One turn of a loop; most turns send nothing."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + self.interval
            self.tell(True)


HEARTBEAT = Heartbeat()
"""Of this process."""


def opened(kind: BackendKind, options: Options) -> Backend:
    """A backend of `kind`. This and all below raise BackendError."""
    backend = _blaming(lambda: kind.open(options), kind.open, "open")
    if kind.stopped_outside:
        _typed(backend, SupportsExternalStop, kind.open, "open")  # type: ignore[type-abstract]
    return _typed(backend, Backend, kind.open, "open")  # type: ignore[type-abstract]


def connect(backend: Backend) -> None:
    """Enter `backend`, which stays the same, whatever that returns. Raises HangsError, too."""
    _within(CONNECTING, backend, "__enter__")


def leave(backend: Backend, error: BaseException | None) -> None:
    """Let go of the bench; `error` is what ended the work."""
    trace = error.__traceback__ if error is not None else None
    _within(LEAVING, backend, "__exit__", type(error) if error else None, error, trace)


def make_safe(backend: Backend) -> SafeState:
    """Bring the bench to rest."""
    return _typed(_within(MAKING_SAFE, backend, "make_safe"), SafeState, backend, "make_safe")


def panic_stop(backend: SupportsExternalStop) -> PanicStop | None:
    """The stop from outside that keeps the bench off."""
    stop = _within(LOOKING, backend, "panic_stop")
    if stop is None:
        return None
    stop = _typed(stop, PanicStop, backend, "panic_stop")
    count = _typed(stop.count, int, backend, "panic_stop")
    known = isinstance(stop.age, int | float) and math.isfinite(stop.age)
    return PanicStop(count, storable(stop.by), stop.age if known else None)


def stop_command(backend: Backend) -> tuple[str, ...]:
    """What stops the bench when this program has died; empty where nothing does."""
    if not isinstance(backend, StoppedByCommand):
        return ()
    command = _typed(_within(LOOKING, backend, "stop_command"), tuple, backend, "stop_command")
    return tuple(_typed(word, str, backend, "stop_command") for word in command)


def refusal(backend: Backend, trial: Trial) -> str:
    """Why `backend` does not execute `trial`; empty when it does."""
    return storable(_typed(_asked(backend, "refuses", trial) or "", str, backend, "refuses"))


def channels(backend: Backend, trial: Trial) -> frozenset[str] | None:
    """Names of the channels of `trial`, None while they are not known."""
    found = _asked(backend, "channels", trial)
    return None if found is None else _typed(found, frozenset, backend, "channels")


def execute(backend: Backend, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
    """How `trial` ended. No limit: the caller counts the time without samples."""
    return checked_ending(called(backend, "execute", trial, recorder, stop), backend)


def checked_ending(ending: Any, backend: object) -> Ending:
    """An ending with members of the right types."""
    told = _typed(ending, Ending, backend, "execute")
    fault = Fault.OTHER if told.fault is None else told.fault
    members = ((told.outcome, Outcome), (told.safe_state, SafeState), (fault, Fault))
    for member, wanted in (*members, (told.telemetry, Mapping)):
        _typed(member, wanted, backend, "execute")
    return told


def called(backend: object, method: str, *arguments: object) -> Any:
    """The answer of a method that needs no limit."""
    return _blaming(lambda: getattr(backend, method)(*arguments), backend, method)


def _blaming(work: Callable[[], Any], backend: object, method: str) -> Any:
    try:
        return work()
    except BaseException as error:
        if (fault := as_fault(error, backend, method)) is error:
            raise
        raise fault from error


def as_fault(error: BaseException, backend: object, method: str) -> BaseException:
    """`error` as BackendError, unless it is a message for the user, Ctrl-C, or our own bug."""
    by_user = isinstance(error, KeyboardInterrupt) and threading.current_thread() is _MAIN
    plug_in = blamed(error)
    bug = plug_in is None and _is_ours(backend) and isinstance(error, Exception)
    if by_user or bug or isinstance(error, CampaignError):
        return error
    who = plug_in.package if plug_in is not None else _named(backend)
    return BackendError(f"{method}() failed in {who}: {storable(one_line(error))}")


def _asked(backend: Backend, method: str, trial: Trial) -> Any:
    """Of thousands of trials: the program's own backends need no thread for each."""
    if _is_ours(backend):
        return called(backend, method, trial)
    return _within(LOOKING, backend, method, trial)


class Call(Generic[T]):
    """A function at work in a thread that is left behind when it hangs."""

    def __init__(self, work: Callable[[], T], name: str) -> None:
        self._answers: list[T] = []
        self._error: BaseException | None = None
        self._done = threading.Event()
        threading.Thread(target=self._run, args=(work,), name=name, daemon=True).start()

    def _run(self, work: Callable[[], T]) -> None:
        try:
            self._answers.append(work())
        except BaseException as error:  # noqa: BLE001 - for whoever asks for the answer
            self._error = error
        finally:
            self._done.set()

    def has_ended(self, timeout: float) -> bool:
        """Wait for the end for so long (s)."""
        return self._done.wait(timeout)

    def answer(self) -> T:
        """Once it has ended. Raises what the function raised."""
        if self._error is not None:
            raise self._error
        return self._answers[0]


_HANGING: dict[tuple[int, str], Call[Any]] = {}
"""By backend and method: calls that exceeded their limit; each keeps its backend."""


def _within(limit: float, backend: object, method: str, *arguments: object) -> Any:
    """The answer of a method in time. One that hangs is not called again until it has ended."""
    late = HangsError(f"{method}() of {_named(backend)} did not end within {limit:g} s")
    hung = _HANGING.get((id(backend), method))
    if hung is not None and not hung.has_ended(0.0):
        raise late
    call = Call(partial(called, backend, method, *arguments), method)
    with HEARTBEAT.expected():
        for _ in range(round(limit / TICK)):  # the sleep of this program does not count
            if call.has_ended(TICK):
                return call.answer()
            HEARTBEAT.beat()
    _HANGING[id(backend), method] = call
    raise late


def _typed(value: Any, wanted: type[T], backend: object, method: str) -> T:
    lacking = [each for each in METHODS.get(wanted, ()) if not callable(getattr(value, each, None))]
    if isinstance(value, wanted) and not lacking:
        return value
    lacks = f": it lacks {lacking[0]}()" if lacking else ""
    raise BackendError(
        f"{method}() of {_named(backend)} answered with {type(value).__name__!r}, "
        f"no {wanted.__name__}{lacks}"
    )


def _module(thing: object) -> str:
    """Of a function, or of the class of an object."""
    return getattr(thing if hasattr(thing, "__qualname__") else type(thing), "__module__", "") or ""


def _is_ours(thing: object) -> bool:
    return _module(thing).startswith("campaign.")


def _named(thing: object) -> str:
    """Who has written a backend, for messages."""
    plug_in = provider(_module(thing))
    own = getattr(thing, "__qualname__", type(thing).__qualname__)
    return plug_in.package if plug_in is not None else f"{_module(thing)}.{own}"
