"""Runs of the simulated platform with and without a true change: false alarms, and power."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from scipy import stats

from campaign.estimation.family import RATE
from campaign.references.verdict import Verdict
from tests.comparison.laboratory import PLATFORM, Run, compared, simulated

TOGETHER = 5
"""Runs whose samples are kept in memory at once."""
CHANGES = tuple(
    f'{test}.bench.friction.load.{path}="{value} N m"'
    for test in ("map", "errors", "ramps")
    for path, value in (("coulomb_torque", 17.732), ("negative.coulomb_torque", 18.711))
)
"""Coulomb friction of the load 10 % higher: 6.4 % of all of the axis in the positive direction."""
MOVED = (
    ("coulomb_torque", "positive"),
    ("coulomb_torque", "negative"),
    ("coulomb_torque", "nominal"),
)
UNMOVED = ("static_torque", "viscous_friction", "stribeck_velocity", "stribeck_exponent")
"""What the change leaves alone."""


SAMPLE: dict[tuple[int, tuple[str, ...]], Run] = {}
"""Runs of the samples, which the tests share, by seed and changes."""


def runs(folder: Path, seeds: range, changes: tuple[str, ...] = ()) -> Iterator[Run]:
    if len(seeds) <= 4:
        for seed in seeds:
            if (seed, changes) not in SAMPLE:
                (SAMPLE[seed, changes],) = simulated(folder, PLATFORM, [seed], changes)
            yield SAMPLE[seed, changes]
        return
    for first in range(0, len(seeds), TOGETHER):
        yield from simulated(folder, PLATFORM, seeds[first : first + TOGETHER], changes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "seed"),
    [
        pytest.param(4, 40_000, id="sample"),
        pytest.param(160, 50_000, id="all", marks=pytest.mark.statistics),
    ],
)
def test_of_comparisons_without_a_change_one_in_twenty_declares_anything(
    tmp_path: Path, count: int, seed: int
):
    """Each run takes part once, so that comparisons are independent."""
    made = list(runs(tmp_path, range(seed, seed + count)))
    alarms = 0
    for one, other in zip(made[::2], made[1::2], strict=True):
        pairs = compared(one, other)
        assert sum(pair.testable for pair in pairs) >= 20
        alarms += any(pair.verdict is Verdict.DIFFERENT for pair in pairs)
    assert stats.binomtest(alarms, count // 2, RATE, alternative="greater").pvalue > 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "seed"),
    [
        pytest.param(1, 40_000, id="sample"),
        pytest.param(4, 41_000, id="some", marks=pytest.mark.statistics),
        pytest.param(60, 60_000, id="all", marks=pytest.mark.statistics),
    ],
)
def test_ten_percent_more_coulomb_friction_is_found(tmp_path: Path, count: int, seed: int):
    before = list(runs(tmp_path, range(seed, seed + count)))
    after = list(runs(tmp_path, range(seed + count, seed + 2 * count), CHANGES))
    found, false, held = [], [], []
    for one, other in zip(before, after, strict=True):
        declared = [p for p in compared(one, other) if p.verdict is Verdict.DIFFERENT]
        told = {(pair.quantity, pair.conditions.get("direction")) for pair in declared}
        found.append(sum(each in told for each in MOVED) / len(MOVED))
        wrong = [p for p in declared if p.test.name == "map" and p.quantity in UNMOVED]
        false.append(len(wrong) / max(len(declared), 1))
        for pair in declared:
            if (pair.quantity, pair.conditions.get("direction")) == MOVED[0]:
                low, high = pair.found.difference.combined
                held.append(low < 1.612 < high)
    assert sum(found) / count >= 0.9
    # A share has a scatter of at most 0.5: three of its standard errors are spared.
    assert sum(false) / count <= RATE + 3 * 0.1 / count**0.5
    assert stats.binomtest(sum(held), len(held), 0.95, alternative="less").pvalue > 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "seed"),
    [
        pytest.param(1, 40_000, id="sample"),
        pytest.param(4, 42_000, id="some", marks=pytest.mark.statistics),
        pytest.param(30, 80_000, id="all", marks=pytest.mark.statistics),
    ],
)
def test_draws_in_common_make_no_difference_up(tmp_path: Path, count: int, seed: int):
    """Runs with the same seeds are judged as independent ones: their intervals are too wide."""
    noise = tuple(
        f'{test}.bench.sensors.gyro.noise="0.003 deg/s"' for test in ("map", "errors", "ramps")
    )
    seeds = range(seed, seed + count)
    before, after = list(runs(tmp_path, seeds)), list(runs(tmp_path, seeds, noise))
    shares = []
    for one, other in zip(before, after, strict=True):
        tested = [pair for pair in compared(one, other) if pair.testable]
        assert len(tested) >= 20
        assert any(pair.found.difference.value != 0 for pair in tested)
        assert not [pair for pair in tested if pair.verdict is Verdict.DIFFERENT]
        shares += [pair.found.p < 0.05 for pair in tested]  # type: ignore[operator]
    assert sum(shares) <= 0.02 * len(shares)
