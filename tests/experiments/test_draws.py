"""A test that sweeps the seed of its bench's scatter: each draw by itself, and all side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import Experiment, TestData, TrialData
from campaign.options import Options
from campaign.published.draws import SEED
from campaign.recording import Ending, Outcome, Recording, SafeState
from campaign.result import Column, Finding, Result, Table
from campaign.trial import Task, Trial

DONE = Ending(Outcome.COMPLETED, "", SafeState.CONFIRMED)
TASK = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=10.0)


@dataclass(frozen=True)
class Made:
    """A trial with a number that it is said to have measured."""

    trial: Trial
    value: float
    estimates: Sequence[Estimate] = ()
    ending: Ending = DONE
    not_kept: str = ""

    def recording(self) -> Recording:
        raise AssertionError("nobody needs samples")

    def channel_names(self) -> frozenset[str]:
        return frozenset()


def trials(seeds: Sequence[int]) -> Iterator[Made]:
    """Two readings of each draw: the seed itself, and one more."""
    for number, (seed, reading) in enumerate([(s, r) for s in seeds for r in (0, 1)], start=1):
        trial = Trial(
            number=number,
            test="t",
            kind="k",
            seed=number,
            bench={},
            task=TASK,
            point={SEED: seed, "reading": reading},
        )
        found = Estimate("reading", float(seed + reading), "N m")
        yield Made(trial, float(seed + reading), (found,))


def mean(data: TestData) -> Result:
    """As an experiment that knows nothing of seeds: mean of all it is given, and a table of it."""
    values = [each.value for item in data.trials for each in item.estimates]
    paths = sorted({path for item in data.trials for path in item.trial.point})
    found = Finding("torque", float(np.mean(values)), "N m", {"statistic": "mean"})
    table = Table("means", "Means", (Column("paths", "Paths"),), ({"paths": ", ".join(paths)},))
    return Result((table,), (), (found,), (f"{len(values)} readings.", f"From {values[0]:g}."))


def result(seeds: Sequence[int]) -> Result:
    made: tuple[TrialData, ...] = tuple(trials(seeds))
    kind = Experiment("k", "", Options, lambda _options, _bench: (), mean)
    return result_of(kind, TestData("t", "k", {}, made))


def test_each_draw_is_analysed_by_itself() -> None:
    found = result([44, 1, 2])
    told = [(each.value, each.conditions) for each in found.findings]
    assert told == [
        (44.5, {"statistic": "mean", SEED: 44}),
        (1.5, {"statistic": "mean", SEED: 1}),
        (2.5, {"statistic": "mean", SEED: 2}),
    ]
    (key,) = found.key_numbers
    assert (key.value, key.conditions) == (2.5, {"statistic": "mean"}), "their median"


def test_the_page_has_the_first_draw_and_how_all_lie() -> None:
    found = result([44, 1, 2])
    draws, means = found.tables
    assert means.rows == ({"paths": "reading"},), "the experiment does not see the seed"
    (row,) = draws.rows
    assert (row["quantity"], row["conditions"], row["draws"]) == ("torque", "statistic mean", 3)
    spread = row["spread"]
    assert isinstance(spread, Estimate)
    assert spread.value == 2.5
    assert found.notes == (
        "3 draws of the bench's scatter; tables and figures are of seed 44.",
        "2 readings.",
        "From 44.",
        "From 1.",
        "From 2.",
    )


def test_notes_of_many_draws_are_not_all_repeated() -> None:
    notes = result(list(range(1, 40))).notes
    assert notes[-1] == "26 more notes are of other draws."
    assert len(notes) == 3 + 12 + 1


@pytest.mark.parametrize("seeds", [[44], []])
def test_one_seed_is_no_distribution(seeds: list[int]) -> None:
    if not seeds:
        made = tuple(replace(item, trial=item.trial.model_copy(update={"point": {}}))
                     for item in trials([44]))  # fmt: skip
        kind = Experiment("k", "", Options, lambda _options, _bench: (), mean)
        found = result_of(kind, TestData("t", "k", {}, made))
    else:
        found = result(seeds)
    assert [each.conditions for each in found.findings] == [{"statistic": "mean"}]
    assert [table.key for table in found.tables] == ["means"]


def test_a_draw_whose_analysis_fails_costs_itself_only() -> None:
    """Tables are of a draw that has some."""

    def fails_first(data: TestData) -> Result:
        if data.trials[0].estimates[0].value == 5.0:
            raise ValueError("a direction has too few speeds")
        return mean(data)

    experiment = Experiment("k", "", Options, lambda options, bench: (), fails_first)
    result = result_of(experiment, TestData("t", "k", {}, tuple(trials([5, 7, 9]))))
    assert {finding.conditions[SEED] for finding in result.findings} == {7, 9}
    (key,) = result.key_numbers
    assert not key.known.is_determined, "it is a draw all the same"
    assert [table.key for table in result.tables] == ["draws", "means"]
    assert any("seed 5 could not be analysed" in note for note in result.notes)
    assert any("tables and figures are of seed 7" in note for note in result.notes)
