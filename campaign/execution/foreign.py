"""Calls into a backend: each has a time limit, its answer is checked, and its faults are named.

A backend may be the code of anybody. What it raises is a BackendError here, also a SystemExit, with
the name of its package; an error of this program's own backends stays what it is, a bug. A call
that exceeds its limit goes on in a thread of its own that keeps no program from ending.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from campaign.backends.interface import Backend, BackendKind, StopFlag, StoppedOutside
from campaign.entry_points import blamed, one_line, provider
from campaign.errors import BackendError, CampaignError
from campaign.execution.heartbeat import HEARTBEAT
from campaign.options import Options
from campaign.plain_text import storable
from campaign.recording import Ending, Fault, Outcome, PanicStop, Recorder, SafeState
from campaign.trial import Trial

CONNECTING = 25.0
"""s that `__enter__` may take,"""
MAKING_SAFE = 10.0
"""`make_safe`,"""
LEAVING = 4.0
"""`__exit__`,"""
LOOKING = 20.0
"""and `panic_stop`. A bench that hangs is safe, or known not to be, within 40 s of all of them."""
TICK = 0.05
"""s between two looks at the clock."""
STOPPABLE = ("introduce", "panic_stop", "clear_stop")
METHODS = ("__enter__", "__exit__", "refuses", "channels", "execute", "make_safe")
_MAIN = threading.main_thread()

Answer = TypeVar("Answer")


class HangsError(BackendError):
    """A backend did not answer in time."""


def opened(kind: BackendKind, options: Options) -> Backend:
    """A backend of `kind`. Raises BackendError."""
    try:
        backend: object = kind.open(options)
    except BaseException as error:
        raise as_fault(error, kind.open, "open") from error
    stoppable = STOPPABLE if kind.stopped_outside else ()
    return _is_backend(backend, f"open() of {_named(kind.open)}", stoppable)


def connect(backend: Backend) -> Backend:
    """Enter `backend`. Raises HangsError, BackendError, and what its own code may raise."""
    entered = _within(CONNECTING, backend, "__enter__")
    return _is_backend(entered, f"__enter__() of {_named(backend)}")


def leave(backend: Backend, error: BaseException | None) -> None:
    """Let go of the bench; `error` is what ended the work. Raises as `connect`."""
    trace = error.__traceback__ if error is not None else None
    _within(LEAVING, backend, "__exit__", type(error) if error else None, error, trace)


def make_safe(backend: Backend) -> SafeState:
    """Bring the bench to rest. Raises as `connect`."""
    return _typed(_within(MAKING_SAFE, backend, "make_safe"), SafeState, backend, "make_safe")


def panic_stop(backend: StoppedOutside) -> PanicStop | None:
    """The stop from outside that keeps the bench off. Raises as `connect`."""
    found = _within(LOOKING, backend, "panic_stop")
    if found is None:
        return None
    stop = _typed(found, PanicStop, backend, "panic_stop")
    count = _typed(stop.count, int, backend, "panic_stop")
    age = stop.age if isinstance(stop.age, float) and math.isfinite(stop.age) else None
    return PanicStop(count, storable(stop.by), age)


def refusal(backend: Backend, trial: Trial) -> str:
    """Why `backend` does not execute `trial`; empty when it does. Raises BackendError."""
    found = _asked(backend, "refuses", trial)
    return "" if found is None else storable(_typed(found, str, backend, "refuses"))


def channels(backend: Backend, trial: Trial) -> frozenset[str] | None:
    """Names of the channels of `trial`, None while they are not known. Raises BackendError."""
    found = _asked(backend, "channels", trial)
    if found is not None:
        for name in _typed(found, frozenset, backend, "channels"):
            _typed(name, str, backend, "channels")
    return found  # type: ignore[no-any-return]


def execute(backend: Backend, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
    """How `trial` ended. No limit: whoever calls this counts the time without samples."""
    return checked_ending(called(backend, "execute", trial, recorder, stop), backend)


def checked_ending(ending: Any, backend: object) -> Ending:
    """An ending of a backend with members of the right types. Raises BackendError."""
    _typed(ending, Ending, backend, "execute")
    _typed(ending.outcome, Outcome, backend, "execute")
    _typed(ending.safe_state, SafeState, backend, "execute")
    _typed(ending.telemetry, Mapping, backend, "execute")  # type: ignore[type-abstract]
    if ending.fault is not None:
        _typed(ending.fault, Fault, backend, "execute")
    return ending  # type: ignore[no-any-return]


def called(backend: object, method: str, *arguments: object) -> Any:
    """The answer of a method that needs no limit. Raises BackendError for another's faults."""
    try:
        return getattr(backend, method)(*arguments)
    except BaseException as error:
        if (fault := as_fault(error, backend, method)) is error:
            raise
        raise fault from error


def as_fault(error: BaseException, backend: object, method: str) -> BaseException:
    """`error` as BackendError when this program did not raise it for itself."""
    by_user = isinstance(error, KeyboardInterrupt) and threading.current_thread() is _MAIN
    if by_user or isinstance(error, CampaignError):
        return error
    plug_in = blamed(error)
    if plug_in is None and _is_ours(backend) and isinstance(error, Exception):
        return error  # a bug
    who = plug_in.package if plug_in is not None else _named(backend)
    return BackendError(f"{method}() failed in {who}: {storable(one_line(error))}")


def _asked(backend: Backend, method: str, trial: Trial) -> Any:
    """Of thousands of trials: the program's own backends need no thread for each."""
    if _is_ours(backend):
        return called(backend, method, trial)
    return _within(LOOKING, backend, method, trial)


def _within(limit: float, backend: object, method: str, *arguments: object) -> Any:
    """The answer of a method, in a thread that is left behind after `limit` (s)."""
    answers: list[Any] = []
    errors: list[BaseException] = []
    done = threading.Event()

    def work() -> None:
        try:
            answers.append(called(backend, method, *arguments))
        except BaseException as error:  # noqa: BLE001 - for whoever waits
            errors.append(error)
        finally:
            done.set()

    threading.Thread(target=work, name=method, daemon=True).start()
    end = time.monotonic() + limit
    with HEARTBEAT.expected():
        while not done.wait(TICK):
            HEARTBEAT.beat()
            if time.monotonic() > end:
                raise HangsError(f"{method}() of {_named(backend)} did not end within {limit:g} s")
    if errors:
        raise errors[0]
    return answers[0]


def _typed(value: Any, wanted: type[Answer], backend: object, method: str) -> Answer:
    if isinstance(value, wanted):
        return value
    raise BackendError(
        f"{method}() of {_named(backend)} answered with {type(value).__name__!r}, "
        f"no {wanted.__name__}"
    )


def _is_backend(found: Any, who: str, also: Sequence[str] = ()) -> Backend:
    for method in (*METHODS, *also):
        if not callable(getattr(found, method, None)):
            name = type(found).__name__
            raise BackendError(f"{who} answered with {name!r}, no backend: it lacks {method}()")
    backend: Backend = found
    return backend


def _is_ours(thing: object) -> bool:
    return _module(thing).startswith("campaign.")


def _module(thing: object) -> str:
    """Of a function, or of the class of an object."""
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return getattr(named, "__module__", None) or ""


def _named(thing: object) -> str:
    """Who has written a backend, for messages."""
    plug_in = provider(_module(thing))
    own = getattr(thing, "__qualname__", type(thing).__qualname__)
    return plug_in.package if plug_in is not None else f"{_module(thing)}.{own}"
