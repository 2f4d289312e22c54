"""What the blind rigs rest on: draws that are bench files, and a bound that knows of clusters."""

from __future__ import annotations

from pathlib import Path

import pytest
from scipy.stats import binomtest

from benchmarks.blind_rigs import case_of, clustered
from benchmarks.drawn_rigs import drawn
from campaign.experiments import experiments
from campaign.experiments.friction_map.runs import VelocityMapOptions, plan_run


@pytest.mark.parametrize("number", range(0, 200, 20))
def test_a_draw_is_a_bench_and_no_other(tmp_path: Path, number: int) -> None:
    rig = drawn("test", number)
    case = case_of(rig, tmp_path)
    assert case.truth.axis.inertia == pytest.approx(case.stated.axis.inertia, rel=0.25)
    assert rig == drawn("test", number)
    assert rig != drawn("other", number)


def test_a_bound_by_rigs() -> None:
    """One number a rig: Clopper and Pearson; four that hold or miss together count as one."""
    exact = binomtest(90, 100).proportion_ci(0.95, method="exact").low
    assert clustered([(1, 1)] * 90 + [(0, 1)] * 10) == pytest.approx(exact, abs=0.002)
    assert clustered([(4, 4)] * 90 + [(0, 4)] * 10) == pytest.approx(exact, abs=0.005)


def test_the_slowest_run_has_the_time_that_it_needs(tmp_path: Path) -> None:
    """Of this rig it needs 44.1 s to settle, which two digits make 44 s."""
    bench = case_of(drawn("dev4", 30), tmp_path).stated
    fit = experiments()["velocity_map"].fit
    assert fit is not None
    chosen = {name: each.value for name, each in fit(VelocityMapOptions(), bench).items()}
    options = VelocityMapOptions().model_copy(update=chosen)
    assert plan_run(options.slowest, options).window > 0.0
