"""A bench that was not seen safe is said first, whatever else happened."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import pytest

from campaign.errors import ArchiveError, BackendError, ExitCode
from campaign.execution.safety import (
    NOT_SAFE,
    AbortedError,
    Ended,
    NotSafeError,
    connected,
    describe,
    make_safe,
    safe_afterwards,
    safe_at_once,
    safe_when_broken_off,
    unsafe_first,
)
from campaign.recording import SafeState
from tests.execution.fakes import FakeBackend

RUN = Path("results/run.partial")


def resting(rest: Callable[[], SafeState]) -> FakeBackend:
    return FakeBackend(rest=rest)


def not_seen() -> SafeState:
    return SafeState.NOT_CONFIRMED


def raising(error: BaseException) -> Callable[[], SafeState]:
    def rest() -> SafeState:
        raise error

    return rest


def test_nothing_counts_as_safe_until_it_was_seen() -> None:
    assert Ended() == Ended(None, "", None, SafeState.NOT_CONFIRMED, "")


def test_seen_safe_is_seen_safe_also_after_it_was_not() -> None:
    ended = Ended(unsafe="not seen before")
    make_safe(FakeBackend(), ended)
    assert ended.safe_state is SafeState.CONFIRMED
    assert ended.unsafe == ""


@pytest.mark.parametrize(
    ("rest", "why"),
    [
        (not_seen, "the bench was not seen at rest with its drive off"),
        (raising(OSError("port is gone")), "making the bench safe failed: OSError: port is gone"),
        (raising(ValueError()), "making the bench safe failed: ValueError"),
    ],
)
def test_not_seen_safe_says_why_also_after_it_was(rest: Callable[[], SafeState], why: str) -> None:
    ended = Ended(safe_state=SafeState.CONFIRMED)
    make_safe(resting(rest), ended)
    assert ended.safe_state is SafeState.NOT_CONFIRMED
    assert ended.unsafe == why


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (KeyboardInterrupt(), "making the bench safe was interrupted"),
        (SystemExit(), "making the bench safe did not end"),
    ],
)
def test_what_breaks_making_safe_off_goes_on_and_leaves_the_bench_unsafe(
    error: BaseException, why: str
) -> None:
    ended = Ended(safe_state=SafeState.CONFIRMED)
    with pytest.raises(type(error)):
        make_safe(resting(raising(error)), ended)
    assert ended.safe_state is SafeState.NOT_CONFIRMED
    assert ended.unsafe == why


def test_an_error_of_a_safe_bench_is_its_own() -> None:
    with pytest.raises(ArchiveError, match=r"^no space left$"), unsafe_first(Ended(kept=RUN)):
        raise ArchiveError("no space left")


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (ArchiveError("no space left"), "no space left"),
        (ZeroDivisionError("oops"), "internal error: ZeroDivisionError: oops"),
        (KeyboardInterrupt(), "the run was stopped at once"),
    ],
)
def test_an_unsafe_bench_is_said_first_then_why_then_what_is_kept(
    error: BaseException, why: str
) -> None:
    with pytest.raises(NotSafeError) as said, unsafe_first(Ended(unsafe="nobody looked")):
        raise error
    assert str(said.value) == f"{NOT_SAFE}; nobody looked; and {why}"
    assert said.value.__cause__ is error
    with pytest.raises(NotSafeError) as said, unsafe_first(Ended(RUN, unsafe="nobody looked")):
        raise error
    assert str(said.value).endswith(f"{why}; the finished trials are in {RUN}")


def test_a_block_that_ends_well_ends_well() -> None:
    ended, backend = Ended(unsafe="nobody looked"), FakeBackend()
    with unsafe_first(ended), safe_afterwards(backend, ended):
        assert backend.log == []
    assert backend.log == ["made safe"]
    assert ended.unsafe == ""


def test_a_block_that_raises_is_made_safe_and_its_error_goes_on() -> None:
    ended, backend = Ended(kept=RUN), FakeBackend()
    with pytest.raises(ArchiveError), safe_afterwards(backend, ended):
        raise ArchiveError("no space left")
    assert backend.log == ["made safe"]
    assert ended.safe_state is SafeState.CONFIRMED


def test_a_stop_by_force_is_made_safe_and_says_what_is_kept_and_how_to_go_on() -> None:
    backend = FakeBackend()
    with pytest.raises(AbortedError) as aborted, safe_afterwards(backend, Ended(kept=RUN)):
        raise KeyboardInterrupt
    assert backend.log == ["made safe"]
    assert aborted.value.exit_code is ExitCode.INTERRUPTED
    assert str(aborted.value) == (
        f"stopped at once; the finished trials are in {RUN}; to see them, and to go on from "
        "there:\n  campaign report run\n  campaign resume run"
    )
    with (
        pytest.raises(AbortedError, match=r"^stopped at once$"),
        safe_afterwards(FakeBackend(), Ended()),
    ):
        raise KeyboardInterrupt


def test_a_connected_bench_is_made_safe_only_when_the_block_breaks_off() -> None:
    backend = FakeBackend()
    with safe_when_broken_off(backend):
        pass
    assert backend.log == []
    with pytest.raises(ArchiveError), safe_when_broken_off(backend):
        raise ArchiveError("no space left")
    assert backend.log == ["made safe"]
    unsafe = pytest.raises(NotSafeError, match="not seen at rest")
    with unsafe, safe_when_broken_off(resting(not_seen)):
        raise KeyboardInterrupt


class Clinging(FakeBackend):
    """Cannot let go."""

    error: Exception = OSError("busy")

    def __exit__(self, *exception: object) -> None:
        self.log.append(exception[0])
        raise self.error


def test_a_backend_is_let_go_of_and_told_how_the_block_ended() -> None:
    class Noted(FakeBackend):
        def __exit__(self, *exception: object) -> None:
            self.log.append(exception)

    backend, error = Noted(), ArchiveError("no space left")
    with connected(backend, pytest.fail) as entered:
        assert entered is backend
    with pytest.raises(ArchiveError), connected(backend, pytest.fail):
        raise error
    good, bad = backend.log
    assert good == (None, None, None)
    assert bad[:2] == (ArchiveError, error)
    assert isinstance(bad[2], TracebackType)


@pytest.mark.parametrize(
    ("error", "what"), [(OSError("busy"), "OSError: busy"), (BackendError("stuck"), "stuck")]
)
def test_what_cannot_let_go_hides_nothing(error: Exception, what: str) -> None:
    backend = Clinging()
    backend.error = error
    said = f"the backend could not let go of the bench: {what}"
    told: list[str] = []
    with pytest.raises(ArchiveError, match="no space left"), connected(backend, told.append):
        raise ArchiveError("no space left")
    assert told == [f"and {said}"]
    with pytest.raises(BackendError) as raised, connected(backend, told.append):
        pass
    assert str(raised.value) == said
    assert backend.log == [ArchiveError, None]
    assert len(told) == 1


def test_leaving_at_once_says_whether_the_bench_was_seen_safe() -> None:
    assert safe_at_once(FakeBackend()) is ExitCode.INTERRUPTED
    assert safe_at_once(resting(not_seen)) is ExitCode.NOT_SAFE
    assert safe_at_once(resting(raising(OSError()))) is ExitCode.NOT_SAFE


def test_leaving_at_once_waits_for_a_bench_that_takes_a_moment() -> None:
    def slow() -> SafeState:
        time.sleep(0.3)
        return SafeState.CONFIRMED

    assert safe_at_once(resting(slow)) is ExitCode.INTERRUPTED


def test_leaving_at_once_does_not_wait_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """And what it no longer waits for does not keep the program."""
    monkeypatch.setattr("campaign.execution.safety.AT_ONCE", 0.05)
    let_go, threads = threading.Event(), []

    def hang() -> SafeState:
        threads.append(threading.current_thread())
        assert let_go.wait(60)
        return SafeState.CONFIRMED

    try:
        assert safe_at_once(resting(hang)) is ExitCode.NOT_SAFE
        assert all(thread.daemon for thread in threads)
    finally:
        let_go.set()
    for thread in threads:
        thread.join(60)


def test_an_exception_is_its_type_and_what_it_says() -> None:
    assert describe(ValueError("no")) == "ValueError: no"
    assert describe(ValueError()) == "ValueError"
