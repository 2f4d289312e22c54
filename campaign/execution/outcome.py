"""The outcome of a run and its exit code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ExitCode, worst_exit_code
from campaign.recording import Outcome, SafeState

_TRIAL_CODES = {
    Outcome.COMPLETED: ExitCode.DONE,
    Outcome.DIVERGED: ExitCode.TRIALS_FAILED,
    Outcome.LIMIT: ExitCode.LIMIT_OR_FAULT,
    Outcome.FAULT: ExitCode.LIMIT_OR_FAULT,
    Outcome.INTERRUPTED: ExitCode.TRIALS_FAILED,  # the run's status states by whom
}
_STATUS_CODES = {
    RunStatus.COMPLETE: ExitCode.DONE,
    RunStatus.FAILED_TRIALS: ExitCode.TRIALS_FAILED,
    RunStatus.INTERRUPTED: ExitCode.INTERRUPTED,
    RunStatus.FAULT: ExitCode.LIMIT_OR_FAULT,
}


@dataclass(frozen=True)
class RunOutcome:
    """Outcome of a run.

    Attributes:
        reason: why it ended early or is not confirmed safe; empty if complete.
        safe_state: state of the bench after the last trial.
        outcomes: number of trials by outcome.
        archive: path of the sealed file.
    """

    status: RunStatus
    reason: str
    safe_state: SafeState
    outcomes: Mapping[Outcome, int]
    archive: Path

    @property
    def exit_code(self) -> ExitCode:
        """Documented exit code: the worst of those of the run and its trials."""
        codes = [_TRIAL_CODES[outcome] for outcome, count in self.outcomes.items() if count]
        codes.append(_STATUS_CODES[self.status])
        if self.safe_state is not SafeState.CONFIRMED:
            codes.append(ExitCode.NOT_SAFE)
        return worst_exit_code(codes)
