"""Later stages of a run: when they are asked, what becomes of the answer, and what goes wrong."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from campaign.archive.layout.followup_trials import trials_in
from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ExitCode
from campaign.execution.operator_prompts import AbsentOperator, Attendance
from campaign.execution.outcome import RunOutcome
from campaign.execution.progress import Progress
from campaign.execution.runner import run_plan
from campaign.execution.stages import Stages, refusal_of
from campaign.execution.stop import StopSwitch
from campaign.experiments.interface import Experiment, Stage, TestData
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.policy import Policy
from campaign.protocol.stages import PlannedStage
from campaign.recording import Ending, Fault, Outcome
from campaign.result import Result
from campaign.signals import Polyline
from campaign.trial import Most, Role, Task, Trial, TrialRequest
from tests.execution.fakes import FakeBackend, MemoryArchive
from tests.execution.test_batches import Together

ROOT = Path(__file__).parents[2]
BENCH = Bench.model_validate(
    tomllib.loads((ROOT / "protocols/benches/simulink.toml").read_text(encoding="utf-8"))
)
TREE = BENCH.model_dump(mode="json")
MOST = Most(3, 6.0, 60)
Asked = Callable[[TestData], Iterable[TrialRequest]]


class Nothing(Options):
    """No options."""


def request(step: float = 0.0, **more: object) -> TrialRequest:
    task = Task(mode="rate", duration=2.0, window=(0.0, 2.0), sample_rate=10.0)
    return TrialRequest(task.model_copy(update=more), point={"step": step})


def three(data: TestData) -> Iterator[TrialRequest]:
    return (request(float(k)) for k in range(3))


@dataclass
class Run:
    """A test whose two points, a and b, have two trials each, executed in the order a b a b."""

    asked: tuple[Asked, ...] = (three,)
    backend: FakeBackend = field(default_factory=FakeBackend)
    most: Most = MOST
    seen: list[tuple[str, list[int]]] = field(default_factory=list)
    archive: MemoryArchive = field(default_factory=MemoryArchive)
    stop: StopSwitch = field(default_factory=StopSwitch)
    progress: list[Progress] = field(default_factory=list)
    policy: Policy = field(default_factory=Policy)
    pauses: list[float] = field(default_factory=list)
    setups: dict[str, tuple[str, ...]] = field(default_factory=dict)
    places: str = "abab"
    bench: dict[str, Any] = field(default_factory=lambda: TREE)
    seeks_instability: bool = False

    def trials(self) -> list[Trial]:
        return [
            Trial(
                number=number, test="test", kind="kind", point={"place": place, "step": -1.0},
                seed=number, bench=self.bench, task=request().task,
                setup=self.setups.get(place, ()),
            )
            for number, place in enumerate(self.places, start=1)
        ]  # fmt: skip

    @property
    def experiment(self) -> Experiment:
        def stage(number: int, asked: Asked) -> Stage:
            def trials(options: object, bench: Bench, data: TestData) -> Iterable[TrialRequest]:
                place = str(data.trials[0].trial.point["place"])
                self.seen.append((place, [item.trial.number for item in data.trials]))
                assert all(len(item.recording().time) == 20 for item in data.completed())
                return asked(data)

            return Stage(f"more {number}", "why not", lambda options, bench: self.most, trials)

        stages = tuple(stage(number, asked) for number, asked in enumerate(self.asked, start=2))
        return Experiment(
            "kind", "", Nothing, lambda options, bench: (), lambda data: Result(),
            seeks_instability=self.seeks_instability, stages=stages,
        )  # fmt: skip

    def planned(self) -> list[PlannedStage]:
        return [
            PlannedStage("test", number, stage.name, stage.why, {"place": place}, 7, self.most)
            for place in "ab"
            for number, stage in enumerate(self.experiment.stages, start=2)
        ]

    def __call__(self, workers: int = 1, resumed: bool = False) -> RunOutcome:
        """`resumed`: with what an earlier session has left in the archive."""
        asked = tuple(self.archive.stages) if resumed else ()
        trials = [*self.trials(), *trials_in(asked)]
        settled = (Outcome.COMPLETED, Outcome.LIMIT)
        finished = {n: e.outcome for n, e in self.archive.endings.items() if e.outcome in settled}
        if resumed:
            self.archive.sealed = None
            self.stop = StopSwitch()
        stages = Stages(
            self.planned(), trials, self.archive, {"kind": self.experiment},
            refusal_of(self.backend), finished=finished, asked=asked,
        )  # fmt: skip
        waits = Attendance(AbsentOperator(), lambda seconds, stop: self.pauses.append(seconds))
        return run_plan(
            trials, self.backend, self.archive, workers=workers, display=self.progress.append,
            stop=self.stop, policy=self.policy, attendance=waits, finished=finished, stages=stages,
        )  # fmt: skip

    @property
    def executed(self) -> list[int]:
        return [int(line[6:]) for line in self.backend.log if line.startswith("trial-")]

    def numbers(self) -> dict[int, tuple[object, int]]:
        """Where each trial that followed stands, and its seed."""
        trials = self.archive.trials.values()
        return {t.number: ((t.point["place"], t.point["step"]), t.seed) for t in trials}


# When


def test_a_stage_is_asked_when_its_points_trials_have_ended_and_its_trials_come_next() -> None:
    run = Run()
    outcome = run()
    assert run.executed == [1, 2, 3, 5, 6, 7, 4, 8, 9, 10]
    assert run.seen == [("a", [1, 3]), ("b", [2, 4])]
    assert outcome.status is RunStatus.COMPLETE
    assert outcome.outcomes == {Outcome.COMPLETED: 10}
    assert [[t.number for t in stage.trials] for stage in run.archive.stages] == [
        [5, 6, 7], [8, 9, 10],
    ]  # fmt: skip


@pytest.mark.parametrize("workers", [2, 4])
def test_numbers_and_seeds_are_those_of_one_worker_whatever_ends_first(workers: int) -> None:
    alone, beside = Run(), Run(backend=Together(groups=lambda trial: trial.number % 2))
    alone()
    beside(workers)
    assert beside.numbers() == alone.numbers()
    assert len(alone.numbers()) == 10


def test_points_are_asked_in_the_order_in_which_their_trials_end() -> None:
    run = Run(places="bbaa")
    run()
    assert run.executed == [1, 2, 5, 6, 7, 3, 4, 8, 9, 10]


def test_a_further_stage_sees_what_the_one_before_it_has_found() -> None:
    run = Run(asked=(three, lambda data: [request(float(len(data.trials)))]))
    assert run().status is RunStatus.COMPLETE
    assert run.seen == [
        ("a", [1, 3]),
        ("a", [1, 3, 5, 6, 7]),
        ("b", [2, 4]),
        ("b", [2, 4, 9, 10, 11]),
    ]
    assert run.executed == [1, 2, 3, 5, 6, 7, 8, 4, 9, 10, 11, 12]
    assert run.archive.trials[8].point == {"place": "a", "step": 5.0}


def test_a_trial_that_is_tried_again_is_waited_for_and_a_failed_one_is_data() -> None:
    answers = iter([Ending(Outcome.FAULT, "x", fault=Fault.RESET), Ending(Outcome.LIMIT, "y")])
    run = Run(backend=FakeBackend({3: lambda stopped: next(answers)}))
    policy = {"faults": {"reset": {"do": "retry", "times": 1, "pause": 1.0, "then": "abort"}}}
    run.policy = Policy.model_validate(policy, context={"si": True})
    outcome = run()
    assert run.executed[:5] == [1, 2, 3, 3, 5]
    assert run.seen[0] == ("a", [1, 3])
    assert outcome.status is RunStatus.FAILED_TRIALS


def test_checks_belong_to_no_point() -> None:
    run = Run()
    plain = run.trials
    check = run.trials()[0].model_copy(update={"number": 5, "role": Role.CHECK})
    run.trials = lambda: [*plain(), check]  # type: ignore[method-assign]
    run()
    assert run.seen == [("a", [1, 3]), ("b", [2, 4])]
    assert run.executed == [1, 2, 3, 6, 7, 8, 4, 9, 10, 11, 5]


def test_rests_and_steps_by_hand_are_those_of_planned_trials() -> None:
    run = Run(setups={"a": ("Preload a",), "b": ("Preload b",)})
    run.policy = Policy.model_validate(
        {"rest": {"every": 8.0, "pause": 60.0}}, context={"si": True}
    )
    run()
    asked = [(trial, step) for trial, step, _ in run.archive.steps]
    assert asked == [(1, "Preload a"), (2, "Preload b"), (3, "Preload a"), (4, "Preload b")]
    assert run.pauses == [60.0, 60.0]


def test_progress_grows_with_what_follows() -> None:
    run = Run()
    run()
    assert [run.progress[0].total, run.progress[-1].total] == [4, 10]
    assert run.progress[-1].left == 0
    assert all(told.left >= 0 for told in run.progress)
    assert "test at place = a, stage 2 (more 2): 3 trials follow" in [
        p.remark for p in run.progress
    ]


# What goes wrong


def failing(data: TestData) -> Iterator[TrialRequest]:
    yield request()
    raise ZeroDivisionError("no slope")


def test_a_stage_that_raises_costs_itself_and_is_told_and_kept() -> None:
    run = Run(asked=(failing, three))
    outcome = run()
    assert outcome.status is RunStatus.FAILED_TRIALS
    assert outcome.exit_code is ExitCode.TRIALS_FAILED
    told = "test at place = a, stage 2 (more 2) failed: ZeroDivisionError: no slope"
    assert outcome.reason == f"{told}, and 1 more"
    assert told in [p.remark for p in run.progress]
    first = run.archive.stages[0]
    assert (first.reason, first.trials) == ("ZeroDivisionError: no slope", ())
    assert run.executed == [1, 2, 3, 5, 6, 7, 4, 8, 9, 10], "the stage after it is asked"


def test_a_stage_that_leaves_the_program_costs_itself() -> None:
    def leaves(data: TestData) -> Iterator[TrialRequest]:
        raise SystemExit(0)

    run = Run(asked=(leaves, three))
    assert run().status is RunStatus.FAILED_TRIALS
    assert run.archive.stages[0].reason == "SystemExit: 0"
    assert run.executed[-1] == 10, "the stage after it is asked"


def test_a_stage_without_end_is_left_as_soon_as_it_asks_for_too_much() -> None:
    taken: list[int] = []

    def endless(data: TestData) -> Iterator[TrialRequest]:
        for k in itertools.count():
            taken.append(k)
            yield request(float(k))

    run = Run(asked=(endless,))
    assert run().status is RunStatus.FAILED_TRIALS
    assert taken == [0, 1, 2, 3] * 2
    assert run.executed == [1, 2, 3, 4]
    assert run.archive.stages[0].reason == "it asks for more than the 3 trials it said at most"


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        (request(duration=6.1, window=(0.0, 6.1)), "its trials take 6.1 s, and it said 6 s"),
        (request(sample_rate=31.0), "its trials record 62 samples, and it said 60 at most"),
        ("no request", "AttributeError"),
    ],
)
def test_a_stage_that_takes_more_than_it_said_is_not_executed(request_, why: str) -> None:
    run = Run(asked=(lambda data: [request_],))
    assert run().status is RunStatus.FAILED_TRIALS
    assert run.executed == [1, 2, 3, 4]
    assert why in run.archive.stages[0].reason


FAST = Polyline(times=(0.0, 1.0), values=(0.0, 100.0))


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (request(9.0, command=FAST), "rate up to 5730 deg/s, limit 90 deg/s"),
        (request(9.0, compensation="magic"), "the bench has no compensation 'magic'; it has none"),
        (request(float("nan")), "not JSON compliant"),
        (TrialRequest(request().task, point={"place": "c"}), "it chooses place, which is swept"),
        (TrialRequest(request().task, bench={**TREE, "axis": {"inertia": -1.0}}), "inertia"),
        (TrialRequest(request().task, requires=("gyro_rate", "base_rate")), "requires base_rate"),
    ],
)
def test_a_trial_that_a_plan_would_not_have_is_refused_by_itself(bad: TrialRequest, why: str):
    run, whole = Run(asked=(lambda data: [request(0.0), bad, request(2.0)],)), Run()
    outcome, _ = run(), whole()
    assert run.executed == [1, 2, 3, 5, 6, 4, 7, 8]
    assert outcome.status is RunStatus.FAILED_TRIALS
    (refused,) = run.archive.stages[0].refused
    assert why in refused.why
    assert why in outcome.reason
    ours, theirs = dict(run.numbers().values()), dict(whole.numbers().values())
    assert ours.items() <= theirs.items(), "seeds do not depend on what was refused"


def test_an_unstable_loop_is_refused_unless_it_is_sought() -> None:
    gyro = {**TREE["sensors"]["gyro"], "delay": 0.1}
    controller = {**TREE["controller"], "sample_rate": 1000.0}
    bench = {**TREE, "sensors": {**TREE["sensors"], "gyro": gyro}, "controller": controller}
    run = Run(asked=(lambda data: [TrialRequest(request().task, bench=bench)],))
    run()
    assert "its loop is unstable" in run.archive.stages[0].refused[0].why
    assert run.executed == [1, 2, 3, 4]
    sought = Run(asked=run.asked, seeks_instability=True)
    sought()
    assert sought.executed == [1, 2, 3, 5, 4, 6]


def test_what_the_backend_cannot_execute_is_refused() -> None:
    class Choosy(FakeBackend):
        def refuses(self, trial: Trial) -> str | None:
            return "not today" if trial.point["step"] == 1.0 else None

    run = Run(backend=Choosy())
    run()
    assert [each.why for each in run.archive.stages[0].refused] == ["not today"]
    assert run.executed == [1, 2, 3, 5, 6, 4, 7, 8]


# Stopping and going on


def stops(run: Run) -> Callable[[Callable[[], bool]], Ending]:
    def behave(stopped: Callable[[], bool]) -> Ending:
        run.stop.request("somebody")
        return Ending(Outcome.COMPLETED)

    return behave


def equals_an_uninterrupted_one(run: Run) -> bool:
    whole = Run()
    whole()
    return run.numbers() == whole.numbers() and len(run.seen) == 2


@pytest.mark.parametrize("number", [2, 3, 4, 5, 7, 8, 10])
def test_a_run_stopped_after_any_trial_goes_on_as_if_nothing_had_been(number: int) -> None:
    run = Run()
    run.backend.behaviour[number] = stops(run)
    outcome = run()
    last = number == 10
    assert outcome.status is (RunStatus.COMPLETE if last else RunStatus.INTERRUPTED)
    assert len(run.archive.endings) < 10 or last
    run.backend.behaviour.clear()
    assert run(resumed=True).status is RunStatus.COMPLETE
    assert equals_an_uninterrupted_one(run)
    assert run.executed == [1, 2, 3, 5, 6, 7, 4, 8, 9, 10]


def test_nobody_is_asked_once_the_run_is_stopped() -> None:
    run = Run()
    run.backend.behaviour[3] = stops(run)
    run()
    assert (run.seen, run.archive.stages) == ([], [])


def test_a_run_stopped_while_a_stage_is_asked_has_its_answer_and_executes_none() -> None:
    run = Run()

    def slow(data: TestData) -> Iterator[TrialRequest]:
        run.stop.request("somebody")
        return three(data)

    run.asked = (slow,)
    assert run().status is RunStatus.INTERRUPTED
    assert run.executed == [1, 2, 3]
    assert [len(stage.trials) for stage in run.archive.stages] == [3]
    run.asked = (three,)
    run(resumed=True)
    assert equals_an_uninterrupted_one(run)


def test_what_the_journal_says_follows_whatever_would_be_asked_for_today() -> None:
    run = Run()
    run.backend.behaviour[5] = stops(run)
    run()
    run.asked = (failing,)
    run.backend.behaviour.clear()
    outcome = run(resumed=True)
    assert run.executed == [1, 2, 3, 5, 6, 7, 4]
    assert "at place = b, stage 2 (more 2) failed" in outcome.reason
    assert len(run.seen) == 2, "a is not asked again"


@pytest.mark.parametrize("number", [1, 2])
def test_nothing_follows_from_trials_of_which_some_were_executed_on_another_bench(
    number: int,
) -> None:
    """Trials 1 and 3 are of point a, 2 and 4 of point b."""
    run = Run()
    run.backend.behaviour[number] = stops(run)
    run()
    run.backend.behaviour.clear()
    run.bench = {**TREE, "axis": {**TREE["axis"], "inertia": 1.1 * TREE["axis"]["inertia"]}}
    outcome = run(resumed=True)
    told = "its trials were executed on different benches"
    changed = {1: ["a"], 2: ["a", "b"]}[number]
    assert [stage.reason for stage in run.archive.stages if stage.reason] == [told] * len(changed)
    assert [place for place, _ in run.seen] == [place for place in "ab" if place not in changed]
    assert outcome.status is RunStatus.FAILED_TRIALS
    assert told in outcome.reason


def test_a_failure_before_the_resume_is_not_forgotten() -> None:
    run = Run(asked=(failing,))
    run.backend.behaviour[4] = stops(run)
    run()
    outcome = run(resumed=True)
    assert outcome.status is RunStatus.FAILED_TRIALS
    assert "place = a, stage 2 (more 2) failed" in outcome.reason


def test_a_fault_that_ends_the_run_asks_nobody() -> None:
    fault = Ending(Outcome.FAULT, "x", fault=Fault.RESET)
    run = Run(backend=FakeBackend({3: lambda stopped: fault}))
    run.policy = Policy.model_validate({"faults": {"reset": {"do": "abort"}}}, context={"si": True})
    assert run().status is RunStatus.FAULT
    assert run.seen == []
    run.backend.behaviour.clear()
    run.policy = Policy()
    assert run(resumed=True).status is RunStatus.COMPLETE
    assert equals_an_uninterrupted_one(run)


def test_an_archive_that_cannot_be_written_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    from campaign.errors import ArchiveError

    def full(self: MemoryArchive, *entries: object) -> None:
        raise ArchiveError("no space")

    monkeypatch.setattr(MemoryArchive, "note", full)
    run = Run()
    with pytest.raises(ArchiveError, match="no space"):
        run()
    assert run.executed == [1, 2, 3]
    assert run.backend.log[-1] == "made safe"
