"""What shifts two runs alike: constants of one bench, as both know it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from campaign.api.analysis import AnalysedTest
from campaign.axis_kind import BOTH_ROTARY, AxisKind, Sides
from campaign.comparison.shared_systematics import shared_sources, source_called
from campaign.experiments.interface import TestData
from campaign.physics.bench import Bench
from campaign.physics.truth import plant_of
from campaign.result import Result
from tests.comparison.laboratory import analysed
from tests.comparison.test_judging import made_up

BOTH = {"torque constant", "inertia"}


def on(bench: Bench, **more: object) -> AnalysedTest:
    data = TestData("t", "k", {}, ())
    return analysed(data, Result(), **{"bench": bench, **more})


def test_one_bench_has_one_torque_constant_and_one_inertia(platform: Bench):
    assert shared_sources(on(platform), on(platform), {}, {}) == BOTH
    hardware = on(platform, source="hardware")
    assert shared_sources(hardware, hardware, {}, {}) == BOTH


@pytest.mark.parametrize(
    ("name", "source"),
    [("force constant", "torque constant"), ("torque constant", "torque constant"),
     ("mass", "inertia"), ("motor", None)],
)  # fmt: skip
def test_a_source_goes_by_its_code_and_by_what_a_page_calls_it(name: str, source: str | None):
    linear = Sides(AxisKind.LINEAR, AxisKind.LINEAR)
    assert source_called(name, sorted(BOTH), linear) == source
    assert source_called("force constant", sorted(BOTH), BOTH_ROTARY) is None


@pytest.mark.parametrize(
    ("change", "left"),
    [
        (lambda b: b.model_copy(update={"name": "another"}), set()),
        (lambda b: _with(b, "motor", "torque_constant", 0.09), {"inertia"}),
        (lambda b: _with(b, "axis", "inertia", 60.0), {"torque constant"}),
        (lambda b: _with(b, "known", "values", {}), {"torque constant"}),
    ],
)
def test_what_is_not_said_to_be_the_same_is_not_shared(
    platform: Bench, change: Callable[[Bench], Bench], left: set[str]
):
    assert shared_sources(on(platform), on(change(platform)), {}, {}) == left


def _with(bench: Bench, part: str, name: str, value: object) -> Bench:
    changed = getattr(bench, part).model_copy(update={name: value})
    return bench.model_copy(update={part: changed})


@pytest.mark.parametrize(
    "sources", [("simulation", "hardware"), ("", ""), ("recording", "hardware")]
)
def test_a_simulation_has_not_the_errors_of_the_hardware(platform: Bench, sources: tuple[str, str]):
    one, other = (on(platform, source=source) for source in sources)
    assert shared_sources(one, other, {}, {}) == set()


def test_nobody_knows_a_bench_that_is_not_there(platform: Bench):
    assert shared_sources(on(platform), replace(on(platform), bench=None), {}, {}) == set()


def test_of_simulated_truths_the_true_values_count(platform: Bench):
    plants = {
        "a" * 64: plant_of(platform),
        "b" * 64: plant_of(_with(platform, "motor", "torque_constant", 0.08)),
    }

    def true(digest: str) -> AnalysedTest:
        found = made_up([], [{"position": 0.0}], platform)
        trial = found.trials[0].trial.model_copy(update={"truth": digest})
        executed = replace(found.trials[0], trial=trial)
        return analysed(TestData("t", "k", {}, (executed,)), Result())

    one, other = true("a" * 64), true("b" * 64)
    assert shared_sources(one, one, plants, plants) == BOTH
    assert shared_sources(one, other, plants, plants) == {"inertia"}
    assert shared_sources(one, on(platform), plants, {}) == set()
