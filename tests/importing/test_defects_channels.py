"""Channels: what was done to sound ones is found, where and how large; and is repaired as asked."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.importing.defects import Defect, Severity, find
from campaign.importing.defects.between import candidates
from campaign.importing.defects.repairs import lose, scale, shift, swap_sign, unfill, unwrap
from tests.importing import rig
from tests.importing.rig import Motion, rounded

SEEDS = range(5)
MOTIONS = {"sines": rig.sines, "trapezoids": rig.trapezoids}
BOTH = pytest.mark.parametrize("motion", [f(s) for f in MOTIONS.values() for s in SEEDS])


def found(
    motion: Motion, kind: str, *, rate: float | None = None, gear: float | None = None, **changed
) -> list[Defect]:
    own = {
        "relative_angle": motion.q,
        "relative_rate": motion.v,
        "drive_torque": motion.tau,
        **changed,
    }
    return [
        each
        for each in find(motion.t, own, rate=rate, gear=gear)
        if each.kind == kind and each.severity is not Severity.NOTED
    ]


def noted(motion: Motion, kind: str, **changed) -> list[Defect]:
    own = {"relative_angle": motion.q, "relative_rate": motion.v, **changed}
    return [each for each in find(motion.t, own) if each.kind == kind]


@BOTH
def test_a_torque_against_its_motion_has_the_wrong_sign(motion):
    (sign,) = found(motion, "sign", drive_torque=-motion.tau)
    assert (sign.channels, sign.repair) == (("drive_torque", "relative_rate"), "swap_sign")
    assert sign.severity is Severity.REPAIRABLE
    assert found(motion, "sign", drive_torque=swap_sign(-motion.tau).values) == []


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
    assert only.severity is Severity.REPAIRABLE
    mended = scale(motion.v * factor, 1 / only.size).values
    assert found(motion, "factor", relative_angle=coarse, relative_rate=mended) == []


@BOTH
def test_where_two_reasons_fit_none_is_chosen(motion):
    (only,) = found(motion, "factor", relative_rate=1000 * motion.v)
    assert (only.severity, only.repair) == (Severity.REFUSED, "")
    assert "ms" in only.what
    assert "gear of 1000" in only.what
    (only,) = found(motion, "factor", relative_rate=57.3 * motion.v, gear=57.2)
    assert only.severity is Severity.REFUSED
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
    assert candidates(57.0) == ["they are on the two sides of a gear of 57"]
    assert len(candidates(57.2, error=0.002)) == 2


@BOTH
@pytest.mark.parametrize("samples", [8, 3.5])
def test_a_late_rate_is_found_and_moved(motion, samples):
    late = np.interp(motion.t - samples * 1e-3, motion.t, motion.v)
    (delay,) = noted(motion, "delay", relative_rate=late)
    assert delay.size == pytest.approx(samples * 1e-3, abs=4e-4)
    assert noted(motion, "delay") == []
    moved = shift(late, samples * 1e-3, 1e-3)
    known = np.isfinite(moved.values)
    assert (~known).sum() == int(np.ceil(samples))
    inner = slice(20, -20)
    assert np.abs(moved.values[inner] - motion.v[inner]).max() < 0.02
    assert "earlier" in moved.what


@BOTH
def test_a_clipped_torque_is_found(motion):
    limit = 0.6 * min(motion.tau.max(), -motion.tau.min())
    clipped = np.clip(motion.tau, -limit, limit)
    defects = found(motion, "clipping", drive_torque=clipped)
    assert {abs(each.size) for each in defects} == {limit}
    assert {each.repair for each in defects} == {"lose"}
    own = {"command": motion.tau * 1.001, "drive_torque": clipped}
    asked = [d for d in find(motion.t, own, command="drive_torque") if d.kind == "clipping"]
    assert {each.severity for each in asked} == {Severity.REFUSED}


def test_a_plateau_that_was_asked_for_is_not_clipped():
    t = np.arange(4000) / 1000
    command = np.clip(20 * np.sin(t), -5, 5)
    own = {"command": command, "drive_torque": command.copy()}
    assert not [d for d in find(t, own, command="drive_torque") if d.kind == "clipping"]


@BOTH
def test_single_wild_samples_are_found(motion):
    torque = motion.tau.copy()
    torque[777] = 1e6
    torque[1500] = -1e7
    (spike,) = found(motion, "spike", drive_torque=torque)
    assert spike.rows == (777, 1500)
    assert "2 single samples" in spike.what
    assert found(motion, "spike") == []


def test_the_end_of_whole_numbers_is_clipping():
    counts = np.clip(np.round(40000 * np.sin(np.arange(3000) / 300)), -32768, 32767)
    defects = [d for d in find(np.arange(3000) / 1000, {"x": counts}) if d.kind == "clipping"]
    assert {each.size for each in defects} == {-32768, 32767}


@BOTH
@pytest.mark.parametrize("scale_of", [2 * np.pi, 360.0, 4096.0])
def test_an_angle_that_begins_anew_is_made_continuous(motion, scale_of):
    angle = motion.q / np.ptp(motion.q) * 2.5 * scale_of
    wrapped = np.mod(angle, scale_of)
    own = {"relative_angle": wrapped}
    (wrap,) = [d for d in find(motion.t, own) if d.kind == "wraparound"]
    assert wrap.size == pytest.approx(scale_of)
    made = unwrap(wrapped, wrap.size)
    np.testing.assert_allclose(made.values - made.values[0], angle - angle[0], atol=1e-6)
    rate = motion.v / np.ptp(motion.q) * 2.5 * scale_of
    assert found(motion, "factor", relative_angle=wrapped, relative_rate=rate) == []


@BOTH
def test_dropouts_are_found_where_they_are_and_lost(motion):
    quick = np.flatnonzero(np.abs(motion.v) > 0.6 * np.abs(motion.v).max())
    rows = quick[[len(quick) // 4, len(quick) // 2]]
    broken = motion.v.copy()
    broken[rows[0]] = 0.0
    broken[rows[1] : rows[1] + 6] = 0.0
    drops = found(motion, "dropout", relative_rate=broken)
    assert [each.rows for each in drops] == sorted([(rows[0], rows[0]), (rows[1], rows[1] + 5)])
    left = lose(broken, [each.rows for each in drops])
    assert np.isnan(left.values).sum() == left.touched == 7
    assert found(motion, "dropout", relative_rate=left.values) == []


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


def test_lost_and_constant_channels_are_told():
    t = np.arange(100) / 100
    lost = np.sin(t)
    lost[20:30] = np.nan
    (each,) = [d for d in find(t, {"x": lost}) if d.kind == "lost"]
    assert (each.rows, each.size, each.severity) == ((20, 29), 10, Severity.NOTED)
    (each,) = find(t, {"x": np.full(100, np.nan)})
    assert each.severity is Severity.REFUSED
    (each,) = find(t, {"x": np.full(100, 3.0)})
    assert (each.kind, each.size) == ("constant", 3)


@BOTH
def test_the_steps_of_a_sensor_are_measured(motion):
    own = {"relative_angle": rounded(motion.q, 2e-3)}
    (steps,) = [d for d in find(motion.t, own) if d.kind == "quantisation"]
    assert steps.size == pytest.approx(2e-3)
    assert not [d for d in find(motion.t, {"drive_torque": motion.tau}) if d.kind == "quantisation"]


@BOTH
@pytest.mark.parametrize("period", [2, 10])
def test_slower_channels_are_found_held_or_filled(motion, period):
    held = np.repeat(motion.tau[::period], period)
    (each,) = noted(motion, "held", drive_torque=held)
    assert (each.size, each.severity) == (period, Severity.NOTED)
    filled = np.interp(motion.t, motion.t[::period], motion.tau[::period])
    (each,) = noted(motion, "filled", drive_torque=filled)
    assert (each.size, each.severity) == (period, Severity.REPAIRABLE)
    back = unfill(filled, period)
    last = len(held) - 2 * period
    np.testing.assert_allclose(back.values[:last], held[:last])


@BOTH
def test_a_torque_worked_out_from_current_is_one_signal(motion):
    twins = noted(motion, "twice", drive_torque=motion.tau, motor_current=motion.i - 0.1)
    (each,) = twins
    assert abs(each.size) == pytest.approx(1 / rig.TORQUE_CONSTANT, rel=1e-3)
    other = motion.i + np.random.default_rng(0).normal(0, 0.1 * motion.i.std(), len(motion.t))
    assert noted(motion, "twice", drive_torque=motion.tau, motor_current=other) == []
