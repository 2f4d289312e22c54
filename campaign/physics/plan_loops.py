"""The loops of a plan, each computed once."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, IncompleteBenchError, complete, lacking
from campaign.physics.linear_friction import (
    REGIMES,
    NoLoopError,
    Regime,
    bench_friction,
    compensation_friction,
)
from campaign.physics.loop import make_compensator
from campaign.physics.loop_margins import LoopMargins, margins_of
from campaign.physics.open_loop import Mode, open_loop
from campaign.physics.variation import of_its_day
from campaign.trial import Task


@dataclass(frozen=True)
class LoopUse:
    """A loop and the trial that closes it.

    Attributes:
        trial: number of the first trial with the least margin.
        mode: `rate`, or `torque` if compensation alone closes a loop.
    """

    trial: int
    compensation: str
    mode: Mode
    regime: Regime
    margins: LoopMargins


def loops_used(items: Iterable[tuple[int, Task, Bench]]) -> tuple[LoopUse, ...]:
    """Worst loop of each compensation, mode and regime in the trials; worst first.

    `items`: number, task and bench of each trial. It omits regimes without a linear loop, trials
    without a motor, and incomplete benches.
    """
    by_bench: dict[Hashable, tuple[Bench, tuple[LoopUse, ...]]] = {}
    by_values: dict[Hashable, tuple[LoopUse, ...]] = {}
    worst: dict[Hashable, LoopUse] = {}
    for number, task, bench in items:
        if task.mode not in ("rate", "torque"):
            continue
        place = (id(bench), task.compensation, task.mode)
        if place not in by_bench:
            # Keeps the bench, because an id is unique only while its object exists.
            uses = _known(by_values, number, bench, task.compensation, task.mode)
            by_bench[place] = bench, uses
            for use in uses:
                kind = (use.compensation, use.mode, use.regime)
                if kind not in worst or _rank(use) < _rank(worst[kind]):
                    worst[kind] = use
    return tuple(sorted(worst.values(), key=_rank))


def loops_of(
    bench: Bench, compensation: str, mode: Mode
) -> Iterator[tuple[Regime, LoopMargins | NoLoopError]]:
    """Each regime with its LoopMargins, or with a NoLoopError that states the reason."""
    for regime in REGIMES:
        try:
            whole = complete(bench, "a loop's margin")
            with np.errstate(all="ignore"):
                margins = margins_of(open_loop(whole, compensation, mode, regime))
            yield regime, margins
        except NoLoopError as error:
            yield regime, error
        except IncompleteBenchError as error:
            yield regime, NoLoopError(str(error))
        except (ValueError, ArithmeticError):  # a matrix with infinite values has no poles
            yield regime, NoLoopError("its numbers are beyond computing")


def _rank(use: LoopUse) -> tuple[float, int]:
    return use.margins.tightness, use.trial


def _known(
    known: dict[Hashable, tuple[LoopUse, ...]],
    number: int,
    bench: Bench,
    compensation: str,
    mode: Mode,
) -> tuple[LoopUse, ...]:
    if lacking(bench):
        return ()
    bench = complete(bench)
    key = _values(bench, compensation, mode)
    if key not in known:
        known[key] = tuple(
            LoopUse(number, compensation, mode, regime, loop)
            for regime, loop in loops_of(bench, compensation, mode)
            if isinstance(loop, LoopMargins)
        )
    return known[key]


def _values(bench: CompleteBench, compensation: str, mode: Mode) -> Hashable:
    """All values that the loops depend on, without those that affect only the size of a motion."""
    bench = of_its_day(bench)
    compensator = make_compensator(bench, compensation)
    block = compensator.linear
    friction: list[Hashable] = []
    for regime in REGIMES:
        try:
            friction.append(bench_friction(bench, regime))
            friction.append(compensation_friction(bench, compensator, regime))
        except NoLoopError:
            friction.append(None)
    return (
        compensation,
        mode,
        bench.axis.inertia,
        bench.appendage,
        bench.motor,
        bench.gear.ratio,
        bench.controller,
        tuple(sensor.delay for sensor in bench.sensors.in_order),
        tuple(friction),
        None if block is None else tuple(x.tobytes() for x in (block.a, block.b, block.c, block.d)),
    )
