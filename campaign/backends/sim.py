"""The `sim` backend: trials on the engine of `campaign.physics`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import repeat
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import Field

from campaign.backends.interface import BackendKind, Source, StopFlag, TrialCost
from campaign.backends.simulated_trial import CHANNELS, MEASURED, OUTPUTS, SimulatedTrial, announced
from campaign.backends.step_check import StepCheck
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.complete import PURPOSES, CompleteBench, IncompleteBenchError, complete
from campaign.physics.rows import BASE_RATE, DRIVE
from campaign.physics.truth import simulated
from campaign.physics.variation import is_drawn
from campaign.recording import Array, Ending, Recorder, SafeState
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Tree, Trial, tree_text
from campaign.units import Time

if TYPE_CHECKING:  # the import of the engine is slow
    from campaign.physics.lanes import Lane

__all__ = ["BACKEND", "CHANNELS", "SimBackend", "SimOptions", "announced"]

MOST_BENCHES = 64
"""Size of the cache of validated benches: most trials of a test share one."""
MOST_KNOWN = 200_000
"""Size of the cache of steps and structures of trials: more than a plan has."""


class SimOptions(Options):
    """Options of the simulated bench."""

    longest_step: Time | None = Field(default=None, gt=0, le=0.01)
    """Longest integration step; absent: 1 ms or 1/2^k of it, as the trial needs. Sample rates and
    the frequencies of sines shorten it."""
    check_step: bool = False
    """Simulate each trial again at half its step, and archive the difference."""


class _Known(NamedTuple):
    """Cached cost and group of a trial."""

    cost: TrialCost
    group: Hashable


class SimBackend:
    """Simulates every trial from rest, independently of earlier trials.

    The engine simulates trials of one structure in parallel lanes; their samples are bitwise equal
    to those of a single simulation.

    Attributes:
        has_blocks: whether lanes are used: False if their engine is not compiled and compiling it
            would take longer than single simulation.
    """

    fewest_together = 4
    """A block costs as much as four single trials, for any number of lanes."""

    def __init__(self, options: SimOptions) -> None:
        self._options = options
        self._benches: dict[str, CompleteBench] = {}
        self._truths: dict[str, Tree] = {}
        self._lanes: dict[Hashable, Lane] = {}
        self._simulated: dict[tuple[str, str], CompleteBench] = {}
        self._accepted: set[Hashable] = set()
        self._known: dict[str, _Known] = {}
        self._groups: dict[Hashable, Hashable] = {}
        self.timing: Timing = UNTIMED
        self.has_blocks = True

    def __reduce__(self) -> tuple[object, ...]:
        """Pickled for another process: its settings, without caches."""
        return _again, (self._options, self._truths, self.has_blocks)

    def __enter__(self) -> SimBackend:
        return self

    def __exit__(self, *exception: object) -> None:
        return None

    @property
    def most_together(self) -> int:
        """Number of lanes of a block."""
        from campaign.physics.vector import LANES

        return LANES if self.has_blocks else 1

    def simulate_instead(self, truths: Mapping[str, Tree]) -> None:
        """Add plants of truths, by the digest in `Trial.truth`."""
        self._truths.update(truths)

    def refuses(self, trial: Trial) -> str | None:
        """Why this backend cannot execute `trial`, or None.

        Of trials that differ only in their seed the first is checked. Draws of friction change the
        step by a few percent: only a trial near the finest step could be refused for that.
        """
        kind = trial.apart_from_seed
        if kind in self._accepted:
            return None
        if trial.truth and trial.truth not in self._truths:
            return f"its truth {trial.truth[:12]} is not here; it is archived with the run"
        try:
            bench, name = self._bench(trial), trial.task.compensation
        except IncompleteBenchError as error:
            return str(error)
        if name != "none" and name not in bench.compensation:
            return f"bench {bench.name!r} has no compensation {name!r}"
        try:
            self._look_at(trial)
        except (ArithmeticError, ValueError) as error:
            return str(error)
        if len(self._accepted) >= MOST_KNOWN:
            self._accepted.clear()
        self._accepted.add(kind)
        return None

    def channels(self, trial: Trial) -> frozenset[str]:
        """All simulated channels; with a separate truth only those that a rig can measure."""
        return _MEASURED if trial.truth else _NAMES

    def group(self, trial: Trial) -> Hashable:
        """Structure of a trial: models, inputs, sensors, sample rates and step."""
        return self._look_at(trial).group

    def cost(self, trial: Trial) -> TrialCost:
        """Integration step of a trial, and number of steps."""
        return self._look_at(trial).cost

    def steps_together(self, trials: Sequence[Trial]) -> int:
        """Total steps of the trials that would be executed together."""
        alike = self._by_group(trials)
        many = (each for each in alike if len(each) >= self.fewest_together)
        return sum(self.cost(trial).steps for each in many for trial in each)

    def make_ready(self, trials: Sequence[Trial]) -> None:
        """Compile the code of these trials besides the engine of a loop: friction models and the
        engine of a prescribed motion, for lanes or for single trials.
        """
        from campaign.physics.lanes import together
        from campaign.physics.machine_code import engine

        prescribed = {}
        for alike in self._by_group(trials):
            lane = self._lane(alike[0])
            width = self.most_together if len(alike) >= self.fewest_together else 1
            together([lane], width)
            if lane.prescribed:
                prescribed[width] = lane.stated
        for width, bench in prescribed.items():
            engine(width, bench, "prescribed").make()

    def _by_group(self, trials: Sequence[Trial]) -> Iterable[Sequence[Trial]]:
        alike: defaultdict[Hashable, list[Trial]] = defaultdict(list)
        for trial in trials:
            alike[self.group(trial)].append(trial)
        return alike.values()

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Simulate `trial`; end it at a limit, at a divergence, or if `stop()`."""
        ((_, ending),) = self.execute_together([trial], [recorder], [stop])
        return ending

    def execute_together(
        self, trials: Sequence[Trial], recorders: Sequence[Recorder], stops: Sequence[StopFlag]
    ) -> Iterator[tuple[int, Ending]]:
        """Execute trials of one structure in parallel lanes."""
        from campaign.physics.lanes import sampled
        from campaign.physics.simulate import samples_at_a_time, simulate_together

        lanes, tasks = [self._lane(trial) for trial in trials], [trial.task for trial in trials]
        halves: Iterable[tuple[Any, Sequence[Array | None]]] = repeat((None, [None] * len(lanes)))
        stretch = None
        if self._options.check_step:
            half = [
                self._lane(trial, lane.grid.step / 2.0)
                for trial, lane in zip(trials, lanes, strict=True)
            ]
            stretch = samples_at_a_time(half[0].grid, alone=len(half) == 1)
            halves = self.timing.each(Work.ENGINE, simulate_together(half, stretch))
        going = {
            place: self._begun(lane, recorder, stop, internal=not trial.truth)
            for place, (trial, lane, recorder, stop) in enumerate(
                zip(trials, lanes, recorders, stops, strict=True)
            )
        }
        whole = self.timing.each(Work.ENGINE, simulate_together(lanes, stretch))
        for (times, outs), (_, outs_of_half) in zip(whole, halves, strict=False):
            commands, base_rates = (sampled(tasks, which, times) for which in (DRIVE, BASE_RATE))
            for place, begun in tuple(going.items()):
                inputs = commands[place], base_rates[place]
                ending = begun.take(times, inputs, outs[place], outs_of_half[place])
                if ending is not None:
                    del going[place]
                    yield place, ending
            if not going:
                return

    def _begun(
        self, lane: Lane, recorder: Recorder, stop: StopFlag, *, internal: bool
    ) -> SimulatedTrial:
        check = StepCheck(lane.grid.step, OUTPUTS) if self._options.check_step else None
        samples = lane.grid.samples
        return SimulatedTrial(
            lane.stated, lane.task, samples, recorder, stop, check, internal=internal
        )

    def make_safe(self) -> SafeState:
        """Confirm: a simulation moves nothing."""
        return SafeState.CONFIRMED

    def _look_at(self, trial: Trial) -> _Known:
        known = self._known.get(trial.fingerprint)
        if known is None:
            lane = self._lane(trial)
            cost = TrialCost(lane.grid.step, lane.grid.samples * lane.grid.every, lane.grid.because)
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
                self._groups.clear()
            structure = lane.structure
            group = self._groups.setdefault(structure, structure)  # one shared object
            known = self._known[trial.fingerprint] = _Known(cost, group)
        return known

    def _lane(self, trial: Trial, longest_step: float | None = None) -> Lane:
        from campaign.physics.lanes import Lane

        longest_step = longest_step or self._options.longest_step
        with self.timing.span(Work.SETTING_UP):
            kind = trial.apart_from_seed, longest_step
            if (lane := self._lanes.get(kind)) is not None:
                return lane.with_seed(trial.seed)
            stated = self._bench(trial)
            bench = self._simulated_instead(trial, stated) if trial.truth else stated
            lane = Lane.of(bench, trial.task, trial.seed, longest_step, stated)
            if not is_drawn(bench):
                if len(self._lanes) >= MOST_BENCHES:
                    self._lanes.clear()
                self._lanes[kind] = lane
            return lane

    def _simulated_instead(self, trial: Trial, stated: CompleteBench) -> CompleteBench:
        """Bench with the plant of the truth and the software of the stated bench."""
        key = (tree_text(trial.bench), trial.truth)
        bench = self._simulated.get(key)
        if bench is None:
            bench = self._simulated[key] = simulated(self._truths[trial.truth], stated)
        return bench

    def _bench(self, trial: Trial) -> CompleteBench:
        text = tree_text(trial.bench)  # a worker process receives a copy of the tree each time
        bench = self._benches.get(text)
        if bench is None:
            valid = Bench.model_validate(trial.bench, context={"si": True})
            if len(self._benches) >= MOST_BENCHES:
                self._benches.clear()
                self._simulated.clear()
            bench = self._benches[text] = complete(valid, "the backend 'sim'")
        return bench


_NAMES = frozenset(channel.name for channel in CHANNELS)
_MEASURED = frozenset(channel.name for channel in MEASURED)


def _again(options: SimOptions, truths: Mapping[str, Tree], has_blocks: bool) -> SimBackend:
    backend = SimBackend(options)
    backend.simulate_instead(truths)
    backend.has_blocks = has_blocks
    return backend


BACKEND = BackendKind(
    name="sim",
    summary="simulation of the bench",
    options=SimOptions,
    open=SimBackend,
    source=Source.SIMULATION,
    several=True,
    picklable=True,
    simulates=True,
    needs=tuple(PURPOSES),
)
