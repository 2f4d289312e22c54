"""Runs an experiment on the simulated bench as the program does, without protocol and archive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from campaign.backends.sim import SimBackend, SimOptions
from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import TestData
from campaign.physics.bench import Bench
from campaign.protocol.expand import fields_of
from campaign.reason import Cause
from campaign.recording import Ending, MemoryRecorder, Outcome, Recording
from campaign.result import Finding, Result, Table, bare
from campaign.trial import Role, Trial

Tree = dict[str, Any]
MADE_UP = Cause("made up", "somebody made it up")
"""For a test to which it does not matter why."""


@dataclass(frozen=True)
class Done:
    """A finished trial, in memory."""

    trial: Trial
    ending: Ending
    samples: Recording
    estimates: tuple[Estimate, ...] = ()
    not_kept: str = ""

    @property
    def is_completed_measurement(self) -> bool:
        return self.ending.outcome is Outcome.COMPLETED and self.trial.role is Role.MEASUREMENT

    def recording(self) -> Recording:
        return self.samples

    def channel_names(self) -> frozenset[str]:
        return frozenset(self.samples.channels)


def trials(kind: str, bench: Bench, options: Tree, matrix: Iterable[Tree] = ({},)) -> list[Trial]:
    experiment = experiments()[kind]
    found: list[Trial] = []
    for point in matrix:
        chosen = experiment.options.model_validate({**options, **point})
        for request in experiment.trials(chosen, bench):
            own = request.bench or bench.model_dump(mode="json")
            found.append(
                Trial(
                    number=len(found) + 1,
                    test=kind,
                    kind=kind,
                    point={**point, **request.point},
                    options=chosen.model_dump(mode="json"),
                    seed=len(found) + 1,
                    bench=own,
                    **fields_of(experiment, request, own, {}),
                )
            )
    return found


def execute(planned: Iterable[Trial]) -> tuple[Done, ...]:
    backend = SimBackend(SimOptions())
    done = []
    for trial in planned:
        recorder = MemoryRecorder()
        ending = backend.execute(trial, recorder, lambda: False)
        done.append(Done(trial, ending, recorder.recording(ending)))
    return tuple(done)


def analyse(kind: str, done: Iterable[Done]) -> Result:
    return result_of(experiments()[kind], TestData(kind, kind, {}, tuple(done)))


def failed(item: Done) -> Done:
    """The same trial, had a limit ended it."""
    return Done(item.trial, Ending(Outcome.LIMIT, "the rate limit"), item.samples)


def table(result: Result, key: str) -> Table:
    """A table of the result with bare values in its cells."""
    found = table_of_estimates(result, key)
    rows = tuple({name: bare(cell) for name, cell in row.items()} for row in found.rows)
    return replace(found, rows=rows)


def table_of_estimates(result: Result, key: str) -> Table:
    return next(table for table in result.tables if table.key == key)


def finding(result: Result, quantity: str, **conditions: object) -> Finding:
    """The one finding of a quantity under these conditions."""
    (found,) = [
        f
        for f in result.findings
        if f.quantity == quantity and conditions.items() <= f.conditions.items()
    ]
    return found
