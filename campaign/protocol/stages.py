"""Stages of a plan: trials that depend on earlier results.

A plan's own trials are the first stage of every test. Stages that an experiment declares
(`Experiment.stages`) are planned by point of the matrix: maximum number, duration and samples of
their trials. `stage_trials.follow` makes the trials when there is data.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from pydantic import JsonValue

from campaign.protocol.points import Point
from campaign.protocol.schema import Test
from campaign.trial import NONE_MORE, Most, canonical_json

FIRST = 2
"""Number of the stage that follows first; the planned trials are stage 1."""


@dataclass(frozen=True)
class PlannedStage:
    """A stage of one test at one point of its matrix.

    Attributes:
        number: from `FIRST`: its place among the experiment's stages.
        name, why: as declared by the experiment.
        point: swept path to value (SI).
        seed: of the test; the seeds of the trials depend on it.
        most: upper bounds for its trials.
    """

    test: str
    number: int
    name: str
    why: str
    point: Mapping[str, JsonValue]
    seed: int
    most: Most

    @property
    def place(self) -> str:
        """The test and the point, as a key for groups."""
        return place_of(self.test, self.point)


def place_of(test: str, point: Mapping[str, JsonValue]) -> str:
    """A test's point as one text."""
    return canonical_json([test, dict(point)])


def planned_stages(test: Test, point: Point, seed: int) -> Iterator[PlannedStage]:
    """The stages that the options of a point request. Raises the errors of the experiment."""
    for number, stage in enumerate(test.experiment.stages, start=FIRST):
        most = stage.most(point.options, point.bench)
        if most.trials <= 0:
            continue
        if not math.isfinite(most.duration):
            raise ValueError(f"the stage '{stage.name}' has no bound of its duration")
        values = dict(point.values)
        yield PlannedStage(test.entry.name, number, stage.name, stage.why, values, seed, most)


def most_of(stages: Iterable[PlannedStage]) -> Most:
    """The sum of their upper bounds."""
    return sum((stage.most for stage in stages), NONE_MORE)
