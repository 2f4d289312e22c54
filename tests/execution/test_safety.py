"""A bench that was not seen safe is said first, whatever else happened."""

from __future__ import annotations

import _thread
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType

import pytest

from campaign.backends import calls
from campaign.backends.interface import BackendKind, Source
from campaign.errors import ArchiveError, BackendError, ExitCode
from campaign.execution.safety import (
    NOT_SAFE,
    AbortedError,
    EarlyEnd,
    NotSafeError,
    connected,
    describe,
    make_safe,
    safe_afterwards,
    safe_at_once,
    safe_when_broken_off,
    unsafe_first,
)
from campaign.options import Options
from campaign.recording import SafeState
from tests.execution.fakes import FakeBackend, make_trials

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
    assert EarlyEnd() == EarlyEnd(None, "", None, SafeState.NOT_CONFIRMED, "")


def test_seen_safe_is_seen_safe_also_after_it_was_not() -> None:
    ended = EarlyEnd(unsafe="not seen before")
    make_safe(FakeBackend(), ended)
    assert ended.safe_state is SafeState.CONFIRMED
    assert ended.unsafe == ""


FAILED = "making the bench safe failed"
FAKE = "tests.execution.fakes.FakeBackend"


@pytest.mark.parametrize(
    ("rest", "why"),
    [
        (not_seen, "the bench was not seen at rest with its drive off"),
        (raising(BackendError("port is gone")), "making the bench safe failed: port is gone"),
        (
            raising(SystemExit(0)),
            f"making the bench safe failed: make_safe() failed in {FAKE}: SystemExit: 0",
        ),
        (lambda: "confirmed", f"{FAILED}: make_safe() of {FAKE} answered with 'str', no SafeState"),
    ],
)
def test_not_seen_safe_says_why_also_after_it_was(rest: Callable[[], SafeState], why: str) -> None:
    ended = EarlyEnd(safe_state=SafeState.CONFIRMED)
    make_safe(resting(rest), ended)
    assert ended.safe_state is SafeState.NOT_CONFIRMED
    assert ended.unsafe == why


@pytest.mark.usefixtures("heeding_ctrl_c")
def test_who_interrupts_making_safe_leaves_the_bench_unsafe() -> None:
    def interrupted() -> SafeState:
        _thread.interrupt_main()
        time.sleep(5.0)
        return SafeState.CONFIRMED

    ended = EarlyEnd(safe_state=SafeState.CONFIRMED)
    with pytest.raises(KeyboardInterrupt):
        make_safe(resting(interrupted), ended)
    assert ended.safe_state is SafeState.NOT_CONFIRMED
    assert ended.unsafe == "making the bench safe was interrupted"


def test_an_error_of_a_safe_bench_is_its_own() -> None:
    with pytest.raises(ArchiveError, match=r"^no space left$"), unsafe_first(EarlyEnd(kept=RUN)):
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
    with pytest.raises(NotSafeError) as said, unsafe_first(EarlyEnd(unsafe="nobody looked")):
        raise error
    assert str(said.value) == f"{NOT_SAFE}; nobody looked; and {why}"
    assert said.value.__cause__ is error
    with pytest.raises(NotSafeError) as said, unsafe_first(EarlyEnd(RUN, unsafe="nobody looked")):
        raise error
    assert str(said.value).endswith(f"{why}; the finished trials are in {RUN}")


def test_a_block_that_ends_well_ends_well() -> None:
    ended, backend = EarlyEnd(unsafe="nobody looked"), FakeBackend()
    with unsafe_first(ended), safe_afterwards(backend, ended):
        assert backend.log == []
    assert backend.log == ["made safe"]
    assert ended.unsafe == ""


def test_a_block_that_raises_is_made_safe_and_its_error_goes_on() -> None:
    ended, backend = EarlyEnd(kept=RUN), FakeBackend()
    with pytest.raises(ArchiveError), safe_afterwards(backend, ended):
        raise ArchiveError("no space left")
    assert backend.log == ["made safe"]
    assert ended.safe_state is SafeState.CONFIRMED


def test_a_stop_by_force_is_made_safe_and_says_what_is_kept_and_how_to_go_on() -> None:
    backend = FakeBackend()
    with pytest.raises(AbortedError) as aborted, safe_afterwards(backend, EarlyEnd(kept=RUN)):
        raise KeyboardInterrupt
    assert backend.log == ["made safe"]
    assert aborted.value.exit_code is ExitCode.INTERRUPTED
    assert str(aborted.value) == (
        f"stopped at once; the finished trials are in {RUN}; to see them, and to continue:\n"
        "  campaign report run\n  campaign resume run"
    )
    with (
        pytest.raises(AbortedError, match=r"^stopped at once$"),
        safe_afterwards(FakeBackend(), EarlyEnd()),
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


EXIT = "__exit__() failed in tests.execution.test_safety.Clinging"


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
    ("error", "what"),
    [(OSError("busy"), f"{EXIT}: OSError: busy"), (BackendError("stuck"), "stuck")],
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


class Hanging(FakeBackend):
    """Each of its methods waits until it is let go; which were called is in its log."""

    def __init__(self, *hangs: str) -> None:
        super().__init__()
        self.hangs, self.let_go = hangs, threading.Event()

    def wait(self, method: str) -> None:
        self.log.append(method)
        if method in self.hangs:
            assert threading.current_thread().daemon, "it would keep the program"
            self.let_go.wait(60)

    def __enter__(self) -> FakeBackend:
        self.wait("enter")
        return self

    def __exit__(self, *exception: object) -> None:
        self.wait("exit")

    def make_safe(self) -> SafeState:
        self.wait("make safe")
        return SafeState.CONFIRMED


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Hanging]]:
    made: list[Hanging] = []

    def make(*hangs: str) -> Hanging:
        made.append(Hanging(*hangs))
        return made[-1]

    for limit in ("CONNECTING", "MAKING_SAFE", "LEAVING"):
        monkeypatch.setattr(f"campaign.backends.calls.{limit}", 0.05)
    yield make
    for each in made:
        each.let_go.set()


def test_a_bench_that_hangs_while_it_is_connected_is_made_safe(
    hanging: Callable[..., Hanging],
) -> None:
    """It may have begun to move."""
    backend = hanging("enter")
    late = pytest.raises(BackendError, match=r"__enter__\(\) of tests.*Hanging did not end within")
    with late, connected(backend, pytest.fail):
        pytest.fail("it is not connected")
    assert backend.log == ["enter", "make safe"]
    both = hanging("enter", "make safe")
    with pytest.raises(NotSafeError, match="did not end within"), connected(both, pytest.fail):
        pytest.fail("it is not connected")


def test_a_bench_that_cannot_be_connected_is_not_made_safe() -> None:
    class Refuses(FakeBackend):
        def __enter__(self) -> FakeBackend:
            raise BackendError("no such port")

    backend = Refuses()
    with pytest.raises(BackendError, match=r"^no such port$"), connected(backend, pytest.fail):
        pytest.fail("it is not connected")
    assert backend.log == []


def test_a_backend_that_does_not_let_go_is_left_behind(hanging: Callable[..., Hanging]) -> None:
    late = pytest.raises(BackendError, match=r"could not let go .* did not end within 0.05 s")
    with late, connected(hanging("exit"), pytest.fail):
        pass


@pytest.mark.parametrize("method", ["execute", "make_safe", "refuses", "__exit__"])
def test_a_backend_that_lacks_a_method_is_refused_by_name(method: str) -> None:
    lacking = type("Lacking", (FakeBackend,), {method: None})()
    kind = BackendKind("tx1", "a drive", Options, lambda options: lacking, Source.HARDWARE)
    with pytest.raises(BackendError, match=rf"^open\(\) of tests.*: it lacks {method}\(\)$"):
        calls.opened(kind, Options())


def test_an_exception_is_its_type_and_what_it_says() -> None:
    assert describe(ValueError("no")) == "ValueError: no"
    assert describe(ValueError()) == "ValueError"


def test_what_hangs_is_not_called_again_until_it_has_ended(hanging: Callable[..., Hanging]) -> None:
    backend = hanging("make safe")
    assert safe_at_once(backend) is ExitCode.NOT_SAFE
    assert safe_at_once(backend) is ExitCode.NOT_SAFE
    assert backend.log == ["make safe"]
    backend.let_go.set()
    while safe_at_once(backend) is ExitCode.NOT_SAFE:
        pass
    assert backend.log.count("make safe") == 2


@pytest.mark.parametrize(("command", "why"), [("stop it", "'str'"), (("stop", Path()), "Path'")])
def test_a_command_that_is_none_is_a_fault_by_name(command: object, why: str) -> None:
    backend = type("Stops", (FakeBackend,), {"stop_command": lambda self: command})()
    with pytest.raises(BackendError, match=rf"^stop_command\(\) of tests.*{why}"):
        calls.stop_command(backend)


def test_a_backend_without_such_a_command_has_none() -> None:
    assert calls.stop_command(FakeBackend()) == ()


def test_a_bug_of_our_own_is_not_its_own_cause() -> None:
    bug = ValueError("a bug")
    backend = type("Own", (FakeBackend,), {"__module__": "campaign.own", "refuses": _raise(bug)})()
    with pytest.raises(ValueError, match="a bug") as caught:
        calls.refusal(backend, make_trials(1)[0])
    assert caught.value.__cause__ is None


def _raise(error: Exception) -> Callable[..., None]:
    def method(*arguments: object) -> None:
        raise error

    return method
