"""Small motions below breakaway: what is commanded, and what is found of benches that are known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from campaign.axis_kind import axis_terms
from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment
from campaign.experiments.presliding_multisine.experiment import EXPERIMENT
from campaign.experiments.shared.multisine import first_slip, odd_multisine
from campaign.protocol.bench_file import load_bench
from campaign.result import Result
from tests.experiments.laboratory import analyse, execute, trials
from tests.physics.benches import bench

KIND = "presliding_multisine"
SMALL = {"lowest": "1 Hz", "highest": "40 Hz", "periods": 4}
AT_REST = 18_000.0 + 141.176 * 1000.0
"""Stiffness of load and motor side, N m/rad, from the thesis' appendix."""
DAMPING = 800.0 + 4.0 + 141.176 * (0.5 + 0.001)
"""sigma1 and sigma2 of both, N m s/rad."""


@cache
def found(*amplitudes: str) -> Result:
    return analyse(KIND, execute(trials(KIND, bench(), {**SMALL, "amplitudes": amplitudes})))


def joint(result: Result) -> dict[str, Any]:
    (row,) = (row for row in result.tables[0].rows if row["amplitude"] == "all")
    return dict(row)


# What is commanded -------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_a_multisine_has_odd_lines_its_peak_and_begins_and_ends_at_nothing(seed: int) -> None:
    signal = odd_multisine(1.5, 0.4, 20.0, (seed,))
    assert signal.frequencies == pytest.approx([0.4 * k for k in range(1, 51, 2)])
    time = np.linspace(0.0, 2.5, 50_001)
    values = signal.sample(time)
    assert np.max(np.abs(values)) == pytest.approx(1.5, rel=5e-3)
    assert np.abs(values[[0, -1]]) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert len(set(signal.amplitudes)) == 1


def test_phases_follow_from_the_seed_and_differ_from_trial_to_trial() -> None:
    def phases(seed: int) -> list[tuple[float, ...]]:
        options = {**SMALL, "realisations": 2, "seed": seed}
        return [trial.task.command.phases for trial in trials(KIND, bench(), options)]  # type: ignore[union-attr]

    once = phases(3)
    assert once == phases(3)
    assert len(set(once)) == len(once) == 6
    assert not set(once) & set(phases(4))


def test_lines_that_the_recording_cannot_show_are_refused() -> None:
    with pytest.raises(ValueError, match="sample_rate"):
        trials(KIND, bench(), {**SMALL, "sample_rate": "300 Hz"})
    with pytest.raises(ValueError, match="lines"):
        odd_multisine(1.0, 0.001, 50.0, (1,))
    with pytest.raises(ValueError, match="positive"):
        trials(KIND, bench(), {**SMALL, "amplitudes": ["-1 N m"]})


def test_sizes_follow_from_where_the_bench_gives_way() -> None:
    # The motor side slips first, at 0.04 N m over 1000 N m/rad, and the load is bent with it.
    slip = 0.04 / 1000.0 * AT_REST
    assert first_slip(bench()) == pytest.approx((slip, AT_REST))
    experiment: Experiment = experiments()[KIND]
    assert experiment.fit is not None
    told = experiment.fit(experiment.options(), bench())
    assert told["amplitudes"].value == pytest.approx((0.05 * slip, 0.1 * slip, 0.2 * slip), rel=0.1)
    natural = math.sqrt(AT_REST / 35.0) / (2.0 * math.pi)
    assert told["lowest"].value < 0.1 * natural
    assert 4.0 * natural < told["highest"].value < 6.0 * natural
    written = experiment.options.model_validate({"amplitudes": ["1 N m"]})
    assert "amplitudes" not in experiment.fit(written, bench())


def test_amplitudes_at_which_an_interface_slips_are_warned_of() -> None:
    assert EXPERIMENT.warnings is not None
    large = EXPERIMENT.options.model_validate({"amplitudes": ["1 N m", "5 N m"]})
    assert any("slips at about 6.37 N·m" in each for each in EXPERIMENT.warnings(large, bench()))
    small = EXPERIMENT.options.model_validate({"amplitudes": ["1 N m", "2 N m"]})
    assert not list(EXPERIMENT.warnings(small, bench()))
    one = EXPERIMENT.options.model_validate({"amplitudes": ["1 N m"]})
    assert any("two amplitudes" in each for each in EXPERIMENT.warnings(one, bench()))


# What is found -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_stiffness_damping_and_inertia_are_found_as_the_sums_that_they_are() -> None:
    result = found("0.3 N m", "0.6 N m")
    values = joint(result)
    assert values["stiffness_at_rest"].value == pytest.approx(AT_REST, rel=1e-3)
    assert values["damping_at_rest"].value == pytest.approx(DAMPING, rel=2e-3)
    assert values["inertia"].value == pytest.approx(35.0, rel=1e-3)
    told = {finding.quantity: finding for finding in result.findings}
    assert set(told) == {"stiffness_at_rest", "damping_at_rest", "inertia"}
    assert all(finding.known.has_interval for finding in told.values())


@pytest.mark.slow
def test_an_interface_that_slips_is_no_number() -> None:
    result = found("3 N m", "9 N m")
    told: list[Estimate] = [finding.known for finding in result.findings]
    assert told
    assert not any(each.has_interval for each in told)
    assert all(each.reason for each in told)


def test_the_assumed_damping_stands_beside_the_measured_one() -> None:
    (figure,) = (each for each in found("0.3 N m", "0.6 N m").figures if each.key == "damping")
    (mark,) = figure.panels[0].marks
    assert mark.y == pytest.approx(1.6 * math.sqrt(AT_REST * 35.0), rel=2e-3)


AXIS = load_bench("linear")
LEAD = 2.0 * math.pi / 0.01  # rad/m
TRUTHS = {
    "stiffness_at_rest": 2e6 + 5.0 * LEAD**2,
    "damping_at_rest": 3150.0 + 0.01 * LEAD**2,
    "inertia": 27.9,
}


def short_runs(seed: int, amplitudes: Sequence[str] = ("1.2 N", "2.5 N", "5 N")) -> Result:
    """Noise of the axis' current is as large as the torque, and its loop holds the command."""
    sizes = {"amplitudes": [*amplitudes], "lowest": "2.4 Hz", "highest": "120 Hz"}
    with axis_terms(AXIS.sides):
        return analyse(KIND, execute(trials(KIND, AXIS, {**sizes, "periods": 4, "seed": seed})))


def held(row: Mapping[str, Any]) -> int:
    """How many intervals hold the truth."""
    intervals = {name: row[name].combined for name in TRUTHS}
    return sum(low <= TRUTHS[name] <= high for name, (low, high) in intervals.items())


def assert_narrow(result: Result) -> None:
    for name, truth in TRUTHS.items():
        assert joint(result)[name].half_width < 0.08 * truth, name


# Of 12 intervals of 95 %, 9 or fewer would be a chance of 1 in 50.


@pytest.mark.slow
def test_short_runs_of_a_noisy_linear_axis_hold_their_intervals() -> None:
    """Of each amplitude, and of all; intervals of half the width hold 8."""
    result = short_runs(3)
    assert_narrow(result)
    rows = result.tables[0].rows
    assert len(rows) == 4
    assert sum(map(held, rows)) > 9


@pytest.mark.slow
def test_back_emf_of_bristles_that_yield_makes_nothing_softer() -> None:
    """At two thirds of the force at which it slips: 2 % without the motion in the torque."""
    row = joint(short_runs(2, ("4 N", "8 N", "16 N")))
    assert row["stiffness_at_rest"].half_width < 0.016 * TRUTHS["stiffness_at_rest"]
    assert held(row) == 3


@pytest.mark.statistics
def test_intervals_of_all_amplitudes_hold_in_several_short_runs() -> None:
    several = [short_runs(seed) for seed in range(1, 5)]
    for result in several:
        assert_narrow(result)
    assert sum(held(joint(result)) for result in several) > 9
