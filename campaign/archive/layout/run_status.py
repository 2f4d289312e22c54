"""Status of a run."""

from enum import StrEnum


class RunStatus(StrEnum):
    """Status of a run. Sealing writes every status except `INCOMPLETE`."""

    COMPLETE = "complete"  # every planned trial completed
    FAILED_TRIALS = "failed trials"  # the plan was executed; some trials did not complete
    INTERRUPTED = "interrupted"  # an operator stopped it
    FAULT = "fault"  # the backend, the bench or the archive failed
    INCOMPLETE = "incomplete"  # in progress, or killed: no end is recorded
