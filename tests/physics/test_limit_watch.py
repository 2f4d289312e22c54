"""The one judgement of limits on measured samples, against exact sums and moving axes."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign.physics.bench import LimitsOptions
from campaign.physics.limit_watch import LimitWatch, Violation, judged_samples

CHANNELS = ("gyro_rate", "relative_rate", "relative_angle", "motor_current", "drive_torque")
RATE, ANGLE, CURRENT, TORQUE = 1, 2, 3, 4


def limits(**changed: float) -> LimitsOptions:
    plain = {"angle": 2.0, "rate": 1.0, "acceleration": 1.0, "torque": 50.0, "current": 3.0}
    return LimitsOptions.model_validate(plain | {"duration": 1e3} | changed, context={"si": True})


def judge(
    on: LimitsOptions, block: np.ndarray, sample_rate: float = 1000.0, cuts: Any = ()
) -> Violation | None:
    watch = LimitWatch(on, sample_rate, CHANNELS)
    time = np.arange(block.shape[1]) / sample_rate
    for part in np.split(np.arange(block.shape[1]), sorted(cuts)):
        found = watch.look(time[part], block[:, part])
        if found is not None:
            return found
    return None


def still(samples: int, **rows: Any) -> np.ndarray:
    """A bench at rest, but for the named channels."""
    block = np.zeros((len(CHANNELS), samples))
    for name, values in rows.items():
        block[CHANNELS.index(name)] = values
    return block


@pytest.mark.parametrize(
    ("channel", "limit", "bound"),
    [("relative_angle", "angle", 2.0), ("drive_torque", "torque", 50.0),
     ("motor_current", "current", 3.0)],
)  # fmt: skip
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_angle_torque_and_current_are_judged_at_every_sample(
    channel: str, limit: str, bound: float, sign: float
) -> None:
    values = np.full(100, sign * bound)  # right at the limit is allowed
    assert judge(limits(), still(100, **{channel: values})) is None
    values[37] = sign * np.nextafter(bound, 9e9)
    found = judge(limits(), still(100, **{channel: values}))
    assert (found.sample, found.limit, found.channel) == (37, limit, channel)
    assert found.value == values[37]
    assert f"the {limit} limit is" in found.text
    assert "at 0.037 s" in found.text


def test_the_rate_is_judged_by_its_mean_over_the_judging_time() -> None:
    """10 ms are 10 samples: one of 9.9 times the limit is nothing, a lasting 1.01 is."""
    spike = np.zeros(100)
    spike[50] = 9.9
    assert judge(limits(), still(100, relative_rate=spike)) is None
    spike[55] = -9.9
    spike[57] = 10.5
    found = judge(limits(), still(100, relative_rate=spike))
    assert found.sample == 57
    assert found.value == pytest.approx(1.05)
    assert "mean of 10 ms" in found.text
    lasting = np.where(np.arange(100) < 40, 0.0, -1.02)
    found = judge(limits(), still(100, relative_rate=lasting))
    assert (found.sample, found.value) == (49, pytest.approx(-1.02))  # the tenth of them


def test_before_the_trial_the_bench_was_at_rest() -> None:
    at_once = still(100, relative_rate=1.5)
    found = judge(limits(), at_once)
    assert found.sample == 6  # seven samples of 1.5 in a mean over ten
    assert judge(limits(), still(100, relative_rate=1.0)) is None


def test_lost_samples_count_as_zero_and_do_not_shift_the_numbers() -> None:
    watch = LimitWatch(limits(), 1000.0, CHANNELS)
    time = np.arange(40) / 1000
    assert watch.look(time[:6], still(6, relative_rate=1.5)) is None
    watch.skip(4)
    undefined = still(3, relative_rate=np.nan, relative_angle=np.nan)
    assert watch.look(time[10:13], undefined) is None
    found = watch.look(time[13:], still(27, relative_rate=1.5))
    assert (found.sample, found.index) == (19, 6)


@pytest.mark.parametrize(
    ("changed", "sample_rate", "samples"),
    [
        ({}, 1000.0, 10),
        ({}, 2000.0, 20),
        ({}, 50.0, 1),  # never less than one
        ({}, 1990.0, 19),  # rounded down
        ({"rate_time": 0.1}, 1000.0, 20),  # 1 % of 2 rad at 1 rad/s
        ({"angle": 0.3}, 1000.0, 3),
        ({"rate": 40.0}, 1000.0, 1),
    ],
)
def test_the_judging_time(changed: dict[str, float], sample_rate: float, samples: int) -> None:
    assert judged_samples(limits(**changed), sample_rate) == samples


def test_a_limit_whose_channel_is_not_recorded_is_named() -> None:
    watch = LimitWatch(limits(), 1000.0, ("relative_angle", "gyro_rate"))
    assert watch.unwatched == ("rate", "torque", "current")
    block = np.array([[0.0, 2.5], [99.0, 99.0]])
    found = watch.look(np.array([0.0, 1e-3]), block)
    assert (found.sample, found.limit) == (1, "angle")


def test_of_several_limits_the_first_in_time_is_named() -> None:
    block = still(50, relative_angle=np.linspace(0, 4, 50), motor_current=np.linspace(0, 4, 50))
    block[CURRENT, 10] = 5.0
    found = judge(limits(), block)
    assert (found.limit, found.sample) == ("current", 10)


COUNTS = st.integers(-40, 40)


@pytest.mark.slow
@settings(max_examples=300)
@given(
    st.lists(COUNTS, min_size=1, max_size=80),
    st.sampled_from([1, 2, 3, 7, 10, 64]),
    st.lists(st.integers(0, 80), max_size=6),
)
def test_means_are_exact_and_do_not_depend_on_the_blocks(
    counts: list[int], window: int, cuts: list[int]
) -> None:
    """Against exact arithmetic on multiples of 1/8; the limit lies between two multiples."""
    bound = Fraction(81, 64)
    on = limits(rate=float(bound), rate_time=window / 1000, angle=1e3)
    expected = None
    for sample in range(len(counts)):
        last = counts[max(0, sample - window + 1) : sample + 1]
        if abs(Fraction(sum(last), 8 * window)) > bound:
            expected = sample
            break
    block = still(len(counts), relative_rate=np.array(counts) / 8)
    cuts = [cut for cut in cuts if cut <= len(counts)]
    found = judge(on, block, cuts=cuts)
    assert (found.sample if found else None) == expected
    assert (
        found is None
        or found.value
        == sum(counts[max(0, found.sample - window + 1) : found.sample + 1]) / 8 / window
    )  # to the bit


@settings(max_examples=200)
@given(st.integers(0, 2**32), st.sampled_from([3, 10, 33]), st.integers(1, 50))
def test_one_block_or_many_the_same_to_the_bit(seed: int, window: int, size: int) -> None:
    random = np.random.default_rng(seed)
    rates = np.cumsum(random.normal(0, 0.1, 600)) + random.normal(0, 3, 600)
    on = limits(rate_time=window / 1000, angle=1e3)
    whole = judge(on, still(600, relative_rate=rates))
    cut = judge(on, still(600, relative_rate=rates), cuts=range(0, 600, size))
    assert (whole and (whole.sample, whole.value)) == (cut and (cut.sample, cut.value))


@settings(max_examples=300)
@given(
    st.integers(0, 2**32),
    st.sampled_from([0.004, 0.01, 0.3]),
    st.floats(0.05, 20.0),
    st.sampled_from([500.0, 1000.0, 4000.0]),
)
def test_an_axis_that_runs_away_goes_at_most_2_percent_of_the_angle_limit_further(
    seed: int, rate_time: float, angle: float, sample_rate: float
) -> None:
    """Further than if every sample were judged alone: from the first one beyond the limit, the
    last of both left out. It may come from anywhere, at the other direction's limit at worst.
    """
    random = np.random.default_rng(seed)
    on = limits(rate_time=rate_time, angle=angle)
    before = random.choice([-1.0, 0.0, 1.0, random.uniform(-1, 1)]) * np.ones(200)
    if random.random() < 0.5:
        before *= np.sin(np.arange(200) * random.uniform(0.01, 0.5))
    away = 1.0 + 1e-6 + random.exponential(random.choice([1e-3, 1.0, 10.0, 100.0]), 1000)
    rates = np.concatenate([before, away * random.choice([-1, 1])])
    found = judge(on, still(1200, relative_rate=rates), sample_rate)
    assert 200 <= found.sample < 200 + judged_samples(on, sample_rate)
    further = abs(np.sum(rates[201 : found.sample])) / sample_rate
    assert further <= 0.02 * angle


@settings(max_examples=200)
@given(st.integers(0, 2**32))
def test_while_it_lasts_no_window_moves_by_more_than_the_rate_allows(seed: int) -> None:
    random = np.random.default_rng(seed)
    rates = random.normal(0, random.uniform(0.1, 5), 400)
    found = judge(limits(), still(400, relative_rate=rates))
    good = found.sample if found else 400
    travels = np.convolve(rates, np.full(10, 1e-3))[:good]
    assert np.all(np.abs(travels) <= 1.0 * 0.01 * (1 + 1e-8))
    if found:
        last = rates[max(0, found.sample - 9) : found.sample + 1]
        assert abs(np.sum(last)) * 1e-3 > 1.0 * 0.01


def test_an_encoder_of_12_bits_at_2_khz_trips_nothing_but_a_runaway() -> None:
    """One count per sample is 175.8 deg/s."""
    count = 2 * np.pi / 4096
    on = limits(rate=np.deg2rad(150.0), angle=np.deg2rad(180.0))
    time = np.arange(4000) / 2000
    for speed in (5.0, 120.0):
        angle = np.rint(np.deg2rad(speed) * time / count) * count
        rate = np.diff(angle, prepend=0.0) * 2000
        assert np.max(rate) > np.deg2rad(175)
        assert judge(on, still(4000, relative_rate=rate), 2000.0) is None
    alone = limits(rate=np.deg2rad(150.0), angle=np.deg2rad(180.0), rate_time=1e-6)
    assert judge(alone, still(4000, relative_rate=rate), 2000.0) is not None
