"""Calls into a backend: time limit, checked answer, named faults.

A backend may be third-party code. Its exceptions become a BackendError that names its package; an
exception of this program's own backends is passed on as a bug. A call that exceeds its limit is
abandoned in a daemon thread.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
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
from campaign.channels import missing
from campaign.entry_points import blamed, one_line, provider
from campaign.errors import BackendError, CampaignError
from campaign.options import Options
from campaign.plain_text import storable
from campaign.recording import Ending, Fault, Outcome, PanicStop, Recorder, SafeState
from campaign.trial import Trial

CONNECTING, MAKING_SAFE, LEAVING, LOOKING = 25.0, 10.0, 4.0, 20.0
"""s; limits of `__enter__`, `make_safe`, `__exit__`, and of queries. With the limits of a trial
(`supervision.py`) a safe state is confirmed, or reported as not confirmed, within 40 s."""
TICK = 0.05
"""s between two checks of the clock."""
METHODS: Mapping[type, tuple[str, ...]] = {
    Backend: ("__enter__", "__exit__", "refuses", "channels", "execute", "make_safe"),
    SupportsExternalStop: ("introduce", "panic_stop", "clear_stop"),
}
_MAIN = threading.main_thread()
T = TypeVar("T")


class HangsError(BackendError):
    """A backend did not answer in time."""


class Heartbeat:
    """Signs of life from the loops that supervise a bench. The loops send them themselves: a
    separate thread would also send while they hang.

    Attributes:
        interval: s between two signs.
        send: receiver; called with False for the last sign before a pause.
    """

    interval = 0.5

    def __init__(self) -> None:
        self.send: Callable[[bool], None] = lambda more: None
        self._loops, self._due = 0, 0.0
        self._counting = threading.Lock()

    @contextmanager
    def expected(self) -> Iterator[None]:
        """Expect calls of `beat` inside the block."""
        with self._counting:
            self._loops += 1
            self.send(True)
        try:
            yield
        finally:
            with self._counting:
                self._loops -= 1
                if not self._loops:
                    self.send(False)

    def beat(self) -> None:
        """Called in each cycle of a loop; sends a sign if it is due."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + self.interval
            self.send(True)


HEARTBEAT = Heartbeat()
"""Heartbeat of this process."""


def opened(kind: BackendKind, options: Options) -> Backend:
    """Open a backend of `kind`. This and all functions below raise BackendError."""
    backend = _blaming(lambda: kind.open(options), kind.open, "open")
    if kind.stopped_outside:
        _typed(backend, SupportsExternalStop, kind.open, "open")  # type: ignore[type-abstract]
    return _typed(backend, Backend, kind.open, "open")  # type: ignore[type-abstract]


def connect(backend: Backend) -> None:
    """Enter `backend`; the returned object is ignored. Also raises HangsError."""
    _within(CONNECTING, backend, "__enter__")


def leave(backend: Backend, error: BaseException | None) -> None:
    """Leave `backend`; `error` is the exception that ended the work, or None."""
    trace = error.__traceback__ if error is not None else None
    _within(LEAVING, backend, "__exit__", type(error) if error else None, error, trace)


def make_safe(backend: Backend) -> SafeState:
    """Bring the bench to rest; whether that is confirmed."""
    return _typed(_within(MAKING_SAFE, backend, "make_safe"), SafeState, backend, "make_safe")


def panic_stop(backend: SupportsExternalStop) -> PanicStop | None:
    """The external stop that keeps the bench off, or None."""
    stop = _within(LOOKING, backend, "panic_stop")
    if stop is None:
        return None
    stop = _typed(stop, PanicStop, backend, "panic_stop")
    count = _typed(stop.count, int, backend, "panic_stop")
    known = isinstance(stop.age, int | float) and math.isfinite(stop.age)
    return PanicStop(count, storable(stop.by), stop.age if known else None)


def stop_command(backend: Backend) -> tuple[str, ...]:
    """Command that stops the bench after the death of this program; empty without one."""
    if not isinstance(backend, StoppedByCommand):
        return ()
    command = _typed(_within(LOOKING, backend, "stop_command"), tuple, backend, "stop_command")
    return tuple(_typed(word, str, backend, "stop_command") for word in command)


def refusal(backend: Backend, trial: Trial) -> str:
    """Why `backend` refuses `trial`; empty if it accepts it."""
    return storable(_typed(_asked(backend, "refuses", trial) or "", str, backend, "refuses"))


def unrecorded(backend: Backend, trial: Trial, names: Collection[str]) -> tuple[str, ...]:
    """Those of `names` that `backend` is known not to record in `trial`."""
    recorded = _asked(backend, "channels", trial) if names else None
    if recorded is None:
        return ()
    return missing(names, _typed(recorded, frozenset, backend, "channels"))


def execute(backend: Backend, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
    """Execute `trial`. Without time limit: the caller measures the time without samples."""
    return checked_ending(called(backend, "execute", trial, recorder, stop), backend)


def checked_ending(ending: Any, backend: object) -> Ending:
    """`ending`, after a check of its types."""
    answer = _typed(ending, Ending, backend, "execute")
    fault = Fault.OTHER if answer.fault is None else answer.fault
    members = ((answer.outcome, Outcome), (answer.safe_state, SafeState), (fault, Fault))
    for member, wanted in (*members, (answer.telemetry, Mapping)):
        _typed(member, wanted, backend, "execute")
    return answer


def called(backend: object, method: str, *arguments: object) -> Any:
    """Call a method without time limit."""
    return _blaming(lambda: getattr(backend, method)(*arguments), backend, method)


def _blaming(work: Callable[[], Any], backend: object, method: str) -> Any:
    try:
        return work()
    except BaseException as error:
        if (fault := as_fault(error, backend, method)) is error:
            raise
        raise fault from error


def as_fault(error: BaseException, backend: object, method: str) -> BaseException:
    """`error` as BackendError, unless it is a CampaignError, Ctrl-C, or a bug of this program."""
    by_user = isinstance(error, KeyboardInterrupt) and threading.current_thread() is _MAIN
    plug_in = blamed(error)
    bug = plug_in is None and _is_ours(backend) and isinstance(error, Exception)
    if by_user or bug or isinstance(error, CampaignError):
        return error
    who = plug_in.package if plug_in is not None else _named(backend)
    return BackendError(f"{method}() failed in {who}: {storable(one_line(error))}")


def _asked(backend: Backend, method: str, trial: Trial) -> Any:
    """Query about a trial; without a thread for own backends, as there are thousands of trials."""
    if _is_ours(backend):
        return called(backend, method, trial)
    return _within(LOOKING, backend, method, trial)


class Call(Generic[T]):
    """A function in a thread that can be abandoned if it hangs."""

    def __init__(self, work: Callable[[], T], name: str) -> None:
        self._answers: list[T] = []
        self._error: BaseException | None = None
        self._done = threading.Event()
        threading.Thread(target=self._run, args=(work,), name=name, daemon=True).start()

    def _run(self, work: Callable[[], T]) -> None:
        try:
            self._answers.append(work())
        except BaseException as error:  # noqa: BLE001 - raised by answer()
            self._error = error
        finally:
            self._done.set()

    def has_ended(self, timeout: float) -> bool:
        """Wait for the end, at most `timeout` (s)."""
        return self._done.wait(timeout)

    def answer(self) -> T:
        """Result, after the end. Raises the exception of the function."""
        if self._error is not None:
            raise self._error
        return self._answers[0]


_HANGING: dict[tuple[int, str], Call[Any]] = {}
"""Calls that exceeded their limit, by backend and method; each keeps its backend alive."""


def _within(limit: float, backend: object, method: str, *arguments: object) -> Any:
    """Call a method with a time limit. A hanging method is not called again until it has ended."""
    late = HangsError(f"{method}() of {_named(backend)} did not end within {limit:g} s")
    hung = _HANGING.get((id(backend), method))
    if hung is not None and not hung.has_ended(0.0):
        raise late
    call = Call(partial(called, backend, method, *arguments), method)
    with HEARTBEAT.expected():
        for _ in range(round(limit / TICK)):  # time in which this program is suspended is excluded
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
    """Module of a function, or of an object's class."""
    return getattr(thing if hasattr(thing, "__qualname__") else type(thing), "__module__", "") or ""


def _is_ours(thing: object) -> bool:
    return _module(thing).startswith("campaign.")


def _named(thing: object) -> str:
    """Package or module of a backend, for messages."""
    plug_in = provider(_module(thing))
    own = getattr(thing, "__qualname__", type(thing).__qualname__)
    return plug_in.package if plug_in is not None else f"{_module(thing)}.{own}"
