"""Executing a plan on a backend, trial by trial, into an archive.

A trial that fails is recorded, and the protocol's policy says whether it is executed again, is
skipped, or ends the run. It ends early, too, when somebody stops it, when the backend gives up, and
when nobody sees the bench at rest after a trial. However it ends, the bench is brought to rest
last, and the archive says what happened.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from campaign.archive.layout.header import RunStatus
from campaign.archive.layout.journal import utc_now
from campaign.archive.reading.archived_metrics import Measure
from campaign.backends.interface import Backend, KnowsCost
from campaign.execution.attempt import Conditions
from campaign.execution.executors import OpenExecutor, thread_executor
from campaign.execution.operator_prompts import UNATTENDED, Attendance
from campaign.execution.outcome import RunOutcome
from campaign.execution.progress import Display, Ledger
from campaign.execution.safety import EarlyEnd, safe_afterwards, unsafe_first
from campaign.execution.sequence import TrialSequence
from campaign.execution.stages import Stages, no_stages
from campaign.execution.stop import StopSwitch
from campaign.execution.supervision import Supervision
from campaign.execution.writer import PlanWriter
from campaign.policy import Policy, SampleRetention
from campaign.recording import Outcome, PanicStop
from campaign.stopwatch import Work
from campaign.trial import Trial

SIMULATED = Supervision()
_NOTHING: Mapping[int, Outcome] = MappingProxyType({})


def run_plan(
    trials: Sequence[Trial],
    backend: Backend,
    writer: PlanWriter,
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
        trials: the whole plan, and what has followed from it in an earlier session.
        workers: trials executed at once; more than one only where the backend is parallel.
        display: told whenever a trial begins or ends and now and then, from this thread.
        stop: asked before every trial, and by the backend during one.
        policy: what to do about trials that fail, and when to rest; absent: skip, and never.
        attendance: who is asked, and whether pauses are waited for.
        supervision: how each trial is watched, and by whom besides.
        measure: what a recording says by itself, to be archived with it; absent: nothing is.
        finished: trials of the plan that are not to be executed again, by number.
        stages: what may follow from the trials.
        executor: what executes batches; absent: so many threads of this process.

    Raises:
        NotSafeError: in place of any of the others, when the bench was not seen safe either.
        AbortedError: a second Ctrl-C; nothing is sealed.
        CampaignError: the archive cannot be written any more; nothing is sealed.
        Exception: a bug in a backend, after the archive has been sealed as a fault.
    """
    ledger = Ledger(trials, display, finished, computed=isinstance(backend, KnowsCost))
    ended = EarlyEnd(kept=writer.folder)
    stages, policy = stages or no_stages(), policy or Policy()
    waiting = stages.in_order(trial for trial in trials if trial.number not in finished)
    supervision = replace(supervision, subscribers=(*supervision.subscribers, ledger.reached))
    sequence = TrialSequence(
        trials,
        waiting,
        backend,
        writer,
        workers,
        ledger,
        ended,
        stop,
        policy,
        attendance,
        stages,
        live=supervision.live,
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
        sequence.outside.look()  # it may have come after the last trial
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
    """How the run stands, and every reason there is for it."""
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
