"""Channels: what was done to sound ones is found, where and how large."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.importing.defects import Defect, find
from campaign.importing.defects.between import candidates
from campaign.importing.defects.drives import of_drive_delay
from campaign.importing.defects.samples import continuous
from tests.importing import rig
from tests.importing.rig import Motion, rounded

SEEDS = range(5)
MOTIONS = {"sines": rig.sines, "trapezoids": rig.trapezoids}
BOTH = pytest.mark.parametrize("motion", [f(s) for f in MOTIONS.values() for s in SEEDS])


def found(motion: Motion, kind: str, *, gear: float | None = None, **changed) -> list[Defect]:
    own = {"relative_angle": motion.q, "relative_rate": motion.v, "drive_torque": motion.tau}
    own |= changed
    return [each for each in find(motion.t, own, gear=gear) if each.kind == kind and not each.noted]


def noted(motion: Motion, kind: str, **changed) -> list[Defect]:
    own = {"relative_angle": motion.q, "relative_rate": motion.v, **changed}
    return of_kind(kind, motion.t, own)


def of_kind(kind: str, time: np.ndarray, own: dict[str, np.ndarray]) -> list[Defect]:
    return [each for each in find(time, own) if each.kind == kind]


@BOTH
def test_a_torque_against_its_motion_has_the_wrong_sign(motion):
    (sign,) = found(motion, "sign", drive_torque=-motion.tau)
    assert sign.channels == ("drive_torque", "relative_rate")
    assert not sign.noted
    assert found(motion, "sign", drive_torque=motion.tau) == []


@BOTH
def test_a_rate_against_its_angle_has_the_wrong_sign(motion):
    rate_sign = [
        each
        for each in found(motion, "sign", relative_rate=-motion.v)
        if each.channels == ("relative_rate", "relative_angle")
    ]
    assert len(rate_sign) == 1
    assert rate_sign[0].size == pytest.approx(-1, abs=0.02)


@BOTH
@pytest.mark.parametrize(
    ("factor", "means"),
    [(180 / np.pi, "deg/s, the angle in rad"), (30 / np.pi, "rpm, the angle in rad"),
     (np.pi / 180, "rad/s, the angle in deg"), (2 * np.pi, "rad/s, the angle in turns")],
)  # fmt: skip
def test_a_factor_of_units_is_named(motion, factor, means):
    coarse = rounded(motion.q, 2 * np.pi / 65536)
    (only,) = found(motion, "factor", relative_angle=coarse, relative_rate=motion.v * factor)
    assert only.size == pytest.approx(factor, rel=3e-3)
    assert means in only.what
    assert "either" not in only.what
    assert found(motion, "factor", relative_angle=coarse) == []


@BOTH
def test_where_two_reasons_fit_none_is_chosen(motion):
    (only,) = found(motion, "factor", relative_rate=1000 * motion.v)
    assert "either" in only.what
    assert "ms" in only.what
    assert "gear of 1000" in only.what
    (only,) = found(motion, "factor", relative_rate=57.3 * motion.v, gear=57.2)
    assert "either" in only.what
    (only,) = found(motion, "factor", relative_rate=100 * motion.v, gear=100.0)
    assert "gear of 100" in only.what
    (only,) = found(motion, "factor", relative_rate=3.7 * motion.v)
    assert "for no usual reason" in only.what


@BOTH
def test_a_rate_is_held_against_the_angle_across_the_gear(motion):
    def across(rate: np.ndarray) -> list[Defect]:
        own = {"relative_angle": motion.q, "motor_rate": rate}
        return [each for each in find(motion.t, own, gear=51.3) if each.kind in ("factor", "sign")]

    assert across(51.3 * motion.v) == []
    (sign,) = across(-51.3 * motion.v)
    assert (sign.kind, sign.channels) == ("sign", ("motor_rate", "relative_angle"))
    (factor,) = across(51.3 * motion.v * 30 / np.pi)
    assert "the rate is in rpm, the angle in rad" in factor.what
    assert "51.3 times relative_angle" in factor.what


def test_candidates_are_words():
    assert candidates(1.0) == []
    assert candidates(57.0) == ["they are on the two sides of a gear of 57 (`[gear] ratio`)"]
    assert len(candidates(57.2, error=0.002)) == 2


@BOTH
@pytest.mark.parametrize("samples", [8, 3.5])
def test_a_late_rate_is_found(motion, samples):
    late = np.interp(motion.t - samples * 1e-3, motion.t, motion.v)
    (delay,) = noted(motion, "delay", relative_rate=late)
    assert delay.size == pytest.approx(samples * 1e-3, abs=4e-4)
    assert noted(motion, "delay") == []
    assert "'delay'" in delay.remedy


@BOTH
def test_a_clipped_torque_is_found(motion):
    limit = 0.6 * min(motion.tau.max(), -motion.tau.min())
    clipped = np.clip(motion.tau, -limit, limit)
    defects = found(motion, "clipping", drive_torque=clipped)
    assert {abs(each.size) for each in defects} == {limit}
    assert not any(each.noted for each in defects)


@BOTH
def test_single_wild_samples_are_found(motion):
    torque = motion.tau.copy()
    torque[777] = 1e6
    torque[1500] = -1e7
    (spike,) = found(motion, "spike", drive_torque=torque)
    assert spike.rows == (777, 1500)
    assert "2 single samples" in spike.what
    assert found(motion, "spike") == []


@BOTH
@pytest.mark.parametrize("scale_of", [2 * np.pi, 360.0, 4096.0])
def test_an_angle_that_begins_anew_is_made_continuous(motion, scale_of):
    angle = motion.q / np.ptp(motion.q) * 2.5 * scale_of
    wrapped = np.mod(angle, scale_of)
    own = {"relative_angle": wrapped}
    (wrap,) = of_kind("wraparound", motion.t, own)
    assert wrap.size == pytest.approx(scale_of)
    made = continuous(wrapped, wrap.size)
    np.testing.assert_allclose(made - made[0], angle - angle[0], atol=1e-6)
    rate = motion.v / np.ptp(motion.q) * 2.5 * scale_of
    assert found(motion, "factor", relative_angle=wrapped, relative_rate=rate) == []
    wrapped[10] = np.nan  # a sample that was lost hides nothing of what is behind it
    assert len(found(motion, "factor", relative_angle=wrapped, relative_rate=57.3 * rate)) == 1


@BOTH
def test_dropouts_are_found_where_they_are(motion):
    quick = np.flatnonzero(np.abs(motion.v) > 0.6 * np.abs(motion.v).max())
    rows = quick[[len(quick) // 4, len(quick) // 2]]
    broken = motion.v.copy()
    broken[rows[0]] = 0.0
    broken[rows[1] : rows[1] + 6] = 0.0
    (drop,) = found(motion, "dropout", relative_rate=broken)
    assert (drop.rows, drop.size) == ((rows[0], rows[1] + 5), 7)
    assert f"row {rows[0] + 1} and in 1 further stretch (7 samples)" in drop.what
    broken[broken == 0.0] = np.nan  # marked as lost
    assert found(motion, "dropout", relative_rate=broken) == []


def test_what_is_zero_for_a_tenth_of_a_recording_has_another_reason():
    motion = rig.sines(0)
    broken = motion.v.copy()
    fast = np.abs(motion.v) > 0.3 * np.abs(motion.v).max()
    broken[fast & (np.arange(len(broken)) % 4 == 0)] = 0.0
    assert np.mean(broken == 0.0) > 0.05
    assert found(motion, "dropout", relative_rate=broken) == []


@BOTH
def test_a_noisy_channel_that_stands_still_is_a_dropout(motion):
    quick = int(np.argmax(np.abs(np.gradient(motion.tau[100:-100])))) + 100
    chance = np.random.default_rng(1)
    torque = motion.tau + chance.normal(0, 0.02, len(motion.t))
    torque[quick - 20 : quick + 20] = torque[quick - 21]
    if abs(torque[quick + 20] - torque[quick]) > 0.3:
        assert [d.rows for d in found(motion, "dropout", drive_torque=torque)] == [
            (quick - 20, quick + 19)
        ]


def test_lost_samples_are_told_and_constant_channels_are_not():
    t = np.arange(100) / 100
    lost = np.sin(t)
    lost[20:30] = np.nan
    (each,) = [d for d in find(t, {"x": lost}) if d.kind == "lost"]
    assert (each.rows, each.size, each.noted) == ((20, 29), 10, True)
    (each,) = find(t, {"x": np.full(100, np.nan)})
    assert not each.noted
    assert not find(t, {"x": np.full(100, 3.0)})


@BOTH
@pytest.mark.parametrize("period", [2, 10])
def test_slower_channels_are_found_held_or_filled(motion, period):
    held = np.repeat(motion.tau[::period], period)
    (each,) = noted(motion, "held", drive_torque=held)
    assert (each.size, each.noted) == (period, True)
    filled = np.interp(motion.t, motion.t[::period], motion.tau[::period])
    (each,) = noted(motion, "filled", drive_torque=filled)
    assert (each.size, each.noted) == (period, False)


@BOTH
def test_a_torque_worked_out_from_current_is_one_signal(motion):
    twins = noted(motion, "twice", drive_torque=motion.tau, motor_current=motion.i - 0.1)
    (each,) = twins
    assert abs(each.size) == pytest.approx(1 / rig.TORQUE_CONSTANT, rel=1e-3)
    other = motion.i + np.random.default_rng(0).normal(0, 0.1 * motion.i.std(), len(motion.t))
    assert noted(motion, "twice", drive_torque=motion.tau, motor_current=other) == []


def behind(values: np.ndarray, samples: int) -> np.ndarray:
    """A channel that comes later by some samples, or earlier; at its ends it rests."""
    return np.interp(np.arange(len(values)) - samples, np.arange(len(values)), values)


@BOTH
@pytest.mark.parametrize("samples", [500, 800, -500])
@pytest.mark.parametrize("name", ["drive_torque", "motor_current", "joint_torque"])
def test_a_torque_that_is_late_against_the_motion_is_refused_by_name(motion, name, samples):
    own = {"drive_torque": motion.tau, name: behind(motion.tau, samples)}
    (late,) = found(motion, "delay", **own)
    assert late.channels == (name, "relative_rate")
    assert late.size == pytest.approx(samples * 1e-3, abs=0.01)
    assert "'delay'" in late.remedy
    where = "after" if samples > 0 else "before"
    assert f"{name} comes {abs(samples) / 1000:g} s {where} the motion of" in late.what


@BOTH
def test_it_is_held_against_the_derivative_of_an_angle_where_no_rate_is_recorded(motion):
    own = {"relative_angle": motion.q, "drive_torque": behind(motion.tau, 500)}
    (late,) = of_kind("delay", motion.t, own)
    assert late.size == pytest.approx(0.5, abs=0.01)
    assert "the derivative of relative_angle" in late.what


@BOTH
@pytest.mark.parametrize("samples", [0, 8, 20])
def test_the_filter_of_a_drive_is_no_late_torque(motion, samples):
    """And what nothing is wrong with, as test_defects_clean has it."""
    assert found(motion, "delay", drive_torque=behind(motion.tau, samples)) == []


@BOTH
def test_a_rate_that_is_late_by_half_a_second_is_found(motion):
    late = behind(motion.v, 500)
    rates = [d for d in noted(motion, "delay", relative_rate=late) if "relative_rate" in d.channels]
    assert [each.size for each in rates] == [pytest.approx(0.5, abs=0.01)]


@pytest.mark.parametrize("frequency", [0.5, 2.0])
def test_of_what_repeats_itself_the_shortest_delay_counts(frequency):
    t = np.arange(12_000) / 1000
    q = np.sin(2 * np.pi * frequency * t) / (2 * np.pi * frequency)
    v = np.cos(2 * np.pi * frequency * t)
    chance = np.random.default_rng(2)
    rate = v + chance.normal(0, 1e-3, len(t))
    late = np.interp(t - 0.02, t, rate)
    (delay,) = of_kind("delay", t, {"relative_angle": q, "relative_rate": late})
    assert delay.size == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_period_later_is_no_delay_of_a_coarsely_sampled_sine(seed):
    """Twenty samples a cycle with stamps that jitter: a cycle later fits by chance a bit better."""
    chance = np.random.default_rng(seed)
    t = np.arange(400) / 62.5
    stamped = t + chance.uniform(-0.4, 0.4, len(t)) / 62.5
    phase = 2 * np.pi * 62.5 / 20 * stamped
    own = {"relative_angle": np.sin(phase), "relative_rate": 2 * np.pi * 62.5 / 20 * np.cos(phase)}
    late = [each.size for each in find(t, own) if each.kind == "delay"]
    assert all(abs(size) < 0.05 for size in late), late


def test_a_torque_that_is_steady_in_the_middle_is_not_late():
    """There it does not vary, and nothing explains its noise; its jump before that is right."""
    chance = np.random.default_rng(3)
    t = np.arange(250) / 250
    v = np.interp(t, [0.0, 0.2, 0.4, 1.0], [0.0, 0.0, 0.2, 0.2])
    tau = 40 * np.tanh(v / 0.002) + 9 * v + 0.3 * chance.standard_normal(len(t))
    rate = v + 1e-4 * chance.standard_normal(len(t))
    own = {"relative_angle": np.cumsum(v) / 250, "relative_rate": rate, "drive_torque": tau}
    assert [each.what for each in find(t, own) if each.kind == "delay"] == []


def test_a_rate_that_stands_still_in_the_middle_is_like_nothing():
    """Next to no motion there, and rounding: no delay, and no number that is none."""
    t = np.arange(2000) / 1000
    v = np.where(np.abs(t - 1.0) > 0.85, np.sin(40 * t), 0.0)
    q = np.cumsum(v) / 1000 + 1e-17 * np.sin(t)
    with np.errstate(all="raise", under="ignore"):
        found = find(t, {"relative_angle": q, "relative_rate": v})
    assert [each.what for each in found if each.kind == "delay"] == []


@pytest.mark.parametrize("speed", [5e-5, 1e-3, 0.02])
def test_a_rate_that_agrees_with_its_angle_is_not_late_for_what_its_rounding_is_like(speed):
    """An even run behind a ramp: of its middle only the rounding of numbers is left to compare."""
    t = np.arange(6200) / 1000
    v = np.minimum(t / 0.1, 1.0) * speed
    q = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1])) / 1000])
    found = [d for d in find(t, {"relative_angle": q, "relative_rate": v}) if d.kind == "delay"]
    assert [each.what for each in found if not each.noted] == []


@pytest.mark.parametrize("seed", range(6))
def test_a_stroke_in_one_direction_under_gravity_is_not_late(seed):
    """Its sign is constant but for the last digits: that explains nothing, at whatever delay."""
    random = np.random.default_rng(seed)
    time = np.arange(334) / 66.8
    rate = -0.7 * np.clip(np.minimum(time / 0.03, (4.4 - time) / 0.05), 0.0, 1.0)
    rate += 0.015 * random.standard_normal(len(time)) * (rate != 0)
    rate[3:6] *= 1.05  # it overshoots
    angle = np.cumsum(rate) / 66.8
    torque = 2.0 * np.sin(2 * angle) - 1.6 * np.sign(rate) * (np.abs(rate) > 0.1)
    torque += 0.15 * random.standard_normal(len(time)) - 8.0 * (time < 0.01)
    names = ("drive_torque", "relative_rate")
    assert list(of_drive_delay(time, rate, torque, names)) == []
