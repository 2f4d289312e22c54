"""The supervising recorder between a backend and the archive.

The first sample that violates a condition of the trial is archived as evidence; later samples are
not. The recorder sets the trial's stop flag, so that the backend ends the trial, and decides the
outcome independently of the backend. An existing recording cannot be stopped: there the recorder
only reports violations.
"""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import numpy as np
from pydantic import JsonValue

from campaign.backends.interface import Source
from campaign.channels import missing
from campaign.errors import ArchiveError
from campaign.execution.sample_checks import (
    STEP,
    ArchivedChannels,
    Verdict,
    announced,
    make_watch,
    mentions_gaps,
    shaped,
    undefined,
    wrong_time,
)
from campaign.execution.sample_latency import Pace
from campaign.execution.supervision import Subscriber, Supervision, TrialStop
from campaign.execution.writer import TrialWriter
from campaign.physics.limit_watch import LimitWatch
from campaign.plain_text import storable, storable_tree
from campaign.recording import Array, ChannelInfo, Ending, Event, Fault, Outcome, lost_samples
from campaign.trial import Trial

ARCHIVE_PATIENCE = 10.0
"""s that the archive may take for a block after the end of the trial."""
_OWN = (Outcome.LIMIT, Outcome.DIVERGED, Outcome.FAULT)


class SupervisingRecorder:
    """Recorder of one trial, used by the backend.

    Attributes:
        verdict: why the trial must end; None without a violation.
        heard: time of the last samples (supervision's clock); None before the first.
        unwatched: limits of the bench that no recorded channel shows.
    """

    def __init__(
        self,
        trial: Trial,
        file: TrialWriter,
        stop: TrialStop,
        supervision: Supervision,
    ) -> None:
        self.verdict: Verdict | None = None
        self.heard: float | None = None
        self.unwatched: tuple[str, ...] = ()
        self._trial = trial
        self._file = file
        self._stop = stop
        self._supervision = supervision
        self._ends_trials = supervision.source is not Source.RECORDING
        self._subscribers: list[Subscriber] = list(supervision.subscribers)
        self._announced = ArchivedChannels()
        self._channels: tuple[ChannelInfo, ...] | None = None
        self._watch: LimitWatch | None = None
        self._samples = 0
        self._lost = 0
        self._said: dict[str, Verdict] = {}
        self._events: list[Event] = []
        self._pace = Pace()
        self._more = False  # samples came after the verdict
        self._closed = False
        # Separate lock for the verdict: a watchdog sets it while the file may be blocked by a disk.
        self._judging = threading.Lock()
        self._writing = threading.Lock()

    # Called by the backend

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        with self._writing:
            if self._closed:
                return
            if self._channels is not None:
                self._give(self._new("channels", "the channels were announced a second time"))
                return
            try:
                self._announced = announced(self._trial, tuple(channels))
            except (ValueError, TypeError) as error:
                self._give(self._new("channels", str(error)))
                return
            self._channels = self._announced.channels
            names = [info.name for info in self._channels]
            self._watch, self.unwatched = make_watch(self._trial, names)
            self._file.start(self._channels)
            for text in self._announced.converted:
                self._file.event(Event(0.0, text))
            if lacking := missing(self._trial.requires, names):
                reason = (
                    f"{', '.join(lacking)}: not recorded, but {self._trial.kind} needs it; "
                    f"announced are {', '.join(names)}"
                )
                self._find(self._new("channels", reason))

    def append(self, time: Array, block: Array) -> None:
        # None means lost samples here.
        self._hand_over(time, np.asarray(None) if block is None else block)

    def lost(self, time: Array) -> None:
        """Record samples that the backend reports as lost: NaN and an event, no `undefined`."""
        self._hand_over(time, None)

    def event(self, event: Event) -> None:
        with self._writing:
            if not self._closed:
                self._note(event)

    # Called by the runner

    def silent(self, seconds: float) -> None:
        """End the trial after `seconds` without samples, independently of the backend."""
        what = "no samples came" if self.heard is None else "no samples came any more"
        if self._writing.locked():
            what = "the archive took no samples"
        reason = f"{what} for {seconds:.3g} s, and the trial had not ended"
        self._give(self._new("silence", reason, Fault.LOST_CONNECTION))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the channels for the operator."""
        limits = ", ".join(self.unwatched)
        unwatched = (f"no channel shows these limits: {limits}",) if limits else ()
        return (*unwatched, *self._announced.converted)

    @property
    def is_complete(self) -> bool:
        """Whether all samples of the trial are recorded."""
        task = self._trial.task
        return self._samples >= task.duration * task.sample_rate - 1

    def conclude(self, ending: Ending, *, forced: bool = False) -> Ending:
        """The final ending, from the backend's; nothing is recorded afterwards.

        `forced`: the trial ended only because `make_safe` was called during it. Raises ArchiveError
        if the archive does not return from writing a block.
        """
        if not self._writing.acquire(timeout=ARCHIVE_PATIENCE):
            raise ArchiveError(
                f"{self._trial.name}: the archive takes no samples; is its disk still there?"
            )
        try:
            if not self._closed:
                ending = self._concluded(ending, forced)
                self._closed = True
        finally:
            self._writing.release()
        return ending

    # Judging

    def _hand_over(self, time: Array, block: Array | None) -> None:
        self.heard = self._supervision.clock()
        with self._writing:
            if self.verdict is not None or self._closed:
                self._more = self._more or not self._closed
                return
            if self._channels is None:
                reason = "samples came before the channels were announced"
                self._give(self._new("channels", reason))
                return
            try:
                time, samples = shaped(time, block, len(self._channels))
            except ValueError as error:
                self._give(self._new("shape", str(error)))
                return
            if not len(time):
                return
            if self._announced.converted:
                samples = samples * self._announced.factors
            self._pace.handed_over(self.heard, float(time[0]), float(time[-1]))
            good = self._judge(time, samples, was_lost=block is None)
            time, samples = time[:good], samples[:, :good]
            if block is None and good:
                self._note(lost_samples(self._samples, time))
                self._lost += good
            self._file.append(time, samples)
            self._samples += good
            self._publish(time, samples)
        self.heard = self._supervision.clock()  # the disk's time is not the bench's

    def _note(self, event: Event) -> None:
        at = float(event.time)
        event = Event(at if math.isfinite(at) else 0.0, storable(event.text))
        self._events.append(event)
        self._file.event(event)

    def _judge(self, time: Array, block: Array, *, was_lost: bool) -> int:
        """Check a block; the number of samples to archive: all, or up to the first violation."""
        problems: list[tuple[int, Verdict]] = []
        if (wrong := wrong_time(self._trial.task, self._samples, time)) is not None:
            problems.append(wrong)
        if was_lost:
            if self._watch is not None:
                self._watch.skip(len(time))
        else:
            names = [info.name for info in self._channels or ()]
            if (bad := undefined(names, time, block)) is not None:
                problems.append(bad)
            if self._watch is not None and "limit" not in self._said:
                good = min((index for index, _ in problems), default=len(time))
                end = good if self._ends_trials else len(time)
                violation = self._watch.look(time[:end], block[:, :end])
                if violation is not None:
                    at = float(time[violation.index])
                    verdict = Verdict("limit", Outcome.LIMIT, violation.text, at)
                    problems.append((violation.index, verdict))
        if not problems:
            return len(time)
        if not self._ends_trials:
            for _, verdict in problems:
                self._find(verdict)
            return len(time)
        index, verdict = min(problems, key=lambda each: each[0])
        self._give(verdict)
        return index + 1 if np.isfinite(time[index]) else index

    # Verdicts

    def _new(self, kind: str, reason: str, fault: Fault = Fault.RECORDING) -> Verdict:
        """Verdict at the present end of the recording."""
        at = self._samples / self._trial.task.sample_rate
        return Verdict(kind, Outcome.FAULT, reason, at, fault)

    def _find(self, verdict: Verdict) -> None:
        """End the trial, or report on a recording: it violates a condition of the trial."""
        if self._ends_trials:
            self._give(verdict)
        else:
            self._said.setdefault(verdict.kind, verdict)

    def _give(self, verdict: Verdict) -> None:
        """End the trial, or a recording whose data cannot be archived."""
        with self._judging:
            if self.verdict is None and not self._closed:
                self.verdict = verdict
        self._stop.trip()

    def _publish(self, time: Array, block: Array) -> None:
        for subscriber in tuple(self._subscribers):
            try:
                subscriber(self._trial, self._channels or (), time, block)
            except Exception:  # noqa: BLE001 - a subscriber must not harm the trial
                self._subscribers.remove(subscriber)

    # The end

    def _concluded(self, ending: Ending, forced: bool) -> Ending:
        telemetry = storable_tree(dict(ending.telemetry))
        ending = replace(ending, reason=storable(ending.reason))
        if self.verdict is None and ending.outcome is Outcome.COMPLETED:
            self._judge_whole()
        ending = self._with_verdict(ending, forced)
        judged = {} if self._ends_trials else self._judged(ending)
        if self._supervision.live and self._samples:
            telemetry |= self._timeliness()
        if self.unwatched and self._samples:
            telemetry["unwatched_limits"] = list(self.unwatched)
        if judged:
            telemetry["judged"] = judged
        return replace(ending, telemetry=telemetry)

    def _judge_whole(self) -> None:
        """Check a trial that the backend reports as completed."""
        task = self._trial.task
        if self._lost and self._ends_trials:
            reason = f"{self._lost} samples were lost and are marked"
            self._give(self._new("lost", reason, Fault.LOST_SAMPLES))
        elif self._channels is None:
            self._find(self._new("channels", "completed, but nothing was recorded"))
        elif task.stop_rate is None and not self.is_complete:
            wanted = task.duration * task.sample_rate
            reason = (
                f"completed, but with {self._samples} samples instead of {wanted:.0f}: nothing "
                f"after {self._samples / task.sample_rate:.6g} s of {task.duration:.6g} s"
            )
            self._find(self._new("length", reason))

    def _with_verdict(self, ending: Ending, forced: bool) -> Ending:
        """Apply the verdict, unless the backend ended the trial by itself at that sample."""
        verdict = self.verdict
        if verdict is None or (ending.outcome in _OWN and not self._more and not forced):
            return ending
        reason = verdict.reason
        if ending.outcome is not Outcome.INTERRUPTED and ending.reason != reason:
            backend = f"{ending.outcome}, {ending.reason}" if ending.reason else str(ending.outcome)
            reason += f" (the backend: {backend})"
        self._file.event(Event(verdict.time, verdict.reason))
        return replace(ending, outcome=verdict.outcome, reason=reason, fault=verdict.fault)

    def _judged(self, ending: Ending) -> dict[str, JsonValue]:
        """Violations of an existing recording that it does not report itself, by kind."""
        texts = [ending.reason, *(event.text for event in self._events)]
        known = {"undefined"} if mentions_gaps(ending, texts) else set[str]()
        if ending.outcome is not Outcome.COMPLETED:  # its last sample is the evidence of that
            known |= {kind for kind, each in self._said.items() if self._is_last(each)}
        judged: dict[str, JsonValue] = {}
        for kind, verdict in self._said.items():
            if kind in known or verdict.reason in texts:
                continue
            judged[kind] = verdict.reason
            self._file.event(Event(verdict.time, verdict.reason))
        return judged

    def _is_last(self, verdict: Verdict) -> bool:
        return verdict.time * self._trial.task.sample_rate > self._samples - 1 - STEP

    def _timeliness(self) -> dict[str, JsonValue]:
        pace = self._pace
        telemetry: dict[str, JsonValue] = {"longest_gap_s": round(pace.longest, 4)}
        if pace.is_of_the_wall_clock:
            telemetry["oldest_sample_s"] = round(pace.oldest, 4)
            if pace.longest > self._supervision.patience.late:
                text = f"{LATE} {pace.longest:.2g} s after those before"
                self._file.event(Event(pace.at, text))
        return telemetry


LATE = "samples were handed over"
"""First words of the event for late samples."""
