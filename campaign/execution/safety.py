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
from campaign.execution.run_reference import how_to_go_on
from campaign.recording import SafeState

SAFE = "safe state confirmed: the bench is at rest with its drive off"
LET_GO = "the backend could not let go of the bench"
NOT_SAFE = "SAFE STATE NOT CONFIRMED: look at the bench before anything else"


class AbortedError(CampaignError):
    """The run was stopped at once, by force: what it had finished is kept, unsealed."""

    exit_code = ExitCode.INTERRUPTED


class NotSafeError(CampaignError):
    """The run broke off and nobody saw the bench safe: that comes before why it broke off."""

    exit_code = ExitCode.NOT_SAFE


@dataclass
class EarlyEnd:
    """What ended the run early, and how the bench was left.

    Attributes:
        kept: where the finished trials are: the open run, and once it is sealed the archive; None
            when nothing was begun.
        fault: why the run cannot go on, or empty.
        bug: an exception that no backend should raise.
        safe_state: what the backend said last.
        unsafe: why the safe state could not be confirmed, or empty.
    """

    kept: Path | None = None
    fault: str = ""
    bug: BaseException | None = None
    safe_state: SafeState = SafeState.NOT_CONFIRMED
    unsafe: str = ""


@contextmanager
def unsafe_first(ended: EarlyEnd) -> Iterator[None]:
    """Whatever ends the block: a bench not known to be safe is said first, with its own code."""
    try:
        yield
    except BaseException as error:
        if ended.unsafe:
            kept = f"; the finished trials are in {ended.kept}" if ended.kept else ""
            raise NotSafeError(f"{NOT_SAFE}; {ended.unsafe}; and {_why(error)}{kept}") from error
        raise


@contextmanager
def safe_afterwards(backend: Backend, ended: EarlyEnd) -> Iterator[None]:
    """Bring the bench to rest however the block ends, and note whether that was seen."""
    try:
        yield
    except KeyboardInterrupt:
        go_on = f"; {how_to_go_on(ended.kept)}" if ended.kept else ""
        kept = f"; the finished trials are in {ended.kept}" if ended.kept else ""
        raise AbortedError(f"stopped at once{kept}{go_on}") from None
    finally:
        make_safe(backend, ended)


@contextmanager
def safe_when_broken_off(backend: Backend) -> Iterator[None]:
    """Bring a connected bench to rest when the block raises, before any trial was begun."""
    ended = EarlyEnd()
    with unsafe_first(ended):
        try:
            yield
        except BaseException:
            make_safe(backend, ended)
            raise


@contextmanager
def connected(backend: Backend, tell: Callable[[str], None]) -> Iterator[Backend]:
    """A connected backend. Letting go of it cannot hide what happened in the block.

    Raises BackendError when letting go fails after a block that did not raise; after one that did,
    its error goes on and `tell` is told of the other.
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
        except Exception as second:  # noqa: BLE001 - the first one says more
            tell(f"and {LET_GO}: {describe(second)}")
        raise
    try:
        calls.leave(backend, None)
    except Exception as error:
        raise BackendError(f"{LET_GO}: {describe(error)}") from error


def safe_at_once(backend: Backend) -> ExitCode:
    """Bring the bench to rest, whatever other threads do meanwhile, before the program is left."""
    ended = EarlyEnd()
    make_safe(backend, ended)
    return ExitCode.NOT_SAFE if ended.unsafe else ExitCode.INTERRUPTED


def make_safe(backend: Backend, ended: EarlyEnd) -> None:
    """Tell the bench to come to rest; afterwards `ended` says whether it was seen to."""
    ended.safe_state = SafeState.NOT_CONFIRMED
    ended.unsafe = "making the bench safe did not end"  # until it has, whatever breaks it off
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
    """An exception by its type and what it says; a message for the user as it is."""
    return str(error) if isinstance(error, CampaignError) else one_line(error)


def _why(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "the run was stopped at once"
    return f"{'' if isinstance(error, CampaignError) else 'internal error: '}{describe(error)}"
