"""Bringing the bench to rest at the end of a run, confirmed or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from campaign.backends import calls
from campaign.backends.interface import Backend
from campaign.entry_points import one_line
from campaign.errors import BackendError, CampaignError, ExitCode
from campaign.execution.run_reference import finished_trials
from campaign.recording import SafeState

SAFE = "safe state confirmed: the bench is at rest with its drive off"
LET_GO = "the backend could not let go of the bench"
NOT_SAFE = "SAFE STATE NOT CONFIRMED: look at the bench before anything else"


class AbortedError(CampaignError):
    """The run was aborted: its finished trials are kept, unsealed."""

    exit_code = ExitCode.INTERRUPTED


class NotSafeError(CampaignError):
    """The run broke off and the safe state is not confirmed; this precedes the original error."""

    exit_code = ExitCode.NOT_SAFE


@dataclass
class EarlyEnd:
    """Cause of an early end of the run, and final state of the bench.

    Attributes:
        kept: path of the finished trials: the open run, later the sealed archive; None if no trial
            was begun.
        fault: why the run cannot continue, or empty.
        bug: an exception that a backend must not raise.
        safe_state: last answer of the backend.
        unsafe: why the safe state is not confirmed, or empty.
    """

    kept: Path | None = None
    fault: str = ""
    bug: BaseException | None = None
    safe_state: SafeState = SafeState.NOT_CONFIRMED
    unsafe: str = ""


@contextmanager
def unsafe_first(ended: EarlyEnd) -> Iterator[None]:
    """Replace any error of the block by NotSafeError if the safe state is not confirmed."""
    try:
        yield
    except BaseException as error:
        if ended.unsafe:
            kept = f"; the finished trials are in {ended.kept}" if ended.kept else ""
            raise NotSafeError(f"{NOT_SAFE}; {ended.unsafe}; and {_why(error)}{kept}") from error
        raise


@contextmanager
def safe_afterwards(backend: Backend, ended: EarlyEnd) -> Iterator[None]:
    """Make the bench safe at any end of the block, and note the result in `ended`."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"; {finished_trials(ended.kept)}" if ended.kept else ""
        raise AbortedError(f"stopped at once{kept}") from None
    finally:
        make_safe(backend, ended)


@contextmanager
def safe_when_broken_off(backend: Backend) -> Iterator[None]:
    """Make a connected bench safe if the block raises, before the first trial."""
    ended = EarlyEnd()
    with unsafe_first(ended):
        try:
            yield
        except BaseException:
            make_safe(backend, ended)
            raise


@contextmanager
def connected(backend: Backend, report: Callable[[str], None]) -> Iterator[Backend]:
    """Connect the backend, and disconnect it after the block.

    Raises BackendError if disconnecting fails. If the block raised as well, its error is raised,
    and `report` is called with the error of disconnecting.
    """
    try:
        calls.connect(backend)
    except calls.HangsError:
        with safe_when_broken_off(backend):  # it may have begun to move
            raise
    try:
        yield backend
    except BaseException as error:
        try:
            calls.leave(backend, error)
        except Exception as second:  # noqa: BLE001 - the first error is the cause
            report(f"and {LET_GO}: {describe(second)}")
        raise
    try:
        calls.leave(backend, None)
    except Exception as error:
        raise BackendError(f"{LET_GO}: {describe(error)}") from error


def safe_at_once(backend: Backend) -> ExitCode:
    """Make the bench safe before the program exits, concurrently to other threads."""
    ended = EarlyEnd()
    make_safe(backend, ended)
    return ExitCode.NOT_SAFE if ended.unsafe else ExitCode.INTERRUPTED


def make_safe(backend: Backend, ended: EarlyEnd) -> None:
    """Call `make_safe` of the backend and note the result in `ended`."""
    ended.safe_state = SafeState.NOT_CONFIRMED
    ended.unsafe = "making the bench safe did not end"  # valid until it has ended
    try:
        ended.safe_state = calls.make_safe(backend)
    except KeyboardInterrupt:
        ended.unsafe = "making the bench safe was interrupted"
        raise
    except Exception as error:  # noqa: BLE001 - nothing may hide that the bench is not safe
        ended.unsafe = f"making the bench safe failed: {describe(error)}"
    else:
        safe = ended.safe_state is SafeState.CONFIRMED
        ended.unsafe = "" if safe else "the bench was not seen at rest with its drive off"


def describe(error: BaseException) -> str:
    """Text of an exception: the message of a CampaignError, else type and message on one line."""
    return str(error) if isinstance(error, CampaignError) else one_line(error)


def _why(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "the run was stopped at once"
    return f"{'' if isinstance(error, CampaignError) else 'internal error: '}{describe(error)}"
