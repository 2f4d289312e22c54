"""Trials that are executed together: which, how each of them ends, and what becomes of the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ArchiveError, BackendError, ExitCode
from campaign.execution.batches import LOOK_AHEAD, Batches
from campaign.recording import Ending, Outcome, Recorder, SafeState
from campaign.trial import Trial
from tests.execution.fakes import COMPLETED, RATE, FakeBackend, Lab, MemoryArchive, make_trials

PIECE = 5
"""samples between two turns of a trial."""
Turn = Callable[[int, Recorder, Callable[[], bool]], Ending | None]
"""What a trial does at one of its turns: goes on (None), ends, or raises."""


@dataclass
class Together(FakeBackend):
    """Executes up to four trials of one group in turns; `turns[number]` is what a trial does."""

    groups: Callable[[Trial], Hashable] = lambda trial: 0
    turns: dict[int, Turn] = field(default_factory=dict)
    fewest_together: int = 2
    most_together: int = 4
    batches: list[list[int]] = field(default_factory=list)

    def group(self, trial: Trial) -> Hashable:
        return self.groups(trial)

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        ((_, ending),) = self.execute_together([trial], [recorder], [stopped])
        return ending

    def execute_together(
        self,
        trials: Sequence[Trial],
        recorders: Sequence[Recorder],
        stops: Sequence[Callable[[], bool]],
    ) -> Iterator[tuple[int, Ending]]:
        self.batches.append([trial.number for trial in trials])
        for recorder in recorders:
            recorder.start((RATE,))
        going = dict(enumerate(trials))
        turn = 0
        while going:
            for place, trial in tuple(going.items()):
                first = turn * PIECE
                at = np.arange(first, first + PIECE) / trial.task.sample_rate
                if at[0] >= trial.task.duration - 1e-9:
                    ending: Ending | None = COMPLETED
                else:
                    recorders[place].append(at, np.ones((1, PIECE)))
                    act = self.turns.get(trial.number)
                    ending = act(turn, recorders[place], stops[place]) if act else None
                    if ending is None and stops[place]():
                        ending = Ending(Outcome.INTERRUPTED, "stopped by the operator")
                if ending is not None:
                    self.log.append(f"{trial.name} ended")
                    del going[place]
                    yield place, ending
            turn += 1


def by_parity(trial: Trial) -> int:
    return trial.number % 2


def end_at(turn: int, ending: Ending) -> Turn:
    return lambda now, recorder, stop: ending if now == turn else None


def raise_at(turn: int, error: Exception) -> Turn:
    def act(now: int, recorder: Recorder, stop: Callable[[], bool]) -> None:
        if now == turn:
            raise error

    return act


def waits_for_stop(turn: int, recorder: Recorder, stop: Callable[[], bool]) -> Ending | None:
    """From its third turn on until it is stopped; a run that does not stop it fails the test."""
    deadline = time.monotonic() + 60.0
    while turn > 1 and not stop():
        assert time.monotonic() < deadline, "nobody stopped it"
        time.sleep(0.001)
    return None


# Which


def test_trials_of_a_group_go_together_and_all_are_archived_whole() -> None:
    lab = Lab(make_trials(7), Together(groups=by_parity))
    outcome = lab.run()
    assert lab.backend.batches == [[1, 3, 5, 7], [2, 4, 6]]
    assert outcome.status is RunStatus.COMPLETE
    assert outcome.outcomes == {Outcome.COMPLETED: 7}
    assert lab.archive.samples == dict.fromkeys(range(1, 8), 20)


def test_a_backend_that_cannot_is_given_one_trial_at_a_time() -> None:
    lab = Lab(make_trials(3), FakeBackend())
    lab.run()
    assert lab.backend.log == ["trial-00001", "trial-00002", "trial-00003", "made safe"]


def test_so_few_that_it_is_not_worth_it_go_alone() -> None:
    lab = Lab(make_trials(5), Together(groups=by_parity, fewest_together=3))
    lab.run()
    assert lab.backend.batches == [[1, 3, 5], [2], [4]]


@pytest.mark.parametrize(
    ("workers", "sizes"), [(1, [4, 4]), (2, [4, 2, 1, 1]), (3, [3, 2, 1, 1, 1]), (8, [1] * 8)]
)
def test_every_worker_gets_a_share(workers: int, sizes: list[int]) -> None:
    """Of what is left; where a share is so small that a batch is not worth it, they go alone."""
    batches = Batches(make_trials(8), Together(), workers)
    taken = []
    while batches.first is not None:
        taken.append(len(batches.take(np.inf, lambda trial: False)))
    assert taken == sizes


def test_companions_are_looked_for_only_so_far_ahead() -> None:
    far = LOOK_AHEAD + 2
    batches = Batches(make_trials(far), Together(groups=lambda t: t.number in (1, far)), 1)
    assert [trial.number for trial in batches.take(np.inf, lambda trial: False)] == [1]


def test_no_trial_comes_before_hands_that_prepare_another() -> None:
    trials = make_trials(6)
    trials[3] = trials[3].model_copy(update={"setup": ("turn the bench round",)})
    lab = Lab(trials, Together())
    lab.run()
    assert lab.backend.batches == [[1, 2, 3], [4, 5, 6]]
    assert lab.archive.steps == [(4, "turn the bench round", "simulated")]


def test_a_batch_ends_where_the_bench_has_to_rest() -> None:
    """Trials of 2 s, a rest after each 5 s: due after the third, in batches or not."""
    lab = Lab(make_trials(8), Together(), rest={"every": 6.0, "pause": 1.0})
    lab.run()
    assert lab.backend.batches == [[1, 2, 3], [4, 5, 6], [7, 8]]
    assert len(lab.pauses) == 2


# How each ends


def test_one_that_ends_is_archived_and_counted_while_the_others_go_on() -> None:
    seen: list[int] = []

    def looks(turn: int, recorder: Recorder, stop: Callable[[], bool]) -> None:
        seen.append(len(lab.archive.endings))

    short = make_trials(3)
    short[0] = make_trials(1, duration=0.5)[0]
    lab = Lab(short, Together(turns={3: looks}))
    lab.run()
    assert seen == [0, 1, 1, 1]
    assert lab.archive.samples == {1: 5, 2: 20, 3: 20}
    assert lab.backend.log[0] == "trial-00001 ended"


def test_a_verdict_ends_its_own_trial_and_no_other() -> None:
    def breaks(turn: int, recorder: Recorder, stop: Callable[[], bool]) -> None:
        if turn == 1:
            recorder.append(np.arange(10, 15) / 10, np.full((1, 5), np.nan))
            assert stop()

    lab = Lab(make_trials(3), Together(turns={2: breaks}))
    outcome = lab.run()
    assert outcome.outcomes == {Outcome.COMPLETED: 2, Outcome.DIVERGED: 1}
    assert lab.archive.samples == {1: 20, 2: 11, 3: 20}
    assert "gyro_rate is nan" in lab.archive.endings[2].reason


def test_a_stop_interrupts_them_all() -> None:
    def asks(turn: int, recorder: Recorder, stop: Callable[[], bool]) -> None:
        if turn == 1:
            lab.stop.request("the test")

    lab = Lab(make_trials(6), Together(turns={1: asks}))
    outcome = lab.run()
    assert outcome.status is RunStatus.INTERRUPTED
    assert outcome.outcomes == {Outcome.INTERRUPTED: 4}
    assert set(lab.archive.samples) == {1, 2, 3, 4}
    assert max(lab.archive.samples.values()) <= 15


def test_a_failure_that_aborts_the_run_stops_its_companions_at_once() -> None:
    fails = end_at(1, Ending(Outcome.LIMIT, "too fast"))
    lab = Lab(
        make_trials(6),
        Together(turns={1: fails, 2: waits_for_stop}),
        faults={"default": {"do": "abort"}},
    )
    outcome = lab.run()
    assert outcome.status is RunStatus.FAULT
    assert lab.archive.endings[1].outcome is Outcome.LIMIT
    assert lab.archive.endings[2].outcome is Outcome.INTERRUPTED
    assert set(lab.archive.endings) == {1, 2, 3, 4}


def test_one_that_is_tried_again_is_the_next() -> None:
    times = iter([Ending(Outcome.LIMIT, "too fast"), None, None, None, None])
    lab = Lab(
        make_trials(6),
        Together(turns={2: lambda turn, recorder, stop: next(times)}),
        faults={"default": {"do": "retry"}},
    )
    lab.run()
    assert lab.backend.batches == [[1, 2, 3, 4], [2, 5, 6]]
    assert [number for number, _ in lab.archive.attempts].count(2) == 2
    assert lab.archive.endings[2].outcome is Outcome.COMPLETED


def test_a_backend_that_cannot_go_on_has_ended_what_it_ended() -> None:
    lab = Lab(
        make_trials(4),
        Together(turns={1: end_at(0, COMPLETED), 3: raise_at(2, BackendError("no more"))}),
    )
    lab.trials[0] = make_trials(1, duration=0.5)[0]
    outcome = lab.run()
    assert outcome.status is RunStatus.FAULT
    assert lab.archive.endings[1].outcome is Outcome.COMPLETED
    for number in (2, 3, 4):
        ending = lab.archive.endings[number]
        assert (ending.outcome, ending.reason) == (Outcome.FAULT, "no more")
        assert ending.safe_state is SafeState.NOT_CONFIRMED


class OwnTogether(Together):
    """As one of the program's own: what it raises is a bug."""

    __module__ = "campaign.backends.own"


def test_a_bug_in_a_backend_costs_no_archive_and_is_not_swallowed() -> None:
    lab = Lab(make_trials(3), OwnTogether(turns={2: raise_at(1, ZeroDivisionError("oh"))}))
    with pytest.raises(ZeroDivisionError):
        lab.run()
    assert lab.archive.sealed is not None
    assert {ending.reason for ending in lab.archive.endings.values()} == {
        "internal error: ZeroDivisionError: oh"
    }


def test_a_backend_that_tells_of_no_ending_has_none() -> None:
    class Silent(Together):
        def execute_together(self, *args: object) -> Iterator[tuple[int, Ending]]:
            yield from ()

    lab = Lab(make_trials(3), Silent())
    outcome = lab.run()
    assert outcome.status is RunStatus.FAULT
    assert outcome.exit_code is ExitCode.LIMIT_OR_FAULT
    assert "did not say how it ended" in lab.archive.endings[3].reason


def telling(*endings: tuple[int, Ending]) -> Iterator[tuple[int, Ending]]:
    yield from endings
    if not endings:
        raise OverflowError("oh")


@pytest.mark.parametrize(
    ("told", "error"),
    [
        (((1, COMPLETED), (1, COMPLETED)), LookupError),
        (((17, COMPLETED),), LookupError),
        ((), OverflowError),
    ],
)
def test_no_bug_of_a_backend_costs_the_archive(
    told: tuple[tuple[int, Ending], ...], error: type[Exception]
) -> None:
    class Wrong(Together):
        __module__ = OwnTogether.__module__

        def execute_together(self, *what: object) -> Iterator[tuple[int, Ending]]:
            return telling(*told)

    lab = Lab(make_trials(3), Wrong())
    with pytest.raises(error):
        lab.run()
    assert lab.archive.sealed is not None
    faults = [each for each in lab.archive.endings.values() if each.outcome is Outcome.FAULT]
    assert (len(lab.archive.endings), len(faults)) == (3, 3)  # one for want of samples


def test_a_trial_that_the_backend_cannot_place_goes_alone() -> None:
    def groups(trial: Trial) -> int:
        if trial.number == 2:
            raise OverflowError("oh")
        return 0

    lab = Lab(make_trials(4), Together(groups=groups))
    assert lab.run().status is RunStatus.COMPLETE
    assert lab.backend.batches == [[1, 3, 4], [2]]


def test_what_moves_is_watched_alone() -> None:
    batches = Batches(make_trials(4), Together(), 1, live=True)
    assert len(batches.take(np.inf, lambda trial: False)) == 1


def test_workers_share_the_bench_time_until_a_rest() -> None:
    """Trials of 2 s, a rest after each 8 s: due after four, however many workers there are."""
    lab = Lab(make_trials(8), Together(), rest={"every": 8.0, "pause": 1.0})
    begun: list[list[int]] = []
    lab.pause = lambda seconds: begun.append(sorted(chain(*lab.backend.batches)))
    lab.run(workers=2)
    assert begun == [[1, 2, 3, 4]]


def test_an_archive_that_fails_in_one_of_them_ends_the_run() -> None:
    class Full(MemoryArchive):
        def begin(self, trial: Trial, keeping: object = None):
            file = super().begin(trial)
            if trial.number == 2:

                def refuse(at: np.ndarray, block: np.ndarray) -> None:
                    raise ArchiveError("disk full")

                file.append = refuse  # type: ignore[method-assign]
            return file

    lab = Lab(make_trials(4), Together())
    lab.archive = Full()
    with pytest.raises(ArchiveError, match="disk full"):
        lab.run()
    assert lab.archive.sealed is None


def test_progress_tells_of_each() -> None:
    lab = Lab(make_trials(4), Together())
    lab.run()
    assert max(len(progress.running) for progress in lab.progress) == 4
    ended = [progress.ended[0].number for progress in lab.progress if progress.ended]
    assert sorted(ended) == [1, 2, 3, 4]
    assert lab.progress[-1].done == 4


def test_channels_are_each_ones_own() -> None:
    """A trial whose backend announces nothing it needs is ended; its companions are not."""
    trials = make_trials(3)
    trials[1] = trials[1].model_copy(update={"requires": ("motor_current",)})
    lab = Lab(trials, Together())
    lab.run()
    assert [lab.archive.endings[number].outcome for number in (1, 2, 3)] == [
        Outcome.COMPLETED,
        Outcome.FAULT,
        Outcome.COMPLETED,
    ]
