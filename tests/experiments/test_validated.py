"""Benches and options of trials as objects: one for equal ones, and never a former one."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from pydantic import ValidationError

from campaign.experiments import experiments
from campaign.experiments.interface import bench_of, options_of, validated
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.resources import protocols_folder
from campaign.trial import Task, Trial
from tests.coverage.benches import make_case

SHIPPED = sorted(path.stem for path in (protocols_folder() / "benches").glob("*.toml"))


def trial_on(bench: Bench) -> Trial:
    task = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=10.0)
    tree = bench.model_dump(mode="json")
    return Trial(number=1, test="x", kind="x", seed=1, bench=tree, task=task)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_bench_is_what_its_tree_says(name: str) -> None:
    bench = load_bench(name)
    trial = trial_on(bench)
    found = bench_of(trial)
    assert found == Bench.model_validate(trial.bench, context={"si": True})
    assert found.model_dump(mode="json") == trial.bench
    assert bench_of(trial_on(bench)) is found


def test_random_benches_are_what_their_trees_say() -> None:
    for number in range(1, 10):
        for bench in (make_case(number).truth, make_case(number).stated):
            assert bench_of(trial_on(bench)) == bench


def test_a_tree_that_was_changed_is_another_bench() -> None:
    """It is looked up by content, as it is now."""
    trial = trial_on(load_bench("simulink"))
    before = bench_of(trial).axis.inertia
    trial.bench["axis"]["inertia"] = 2.0 * before  # type: ignore[index,call-overload]
    assert bench_of(trial).axis.inertia == 2.0 * before
    trial.bench["axis"]["inertia"] = -1.0  # type: ignore[index,call-overload]
    for _ in range(2):  # what is wrong stays wrong
        with pytest.raises(ValidationError, match="inertia"):
            bench_of(trial)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_what_is_not_finite_is_refused(bad: float) -> None:
    trial = trial_on(load_bench("simulink"))
    trial.bench["axis"]["inertia"] = bad  # type: ignore[index,call-overload]
    with pytest.raises(ValidationError, match="inertia"):
        bench_of(trial)


def test_equal_trees_of_two_kinds_are_two_objects() -> None:
    one, other = experiments()["step_response"], experiments()["velocity_map"]
    assert type(options_of(one, {})) is one.options
    assert type(options_of(other, {})) is other.options
    assert options_of(one, {}) is options_of(one, {})


def test_many_threads_may_ask() -> None:
    trees = [make_case(number).stated.model_dump(mode="json") for number in range(1, 5)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda k: validated(Bench, trees[k % 4]), range(200)))
    for k, bench in enumerate(found):
        assert bench.model_dump(mode="json") == trees[k % 4]
