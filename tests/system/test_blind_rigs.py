"""What the blind rigs rest on: draws that are bench files, and a bound that knows of clusters."""

from __future__ import annotations

from pathlib import Path

import pytest
from scipy.stats import binomtest

from benchmarks.blind_rigs import case_of, clustered
from benchmarks.drawn_rigs import drawn


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
