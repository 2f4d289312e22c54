"""The limits in C: a trial ends at the same sample, by the same limit, as on the host."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from campaign.physics.bench import LimitsOptions
from campaign.physics.limit_watch import WATCHED, LimitWatch, judged_samples

from .console import Console

ORDER = ("angle", "rate", "rate_time", "torque", "current")
CHANNELS = ("relative_angle", "relative_rate", "drive_torque", "motor_current")
VERDICTS = [each.limit for each in WATCHED]
PLAIN = {"angle": 2.0, "rate": 1.0, "rate_time": 0.01, "torque": 50.0, "current": 3.0}


def options(**changed: float) -> LimitsOptions:
    told = {**PLAIN, "acceleration": 1.0, "duration": 1.0, **changed}
    return LimitsOptions.model_validate(told, context={"si": True})


def begin(console: Console, limits: LimitsOptions, sample_rate: float) -> int:
    values = [getattr(limits, name) for name in ORDER]
    [line] = console.do("limits", struct.pack("<6d", *values, sample_rate).hex())
    return int(line.split()[1])


def in_c(console: Console, block: np.ndarray, cut: int) -> tuple[int, str] | None:
    for part in (block[:, :cut], block[:, cut:]):
        samples = np.ascontiguousarray(part.T, dtype="<f8").tobytes().hex()
        for line in console.do("measured", samples or "-"):
            _, sample, verdict = line.split()
            return int(sample), ("within", *VERDICTS, "undefined")[int(verdict)]
    return None


def on_host(limits: LimitsOptions, sample_rate: float, block: np.ndarray) -> object:
    watch = LimitWatch(limits, sample_rate, CHANNELS)
    found = watch.look(np.arange(block.shape[1]) / sample_rate, block)
    return found and (found.sample, found.limit)


def test_both_end_at_the_same_sample(console: Console) -> None:
    """Random motions near their limits, so that means lie within rounding of each other."""
    random = np.random.default_rng(20)
    ends = []
    for _ in range(500):
        limits = options(
            rate_time=float(random.choice([1e-4, 0.003, 0.01, 0.1])),
            angle=float(random.uniform(0.5, 30)),
            rate=float(random.choice([1.0, random.uniform(0.7, 1.4)])),
        )
        sample_rate = float(random.choice([100.0, 1000.0, 2048.0]))
        count = int(random.integers(1, 300))
        shape = random.choice([0.0, 0.5, 3.0])
        rate = random.uniform(0.5, 1.1) * np.ones(count) + random.normal(0, shape, count)
        block = np.stack(
            [
                random.normal(0, 0.35 * limits.angle, count),
                rate * random.choice([-1, 1]),
                random.normal(0, 16, count),
                random.normal(0, 0.95, count),
            ]
        )
        assert begin(console, limits, sample_rate) == judged_samples(limits, sample_rate)
        found = in_c(console, block, int(random.integers(0, count + 1)))
        assert found == on_host(limits, sample_rate, block)
        ends.append(found and found[1])
    assert {None, *VERDICTS} == set(ends)  # each was met


def test_right_at_the_limit_is_within(console: Console) -> None:
    at = np.array([[2.0], [1.0], [50.0], [3.0]]) * np.ones(500)
    begin(console, options(), 1000.0)
    assert in_c(console, at, 17) is None
    begin(console, options(rate=0.1), 1000.0)
    assert in_c(console, at * [[1], [0.1], [1], [1]], 17) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("row", range(4))
def test_what_is_undefined_ends_the_trial(console: Console, value: float, row: int) -> None:
    block = np.zeros((4, 20))
    block[row, 7] = value
    begin(console, options(), 1000.0)
    assert in_c(console, block, 5) == (7, "undefined")


def test_nothing_is_watched_with_limits_that_are_none(console: Console) -> None:
    """Arming has to be refused then; whoever does not, is told at the first sample."""
    for name in ORDER:
        for value in (0.0, -1.0, np.nan, np.inf):
            values = [PLAIN[each] if each != name else value for each in ORDER]
            [line] = console.do("limits", struct.pack("<6d", *values, 1000.0).hex())
            assert line == "samples 0"
    assert begin(console, options(rate_time=1.0, angle=1e6), 1e5) == 0  # the ring has 4096
    assert in_c(console, np.zeros((4, 1)), 0) == (0, "undefined")
