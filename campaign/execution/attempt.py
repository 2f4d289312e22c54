"""Executing one trial once, in a worker thread, into its own file of the archive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from campaign.backends.interface import Backend
from campaign.errors import BackendError, CampaignError
from campaign.execution.recorder import SupervisingRecorder
from campaign.execution.safety import describe
from campaign.execution.writer import PlanWriter
from campaign.trial import Ending, Outcome, SafeState, Trial


@dataclass(frozen=True)
class Executed:
    """How an attempt ended.

    Attributes:
        bug: an exception that no backend should raise.
        gave_up: whether the backend cannot execute any other trial.
    """

    ending: Ending
    bug: Exception | None = None
    gave_up: bool = False


def execute_once(
    trial: Trial, backend: Backend, writer: PlanWriter, halted: Callable[[], bool]
) -> Executed:
    """One attempt at `trial`, archived however it ends. Raises only what the archive raises."""
    started = utc_now()
    file = writer.begin(trial)
    try:
        executed = Executed(backend.execute(trial, SupervisingRecorder(file), halted))
    except BackendError as error:
        ending = Ending(Outcome.FAULT, str(error), SafeState.NOT_CONFIRMED)
        executed = Executed(ending, gave_up=True)
    except CampaignError:
        raise  # from the recorder: the archive cannot be written
    except Exception as error:  # noqa: BLE001 - a bug in a backend must not cost the archive
        reason = f"internal error: {describe(error)}"
        ending = Ending(Outcome.FAULT, reason, SafeState.NOT_CONFIRMED)
        executed = Executed(ending, bug=error, gave_up=True)
    file.finish(executed.ending, started, utc_now())
    return executed


def utc_now() -> str:
    """The wall clock as archives keep it: ISO 8601, UTC, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
