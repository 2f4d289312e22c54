"""Recorded motions: friction of their steady stretches, and what is said where it does not follow.

Recordings are made here from a rigid axis with known friction, and reach the analysis by import.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import campaign
from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode
from campaign.estimation.gate import TOO_WIDE
from campaign.estimation.inverse.terms import DIRECTIONAL
from campaign.experiments.analysis import measured, result_of
from campaign.experiments.any_motion.inverse_result import (
    ADVICE,
    NO_SLOPE,
    InverseDynamicsOptions,
    identify,
)
from campaign.experiments.interface import TestData
from campaign.experiments.motion.experiment import EXPERIMENT
from campaign.result import Result
from tests.experiments.asked import asked
from tests.experiments.test_every_number import lacking

RATE = 200.0


def strokes(speeds: list[float], cruise: float = 1.5, rest: float = 0.3) -> np.ndarray:
    """Rate of trapezoidal moves (rad/s), shape (n,)."""
    parts = []
    for speed in speeds:
        up = np.linspace(0.0, speed, round(0.2 * RATE), endpoint=False)
        hold = np.full(round(cruise * RATE), speed)
        parts += [np.zeros(round(rest * RATE)), up, hold, up[::-1]]
    return np.concatenate(parts)


EVERY = [s * v for v in (0.2, 0.8, 0.4, 0.6, 0.3) for s in (1.0, -1.0)]


def recorded(
    folder: Path,
    rate: np.ndarray,
    torque: np.ndarray,
    *,
    kind: str = "rotary",
    columns: str = "",
    options: str = "",
    entry: str = "",
    extra: dict[str, np.ndarray] | None = None,
) -> Any:
    """A run of one recording; `columns`, `options` and `entry` are further lines of the mapping."""
    extra = extra or {}
    time = np.arange(len(rate)) / RATE
    table = np.column_stack([time, np.cumsum(rate) / RATE, rate, torque, *extra.values()])
    heading = ",".join(["t", "q", "v", "m", *extra])
    np.savetxt(folder / "a.csv", table, delimiter=",", header=heading, comments="", fmt="%.9g")
    unit, force = ("rad", "N m") if kind == "rotary" else ("m", "N")
    (folder / "rig.toml").write_text(
        f'schema = 3\nname = "rig"\n[axis]\nname = "axis"\nkind = "{kind}"\n'
    )
    (folder / "m.toml").write_text(
        f"""
schema = 2
published = "none"
[columns.c.time]
column = "t"
unit = "s"
[columns.c.relative_angle]
column = "q"
unit = "{unit}"
[columns.c.relative_rate]
column = "v"
unit = "{unit}/s"
[columns.c.drive_torque]
column = "m"
unit = "{force}"
{columns}
[[test]]
name = "any"
kind = "motion"
bench = "./rig.toml"
{options}
[[test.recording]]
file = "a.csv"
{entry}
"""
    )
    code = import_recordings([str(folder / "m.toml")], folder / "r")
    assert code is ExitCode.DONE
    return campaign.open(next((folder / "r").glob("*.nxs")))


def found(run: Any, quantity: str, direction: str = "") -> Any:
    table = run.results.findings
    rows = table[table.quantity == quantity]
    rows = rows[rows.direction == direction] if direction else rows
    return rows.iloc[0]


def result(run: Any) -> Result:
    data = TestData("any", "motion", run.archive.trials[0].trial.options, tuple(run.archive.trials))
    return result_of(EXPERIMENT, data)


def notes(run: Any) -> str:
    return " ".join(result(run).notes)


def friction(rate: np.ndarray, coulomb: float = 2.0, viscous: float = 0.5, noise: float = 0.02):
    rng = np.random.default_rng(8)
    return coulomb * np.sign(rate) + viscous * rate + noise * rng.normal(size=len(rate))


def test_friction_of_both_directions(tmp_path: Path):
    rate = strokes(EVERY * 2)
    run = recorded(tmp_path, rate, friction(rate))
    for direction in ("positive", "negative"):
        for quantity, true in (("coulomb_torque", 2.0), ("viscous_friction", 0.5)):
            row = found(run, quantity, direction)
            assert row.low <= true <= row.high
            assert row.high - row.low < 0.1
    # Of an axis whose inertia nobody knows it is said that it is in no interval.
    assert "inertia" in str(found(run, "coulomb_torque", "positive").systematic)


def test_slow_motions_tell_no_coulomb_friction_by_regression(tmp_path: Path):
    """Rates within a Stribeck curve: friction hardly changes over them, and is that of breakaway.

    The truth is 2 N m of Coulomb and 3 N m of static friction; a line finds 3 N m.
    """
    rate = strokes([s * v for v in (0.018, 0.02, 0.022) * 4 for s in (1.0, -1.0)])
    static = np.sign(rate) * np.exp(-((rate / 0.3) ** 2))
    trials = tuple(recorded(tmp_path, rate, static + friction(rate)).archive.trials)
    plain = InverseDynamicsOptions(terms=DIRECTIONAL)
    identified = identify(TestData("any", "inverse_dynamics", {}, trials), plain).identified
    told = {each.estimate.name: each for each in identified.parameters}
    for way in ("positive", "negative"):
        one = told[f"coulomb_{way}"]
        assert one.estimate.reason in NO_SLOPE
        assert one.estimate.value == pytest.approx(3.0, abs=0.1)
        assert one.estimate.combined[0] > 2.0  # measured, it would be wrong
        assert ADVICE["viscous"] in one.advice


def test_a_load_that_drives_the_axis_costs_no_direction(tmp_path: Path):
    """Gravity of 4 N m: the drive holds back on the way down, and still friction is there."""
    rate = strokes(EVERY * 2)
    run = recorded(tmp_path, rate, friction(rate) + 4.0)
    row = found(run, "constant_torque")
    assert row.low <= 4.0 <= row.high
    assert {"positive", "negative"} <= set(run.results.findings.direction)
    assert "Gravity or an offset" in notes(run)


def test_drift_that_goes_with_speed_is_told(tmp_path: Path):
    rate = strokes(sorted(EVERY, key=abs))
    assert "changes with time" in notes(recorded(tmp_path, rate, friction(rate)))


@pytest.mark.slow
def test_all_stretches_of_a_long_recording_are_in_its_friction(tmp_path: Path):
    """Friction doubles half way: the mean of 500 strokes is that of all of them."""
    rate = strokes([0.3, -0.3] * 250, cruise=0.5, rest=0.1)
    torque = np.where(np.arange(len(rate)) < len(rate) / 2, 1.0, 2.0) * friction(rate, viscous=0.0)
    run = recorded(tmp_path, rate, torque)
    assert found(run, "friction_torque", "positive").value == pytest.approx(3.0, abs=0.05)
    table = next(t for t in result(run).tables if t.key.startswith("steady"))
    assert len(table.rows) == 500


def test_strokes_that_are_alike_have_wider_intervals(tmp_path: Path):
    """Running-in: each stroke is like the one before it."""
    rng = np.random.default_rng(3)
    rate = strokes([0.3, -0.3] * 40, cruise=0.5, rest=0.1)
    level = np.zeros(80)
    for k in range(1, 80):
        level[k] = 0.9 * level[k - 1] + 0.1 * rng.normal()
    each = np.repeat(level, len(rate) // 80)
    run = recorded(tmp_path, rate, (2.0 + each) * np.sign(rate))
    row = found(run, "friction_torque", "positive")
    plain = 2 * np.std(level[::2]) / np.sqrt(40)
    assert row.high - row.low > 3 * plain
    assert row.low <= 2.0 <= row.high


def test_windows_that_are_named_are_used(tmp_path: Path):
    rate = strokes(EVERY)
    entry = 'windows = { one = ["0.6 s", "1.6 s"], two = ["2.8 s", "3.8 s"] }'
    run = recorded(tmp_path, rate, friction(rate), entry=entry)
    table = next(t for t in result(run).tables if t.key.startswith("steady"))
    assert [round(row["first"], 2) for row in table.rows] == [0.6, 2.8]


def shifting(rate: np.ndarray) -> np.ndarray:
    """Friction with a torque of 3 N m once a turn, as of gravity."""
    return friction(rate) + 3.0 * np.sin(np.cumsum(rate) / RATE)


WIDE = [s * v for v in (0.5, 2.0, 1.0, 1.5, 0.7) for s in (1.0, -1.0)]


def test_gravity_is_not_taken_for_friction(tmp_path: Path):
    """Strokes of up to half a turn, by which a line through torques would be off by a tenth."""
    rate = strokes(WIDE * 2)
    run = recorded(tmp_path, rate, shifting(rate))
    for direction in ("positive", "negative"):
        for quantity, true in (("coulomb_torque", 2.0), ("viscous_friction", 0.5)):
            assert found(run, quantity, direction).value == pytest.approx(true, abs=0.04)
    assert "as gravity does" in notes(run)
    # A torque that was taken off too much, or too little, is a constant one.
    assert "angle" in str(found(run, "constant_torque").systematic)


def test_of_many_speeds_there_is_a_stribeck_curve(tmp_path: Path):
    rate = strokes([s * v for v in np.geomspace(0.02, 1.0, 12) for s in (1.0, -1.0)])
    bend = 0.8 * np.sign(rate) * np.exp(-((rate / 0.06) ** 2))
    run = recorded(tmp_path, rate, friction(rate) + bend)
    for quantity, true in (("coulomb_torque", 2.0), ("static_torque", 2.8)):
        row = found(run, quantity, "negative")
        assert row.low <= true <= row.high
        assert row.high - row.low < 0.1


def test_a_slope_of_one_stretch_too_many_is_not_determined(tmp_path: Path):
    """Known neither against itself nor against the torque; it is drawn all the same."""
    levels = {0.1: 20.0, 0.3: 24.0, 0.6: 15.0, 1.0: 21.0}
    each = [strokes([speed]) for speed in levels]
    rate = np.concatenate(each)
    level = np.concatenate(
        [np.full(len(own), levels[v]) for own, v in zip(each, levels, strict=True)]
    )
    noise = 0.02 * np.random.default_rng(8).normal(size=len(rate))
    run = recorded(tmp_path, rate, level * np.sign(rate) + noise)
    (told,) = (f.known for f in result(run).findings if f.quantity == "viscous_friction")
    assert told.reason in TOO_WIDE
    (figure,) = (f for f in result(run).figures if f.key == "friction")
    assert len(figure.panels[0].curves) == 2


MEANS = {"friction": "friction_torque"}
"""What a report calls a parameter."""
LOADS = np.random.default_rng(4)


@pytest.mark.parametrize("case", ["line", "mean", "curve", "gravity", "windows", "loads"])
def test_a_report_and_an_identification_agree(tmp_path: Path, case: str):
    speeds = {"mean": [0.3, -0.3] * 6, "gravity": WIDE * 2}.get(case, EVERY * 2)
    if case == "curve":
        speeds = [s * v for v in np.geomspace(0.02, 1.0, 12) for s in (1.0, -1.0)]
    rate, more = strokes(speeds), {}
    torque = shifting(rate) if case == "gravity" else friction(rate)
    if case == "windows":
        ends = {"one": 0.6, "two": 2.8, "three": 5.0, "four": 7.2, "five": 9.4, "six": 11.6}
        own = ", ".join(f'{name} = ["{at:g} s", "{at + 1:g} s"]' for name, at in ends.items())
        more = {"entry": f"windows = {{ {own} }}"}
    if case == "loads":
        load = 10.0 + 0.05 * LOADS.normal(size=len(rate))
        more = {"kind": "linear", "columns": LOADED, "extra": {"n": load}}
    run = recorded(tmp_path, rate, torque, **more)
    told = {
        f"{each.quantity}_{each.conditions['direction']}": each.known
        for each in result(run).findings
        if "direction" in each.conditions
    }
    identified = asked("friction_map", run.archive.trials).identified.parameters
    assert len(identified) == len(told)
    for each in identified:
        name, _, way = each.estimate.name.rpartition("_")
        reported = told[f"{MEANS.get(name, name)}_{way}"]
        assert replace(each.estimate, name=reported.name) == reported


def test_lost_samples_cost_no_stretch(tmp_path: Path):
    rate = strokes(EVERY * 2)
    torque = friction(rate)
    torque[::37] = np.nan
    run = recorded(tmp_path, rate, torque)
    row = found(run, "coulomb_torque", "positive")
    assert row.low <= 2.0 <= row.high


LOADED = '[columns.c.normal_load]\ncolumn = "n"\nunit = "N"\n'


def test_friction_over_normal_load_of_a_linear_axis(tmp_path: Path):
    rng = np.random.default_rng(4)
    rate = strokes([0.05, -0.05] * 6)
    load = 10.0 + 0.05 * rng.normal(size=len(rate))
    torque = 0.12 * load * np.sign(rate) + 0.001 * rng.normal(size=len(rate))
    columns = LOADED + 'times = "1 N/N"\nuncertainty = "0.1 N/N"\n'
    run = recorded(tmp_path, rate, torque, kind="linear", columns=columns, extra={"n": load})
    row = found(run, "friction_coefficient")
    assert row.value == pytest.approx(0.12, rel=0.01)
    # Of both directions it is positive where friction acts against the motion.
    table = next(t for t in result(run).tables if t.key.startswith("steady"))
    assert all(row["coefficient"].value == pytest.approx(0.12, rel=0.02) for row in table.rows)
    # A load that is known to 10 % makes a coefficient that is no better known.
    assert row.high - row.low > 2 * 0.15 * 0.12


def test_friction_over_normal_load_needs_a_radius_where_the_axis_turns(tmp_path: Path):
    rate = strokes([0.3, -0.3] * 6)
    load = np.full(len(rate), 10.0) + 0.01 * np.sin(np.arange(len(rate)))
    torque = 0.12 * 0.03 * load * np.sign(rate)
    torque = torque + 1e-5 * np.random.default_rng(1).normal(size=len(rate))
    (tmp_path / "without").mkdir()
    (tmp_path / "with").mkdir()
    run = recorded(tmp_path / "without", rate, torque, columns=LOADED, extra={"n": load})
    assert "friction_coefficient" not in set(run.results.findings.quantity)
    assert "`radius`" in notes(run)
    run = recorded(
        tmp_path / "with",
        rate,
        torque,
        columns=LOADED,
        options='radius = "30 mm"',
        extra={"n": load},
    )
    assert found(run, "friction_coefficient").value == pytest.approx(0.12, rel=0.01)


def test_every_number_has_an_interval_or_says_why_not(tmp_path: Path):
    rate = strokes([*EVERY, 0.2, -0.2])
    load = 10.0 + 0.05 * np.random.default_rng(4).normal(size=len(rate))
    reference = np.cumsum(rate) / RATE
    columns = LOADED + '[columns.c.reference]\ncolumn = "r"\nunit = "m"\n'
    extra = {"n": load, "r": reference}
    run = recorded(tmp_path, rate, friction(rate), kind="linear", columns=columns, extra=extra)
    told = result(run)
    assert not lacking(told)
    assert {"recordings", "friction-lines", "steady-stretches"} <= {t.key for t in told.tables}
    titles = [panel.title for figure in told.figures for panel in figure.panels]
    for title in ("Reference less position", "Normal load", "Friction over normal load"):
        assert title in titles


def test_one_stretch_is_one_in_captions(tmp_path: Path):
    rate = strokes([0.2])
    told = result(recorded(tmp_path, rate, friction(rate)))
    captions = " ".join(figure.caption for figure in told.figures)
    assert captions.count("1 steady stretch") == 2
    assert "stretches" not in captions


def test_what_is_not_recorded_is_left_out(tmp_path: Path):
    """Only a rate and a torque: no position, no tracking error, no load, and nothing fails."""
    rate = strokes(EVERY * 2)
    run = recorded(tmp_path, rate, friction(rate))
    trial = run.archive.trials[0].trial
    assert trial.can_use == ("relative_angle",)
    assert not lacking(result(run))


def test_of_a_recording_that_is_too_long_no_sample_is_read(tmp_path: Path):
    rate = strokes(EVERY)
    run = recorded(tmp_path, rate, friction(rate))
    (archived,) = run.archive.trials
    task = archived.trial.task.model_copy(update={"duration": 1e9})

    class Unread:
        trial = archived.trial.model_copy(update={"task": task})
        ending, estimates, not_kept = archived.ending, (), ""

        def recording(self):
            raise AssertionError("its samples were read")

        def channel_names(self):
            return archived.channel_names()

    with pytest.raises(ValueError, match="are looked at in one"):
        measured(EXPERIMENT, Unread())
    told = result_of(EXPERIMENT, TestData("any", "motion", {}, (Unread(),)))
    assert "cut it by start and stop" in " ".join(told.notes)
    assert not told.figures
