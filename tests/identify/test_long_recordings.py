"""Long recordings: what is fitted of them, how far it is, and what is filtered once."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from campaign.estimation.inverse.motion import (
    FilterSettings,
    Motion,
    decimated,
    late_rows,
    later,
    motion_of_position,
    motion_of_rate,
)
from campaign.estimation.inverse.rows import rows
from campaign.estimation.inverse.terms import TERMS
from campaign.experiments.any_motion.motions import MotionPiece, with_slowest
from campaign.experiments.whole_model import parts
from campaign.experiments.whole_model.parts import telling_parts
from campaign.experiments.whole_model.residuals import Residuals, models, steps_between
from campaign.experiments.whole_model.whole_model_fit import find
from campaign.identify import experiments_by_model
from campaign.identify.identification import identify
from campaign.identify.material import choose
from campaign.physics.friction.unknowns import Sizes
from tests.estimation.rigs import random_rigs


@pytest.mark.parametrize("decimation", [1, 10])
def test_a_delay_and_a_low_pass_may_be_exchanged(decimation: int) -> None:
    force = np.cumsum(np.random.default_rng(1).standard_normal(4000))
    filtering = FilterSettings(100.0, decimation, skip=7)
    kept = late_rows(force, 1000.0, filtering)
    inner = slice(40, -40)
    for delay in (0.0, 0.0031, -0.0047):
        old = decimated(later(force, delay, 1000.0)[7:, None], decimation)[:, 0]
        assert kept(delay)[inner] == pytest.approx(old[inner], abs=2e-4 * np.std(force))


def test_a_column_is_filtered_once_for_each_motion() -> None:
    time = np.arange(2000) / 1000.0
    motion = motion_of_rate(time, np.sin(7.0 * time), time, 100.0)
    seen = []

    def column(of: Motion) -> np.ndarray:
        seen.append(of)
        return of.rate

    term = replace(TERMS["viscous"], column=column)
    filtering = FilterSettings(100.0, 10)
    first = rows(motion, [term], filtering)
    again = rows(motion, [term], replace(filtering, slowest=0.1), delay=1e-3)
    assert seen == [motion]
    other = replace(motion, rate=2.0 * motion.rate)
    twice = rows(other, [term], filtering)
    assert seen == [motion, other]
    assert twice.columns == pytest.approx(2.0 * first.columns)
    assert len(again.columns) == len(first.columns)
    assert len(rows(motion, [term], filtering.half_band).columns) == len(first.columns) // 2


@pytest.mark.parametrize(
    ("decimation", "every"), [(1, 1), (10, 1), (20, 2), (25, 1), (50, 5), (100, 10)]
)
def test_rows_have_ten_simulated_steps_or_more(decimation: int, every: int) -> None:
    assert steps_between(FilterSettings(100.0, decimation)) == every


@pytest.mark.parametrize("skip", [0, 33])
def test_rows_are_the_same_with_fewer_simulated_steps(skip: int) -> None:
    """At 5 kHz five samples are a step, and rows remain where they are."""
    time = np.arange(15_003) / 5000.0
    motion = motion_of_position(time, -np.cos(6.0 * time) / 6.0, time, 100.0)
    model = models(Sizes((2.0, 2.4), (0.5, 0.6), 1.0, 0.4))[1]
    names = ["inertia", *(each.name for each in model.unknowns), "delay"]
    values = (0.2, *(each.start for each in model.unknowns), 0.0)
    filtering = FilterSettings(100.0, 50, skip)
    fine, coarse = (
        Residuals(names, model, (), [motion], filtering, every).modelled(values)[0]
        for every in (1, 5)
    )
    assert len(fine) == len(coarse)
    # Reversals are found within a step of either.
    assert coarse[5:-5] == pytest.approx(fine[5:-5], abs=0.02 * float(np.ptp(fine)))


def sliding(seconds: float, slow: tuple[float, float]) -> MotionPiece:
    """Sines at 100 Hz, and hardly any motion from `slow[0]` to `slow[1]` (s)."""
    time = np.arange(round(100 * seconds)) / 100.0
    size = np.where((time >= slow[0]) & (time < slow[1]), 0.02, 1.0)
    motion = motion_of_rate(time, size * np.sin(0.7 * time) + size * np.sin(2.9 * time), time, 20.0)
    return MotionPiece(1, motion, motion)


def test_of_a_long_motion_the_parts_that_slide_slowly_are_among_those_fitted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(parts, "MOST_STEPS", 3000)
    long = sliding(300.0, (103.0, 112.0))
    filtering = replace(with_slowest(FilterSettings(20.0), [long], None), slowest=1e-3)
    found = telling_parts([long], filtering)
    begins = [float(each.motion.time[0]) for each in found]
    assert begins == sorted(set(begins))
    assert 2000 <= sum(len(each.motion.time) for each in found) <= 3000
    assert {105.0, 100.0, 110.0} & set(begins)
    for each in found:
        assert each.wanted is not None
        assert np.array_equal(each.wanted.time, each.motion.time)
    short = sliding(20.0, (3.0, 5.0))
    assert telling_parts([short], filtering) == [short]
    behind = telling_parts([long], replace(filtering, skip=700))
    assert min(float(each.motion.time[0]) for each in behind) >= 7.0
    assert all(len(each.motion.time) > 450 for each in behind), "nothing more is skipped of a part"


@pytest.mark.slow
def test_every_model_and_every_fit_of_it_is_told_as_it_begins() -> None:
    rig = random_rigs(1, seed=4, seconds=3.0)[0]
    filtering = FilterSettings(20.0, 10)
    motion = motion_of_position(rig.time, rig.angle, rig.force, filtering.low_pass)
    pieces = [MotionPiece(1, motion, None)]
    said: list[str] = []
    found = find(pieces, [], with_slowest(filtering, pieces, None), starts=2, say=said.append)
    names = [each.model.name for each in found.fits]
    held = ("start 1 of 2", "start 2 of 2", "half the band", "another exponent", "blocks left out")
    free = ("start 1 of 1", "half the band", "blocks left out")
    assert [text for text, _ in groupby(said)] == [
        f"model {number} of 4 ({name}), {each}"
        for number, name in enumerate(names, 1)
        for each in (free if "free" in name else held)
    ]


@pytest.mark.slow
def test_methods_are_counted(results: Path) -> None:
    run = next(results.glob("*-rig-mapping.nxs")).stem
    said: list[str] = []
    names = ("friction_map", "inverse_dynamics")
    compared = choose(results, f"{run}:tuesday")
    chosen = choose(results, f"{run}:monday")
    identify(chosen, experiments_by_model(), models=names, compared=compared, say=said.append)

    heads = [text.split(": ")[0] for text in said]
    assert list(dict.fromkeys(heads)) == [
        f"method 1 of 2, friction_map, {run}:monday",  # and nowhere does it slide steadily
        f"method 2 of 2, inverse_dynamics, {run}:monday",
        f"method 2 of 2, inverse_dynamics, {run}:tuesday",
    ]
    steps = [text.rpartition(": ")[2] for text in said if "step" in text]
    begins = [f"step {number} of 4" for number in range(1, 5)]
    assert [text.split(",")[0] for text in steps] == 2 * begins
