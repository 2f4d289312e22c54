"""Every repair that a mapping can ask for: what is wrong is refused and says so, then right."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from tests.importing import rig
from tests.importing.rig import Motion
from tests.importing.test_mapping import planned, refused, served

LAYOUT = """\
[columns.rig.time]
column = "t"
unit = "s"
[columns.rig.relative_angle]
column = "q"
unit = "rad"
[columns.rig.relative_rate]
column = "v"
unit = "rad/s"
[columns.rig.drive_torque]
column = "tau"
unit = "N m"
[[test]]
name = "any"
kind = "motion"
bench = "platform"
[[test.recording]]
file = "a.csv"
"""
SOUND = rig.sines(3, length=4.0)
STEP = 1e-3


@dataclass(frozen=True)
class Rows:
    """What stands in the file; shape (n,) each."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray

    def text(self) -> str:
        rows = zip(self.t, self.q, self.v, self.tau, strict=True)
        return "t,q,v,tau\n" + "\n".join(",".join(f"{x:.10g}" for x in row) for row in rows)

    def only(self, rows: np.ndarray) -> Rows:
        return Rows(self.t[rows], self.q[rows], self.v[rows], self.tau[rows])


def rows_of(motion: Motion) -> Rows:
    return Rows(motion.t, motion.q, motion.v, motion.tau)


@dataclass(frozen=True)
class Case:
    """A file that is wrong, what is said of it, and the line of the layout that puts it right.

    Attributes:
        lost: samples that stay without a number.
        off: by how much the rate may be off in rad/s, where lines were put through it.
    """

    rows: Rows
    says: str
    was: str
    now: str
    lost: tuple[int, ...] = ()
    off: float = 1e-8


def _jittered() -> Rows:
    """Sampled when the stamps say."""
    t = SOUND.t + np.random.default_rng(1).uniform(-0.4, 0.4, len(SOUND.t)) * STEP
    t[[0, -1]] = SOUND.t[[0, -1]]
    smooth = np.gradient(SOUND.q, STEP)
    return Rows(t, *(np.interp(t, SOUND.t, each) for each in (SOUND.q, smooth, SOUND.tau)))


def _gap() -> Rows:
    return rows_of(SOUND).only(np.delete(np.arange(len(SOUND.t)), range(1000, 1010)))


def _repeated() -> Rows:
    return rows_of(SOUND).only(np.insert(np.arange(len(SOUND.t)), [500, 900], [499, 890]))


RATE = 'column = "v"\n'
ANGLE = 'column = "q"\n'
TIME = 'unit = "s"\n'
plain = rows_of(SOUND)
CASES = {
    "sign": Case(replace(plain, v=-plain.v), "correct its 'sign'", RATE, RATE + "sign = -1\n"),
    "unit": Case(
        replace(plain, v=np.rad2deg(plain.v)),
        "in deg/s, the angle in rad; correct its 'unit' or 'times'",
        'unit = "rad/s"', 'unit = "deg/s"'),
    "times": Case(
        replace(plain, v=60 / 2 / np.pi * plain.v),
        "correct its 'unit' or 'times'", RATE, RATE + 'times = "0.10471975512"\n'),
    "unwrap": Case(
        replace(plain, q=np.mod(4 * plain.q, 2 * np.pi), v=4 * plain.v),
        'repair = ["unwrap"]', ANGLE, ANGLE + 'repair = ["unwrap"]\n'),
    "mark gaps": Case(
        _gap(), '10 samples are missing, before row 1001; repair = ["mark gaps"]',
        TIME, TIME + 'repair = ["mark gaps"]\n', lost=tuple(range(1000, 1010))),
    "drop repeated": Case(
        _repeated(),
        'row 501, 902 is not after that of the row before; repair = ["drop repeated"]',
        TIME, TIME + 'repair = ["drop repeated"]\n'),
    "resample": Case(
        _jittered(), 'repair = ["resample"]', TIME, TIME + 'repair = ["resample"]\n', off=0.02),
    "coarse times": Case(
        replace(plain, t=np.floor(SOUND.t * 100) / 100),
        "rounded to 0.01 s, too coarse for steps of 0.001 s; give the 'sample_rate'",
        'column = "t"\nunit = "s"\n', 'sample_rate = "1000 Hz"\n'),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_is_wrong_is_refused_and_right_as_soon_as_the_mapping_says_so(
    tmp_path: Path, name: str
):
    case = CASES[name]
    text = case.rows.text()
    assert case.says in refused(tmp_path, LAYOUT, text)
    assert LAYOUT.count(case.was) == 1
    (trial,) = planned(tmp_path, LAYOUT.replace(case.was, case.now), text).trials
    recording, _ = served(trial)
    for channel in ("relative_rate", "drive_torque"):
        assert tuple(np.flatnonzero(np.isnan(recording[channel]))) == case.lost
    assert any("were lost" in event.text for event in recording.events) is bool(case.lost)
    known = np.isfinite(recording["relative_rate"])
    turns = 4.0 if name == "unwrap" else 1.0
    np.testing.assert_allclose(recording.time, SOUND.t, atol=2e-6)
    off = recording["relative_rate"] - turns * SOUND.v
    assert np.max(np.abs(off[known])) < case.off
    moved = recording["relative_angle"] - turns * SOUND.q
    assert np.ptp(moved[known]) < max(1e-8, 0.01 * case.off)


def test_a_late_channel_is_told_and_put_back(tmp_path: Path):
    """It is told and not refused: a filter of the drive is late, too."""
    late = replace(plain, v=np.concatenate([np.zeros(20), plain.v[:-20]]))
    (trial,) = planned(tmp_path, LAYOUT, late.text()).trials
    told = " ".join(event.text for event in served(trial)[0].events)
    assert "relative_rate comes 20 ms after the derivative of relative_angle" in told
    (trial,) = planned(
        tmp_path, LAYOUT.replace(RATE, RATE + 'delay = "20 ms"\n'), late.text()
    ).trials
    recording, _ = served(trial)
    assert not any("comes" in event.text for event in recording.events)
    np.testing.assert_allclose(recording["relative_rate"], SOUND.v[:-20], atol=1e-8)
    np.testing.assert_allclose(recording["relative_angle"], SOUND.q[:-20], atol=1e-8)


@pytest.mark.parametrize(("channel", "column"), [("drive_torque", "tau"), ("relative_rate", "v")])
def test_a_channel_that_is_half_a_second_late_is_refused_until_it_is_put_back(
    tmp_path: Path, channel: str, column: str
):
    motion = rig.sines(3, length=6.0)
    late = {column: np.interp(motion.t - 0.5, motion.t, getattr(motion, column))}
    text = replace(rows_of(motion), **late).text()
    told = refused(tmp_path, LAYOUT, text)
    assert re.search(rf"a\.csv: {channel} comes (0\.5 s|500 ms) after .*'delay'", told), told
    place = f'column = "{column}"\n'
    put_back = LAYOUT.replace(place, f'{place}delay = "0.5 s"\n')
    (trial,) = planned(tmp_path, put_back, text).trials
    recording, _ = served(trial)
    off = recording[channel] - getattr(motion, column)[: len(recording.time)]
    assert np.max(np.abs(off)) < 1e-6


GYRO = """\
[columns.rig.gyro_rate]
column = "v"
unit = "deg/s"
offset = 0.5
[columns.rig.pointing_error]
derive = "gyro_rate"
[columns.rig.drive_torque]"""


def test_an_integral_begins_at_zero_and_is_told_to_drift(tmp_path: Path):
    """The pointing error of a rig that records its gyro, whose offset is known, or is not."""
    rate = np.gradient(SOUND.q, STEP)
    text = replace(plain, v=np.rad2deg(rate) + 0.5).text()
    layout = re.sub(
        r"\[columns.rig.relative_rate\].*?\[columns.rig.drive_torque\]", GYRO, LAYOUT, flags=re.S
    )
    (trial,) = planned(tmp_path, layout, text).trials
    recording, _ = served(trial)
    error = recording["pointing_error"]
    # Slope and trapezoid are off a sine of 12 rad/s by its (w dt)^2 / 4 at most.
    assert np.max(np.abs(error - SOUND.q + SOUND.q[0])) < (12 * STEP) ** 2
    told = " ".join(event.text for event in recording.events)
    assert "pointing_error is the integral of gyro_rate: it is zero where the trial begins" in told
    assert recording.channels["pointing_error"].unit == "rad"
    (trial,) = planned(tmp_path, layout.replace("offset = 0.5\n", ""), text).trials
    drift = served(trial)[0]["pointing_error"] - error
    np.testing.assert_allclose(drift, np.deg2rad(0.5) * recording.time, atol=1e-6)


def test_behind_a_lost_sample_nothing_is_known_of_an_integral(tmp_path: Path):
    layout = re.sub(
        r"\[columns.rig.relative_rate\].*?\[columns.rig.drive_torque\]", GYRO, LAYOUT, flags=re.S
    )
    gaps = layout.replace(TIME, TIME + 'repair = ["mark gaps"]\n')
    (trial,) = planned(tmp_path, gaps, _gap().text()).trials
    error = served(trial)[0]["pointing_error"]
    assert np.isfinite(error[:1000]).all()
    assert np.isnan(error[1000:]).all()


def _dropped(rows: Rows) -> Rows:
    quick = int(np.argmax(np.abs(rows.v)))
    rate = rows.v.copy()
    rate[quick : quick + 5] = 0.0
    return replace(rows, v=rate)


def _clipped(rows: Rows) -> Rows:
    limit = 0.6 * min(rows.tau.max(), -rows.tau.min())
    return replace(rows, tau=np.clip(rows.tau, -limit, limit))


def _filled(rows: Rows) -> Rows:
    return replace(rows, tau=np.interp(rows.t, rows.t[::10], rows.tau[::10]))


@pytest.mark.parametrize(
    ("kind", "channel", "broken"),
    [
        ("dropout", "relative_rate", _dropped),
        ("clipping", "drive_torque", _clipped),
        ("filled", "drive_torque", _filled),
    ],
)
def test_what_nothing_can_mend_is_refused_until_it_is_accepted_and_then_told(
    tmp_path: Path, kind: str, channel: str, broken: Callable[[Rows], Rows]
):
    text = broken(plain).text()
    told = refused(tmp_path, LAYOUT, text)
    assert re.search(rf'; accept = \["{kind}"\] takes it as it is', told), told
    accepted = LAYOUT.replace(f"{channel}]\n", f'{channel}]\naccept = ["{kind}"]\n')
    (trial,) = planned(tmp_path, accepted, text).trials
    recording, _ = served(trial)
    what = told.split("a.csv: ")[-1].split(";")[0]
    assert any(what in event.text for event in recording.events)
