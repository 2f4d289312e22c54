"""Check of a bench with an external stop: the stop holds."""

from __future__ import annotations

from campaign.backends.interface import Backend, SupportsExternalStop
from campaign.errors import BackendError
from campaign.recording import Ending, Outcome, PanicStop
from campaign.testing.backend_under_test import BackendUnderTest, CheckFailedError, require
from campaign.testing.strict_recorder import StrictRecorder
from campaign.trial import Trial


def keeps_a_stop_from_outside(under_test: BackendUnderTest) -> None:
    """Once stopped it says by whom, and moves again only after just that stop was cleared."""
    with under_test.open() as backend:
        if not isinstance(backend, SupportsExternalStop):
            told = "a way to stop it is given (stop_outside), but it cannot tell of a stop"
            require(under_test.stop_outside is None, told)
            return
        require(under_test.stop_outside, "it can be stopped from outside: stop_outside says how")
        require(backend.panic_stop() is None, "it is stopped before a stop was sent")
        _stopped_in_mid_trial(under_test, backend)
        first = _found(backend)
        _moves_nothing(under_test.possible, backend)
        backend.make_safe()
        _found(backend)  # nor does coming to rest clear it
        _does_not_clear(backend, first.count + 1)
        _stop(under_test)
        _does_not_clear(backend, first.count)
        backend.clear_stop(_found(backend).count)
        require(backend.panic_stop() is None, "it is stopped after the stop was cleared")
        ending = _execute(under_test.possible, backend, StrictRecorder())
        told = f"after the stop was cleared, the trial ended as {ending.outcome}: {ending.reason}"
        require(ending.outcome is Outcome.COMPLETED, told)


def _stopped_in_mid_trial(under_test: BackendUnderTest, backend: Backend) -> None:
    recorder = StrictRecorder(lambda count: _stop(under_test) if count == 1 else None)
    ending = _execute(under_test.possible, backend, recorder)
    told = f"a trial stopped from outside ended as {ending.outcome}, not as interrupted"
    require(ending.outcome is Outcome.INTERRUPTED, told)


def _moves_nothing(trial: Trial, backend: Backend) -> None:
    recorder = StrictRecorder()
    ending = _execute(trial, backend, recorder)
    require(not recorder.blocks, f"{recorder.blocks} blocks were recorded on a stopped bench")
    told = f"a trial on a stopped bench ended as {ending.outcome}, not as interrupted"
    require(ending.outcome is Outcome.INTERRUPTED, told)


def _found(backend: SupportsExternalStop) -> PanicStop:
    found = backend.panic_stop()
    if found is None or not found.by.strip():
        raise CheckFailedError(f"panic_stop() answered {found!r} on a stopped bench")
    return found


def _does_not_clear(backend: SupportsExternalStop, count: int) -> None:
    try:
        backend.clear_stop(count)
    except BackendError:
        _found(backend)
        return
    raise CheckFailedError(f"clear_stop({count}) cleared another stop than the latest")


def _execute(trial: Trial, backend: Backend, recorder: StrictRecorder) -> Ending:
    return backend.execute(trial, recorder, lambda: False)


def _stop(under_test: BackendUnderTest) -> None:
    if under_test.stop_outside is not None:
        under_test.stop_outside()
