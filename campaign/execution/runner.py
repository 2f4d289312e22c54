"""Execution of a plan on a backend, trial by trial, into an archive.

A failed trial is recorded; the protocol's policy decides whether it is repeated, is skipped, or
ends the run. A stop request, a backend that gives up, and an unconfirmed safe state after a trial
also end the run early. At every end the bench is made safe last, and the archive states the cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from campaign.archive.layout.journal import utc_now
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_metrics import Measure
from campaign.archive.writing.writer import RunWriter
from campaign.backends.interface import Backend, KnowsCost
from campaign.execution.attempt import Conditions
from campaign.execution.batches import Batches
from campaign.execution.executors import OpenExecutor, thread_executor
from campaign.execution.operator_prompts import UNATTENDED, Attendance
from campaign.execution.outcome import RunOutcome
from campaign.execution.progress import Display, Ledger
from campaign.execution.safety import EarlyEnd, safe_afterwards, unsafe_first
from campaign.execution.sequence import TrialSequence
from campaign.execution.stages import Stages
from campaign.execution.stop import StopSwitch
from campaign.execution.supervision import Supervision
from campaign.policy import Policy, SampleRetention
from campaign.recording import Outcome, PanicStop
from campaign.stopwatch import Work
from campaign.trial import Trial

SIMULATED = Supervision()
_NOTHING: Mapping[int, Outcome] = MappingProxyType({})


def run_plan(
    trials: Sequence[Trial],
    backend: Backend,
    writer: RunWriter,
    *,
    workers: int,
    display: Display,
    stop: StopSwitch,
    policy: Policy | None = None,
    attendance: Attendance = UNATTENDED,
    supervision: Supervision = SIMULATED,
    measure: Measure | None = None,
    finished: Mapping[int, Outcome] = _NOTHING,
    stages: Stages | None = None,
    executor: OpenExecutor | None = None,
) -> RunOutcome:
    """Execute `trials` in order on a connected backend and seal the archive.

    Args:
        trials: the whole plan, and the stages' trials of earlier sessions.
        workers: number of trials executed at once; more than one only for a parallel backend.
        display: called at the begin and end of trials and periodically, from this thread.
        stop: checked before every trial, and by the backend during trials.
        policy: response to failed trials, and rests; None: skip, no rests.
        attendance: the operator, and whether pauses take time.
        supervision: supervision and subscribers of each trial.
        measure: computes metrics of a recording for the archive; None: no metrics.
        finished: outcomes of trials that are not executed again, by number.
        stages: stages whose trials may follow.
        executor: executor of batches; None: `workers` threads of this process.

    Raises:
        NotSafeError: instead of any other, if the safe state is not confirmed.
        AbortedError: a second Ctrl-C; nothing is sealed.
        CampaignError: the archive is no longer writable; nothing is sealed.
        Exception: a bug in a backend, after the archive is sealed as a fault.
    """
    ledger = Ledger(trials, display, finished, computed=isinstance(backend, KnowsCost))
    ended = EarlyEnd(kept=writer.folder)
    policy = policy or Policy()
    stages = stages or Stages((), (), writer, {}, lambda trial: "")
    waiting = stages.in_order(trial for trial in trials if trial.number not in finished)
    supervision = replace(supervision, subscribers=(*supervision.subscribers, ledger.reached))
    live = supervision.live
    batches = Batches(waiting, backend, workers, live=live)
    sequence = TrialSequence(
        trials, batches, backend, writer, ledger, ended, stop, policy, attendance, stages, live
    )
    keeping = SampleRetention.of(policy.keep, trials)
    conditions = Conditions(backend, writer, sequence.halted, supervision, measure, keeping)
    opened = (
        thread_executor(workers, conditions) if executor is None else executor(conditions, writer)
    )
    with unsafe_first(ended):
        with (
            supervision.timing.span(Work.WAITING),
            safe_afterwards(backend, ended),
            opened as at_work,
        ):
            sequence.execute(at_work)
        sequence.outside.look()  # a stop may have come after the last trial
        outside = sequence.outside.stop
        status, reason = _verdict(ledger, ended, stop, outside, stages)
        ledger.close()
        ended.kept = writer.seal(status, reason, ended.safe_state, ended=utc_now())
        if ended.bug:
            raise ended.bug
    return RunOutcome(status, reason, ended.safe_state, ledger.outcomes, ended.kept)


def _verdict(
    ledger: Ledger, ended: EarlyEnd, stop: StopSwitch, outside: PanicStop | None, stages: Stages
) -> tuple[RunStatus, str]:
    """Status of the run, and all its reasons."""
    cut = stop() and (ledger.left or stages.left or Outcome.INTERRUPTED in ledger.outcomes)
    interrupted = cut or outside is not None
    if interrupted:
        status = RunStatus.INTERRUPTED
    elif ended.fault:
        status = RunStatus.FAULT
    elif ledger.outcomes.keys() - {Outcome.COMPLETED} or stages.failed:
        status = RunStatus.FAILED_TRIALS
    else:
        status = RunStatus.COMPLETE
    by_stop = str(outside) if outside is not None else f"stopped by {stop.reason}"
    reasons = (by_stop if interrupted else "", ended.fault, ended.unsafe, stages.failed)
    return status, "; ".join(dict.fromkeys(filter(None, reasons)))
