"""A piece that was exchanged for one of its kind, of which no bench file knows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import AxisKind, Sides
from campaign.cli.trend import _command, _exchange
from campaign.errors import UsageError
from campaign.estimate import Systematic
from campaign.experiments import experiments
from campaign.trends.members import Member, with_exchanged
from campaign.trends.rig_trends import Verdict, follow
from campaign.trends.tables import beside_the_jump
from tests.trends.test_series import CALIBRATED, TIME, judged, member, number, series


def at(n: int) -> Path:
    return Path(f"run-{n}.nxs")


def members(count: int) -> list[Member]:
    return [
        replace(member(n), run=SimpleNamespace(name=f"run-{n}", path=at(n)))  # type: ignore[arg-type]
        for n in range(1, count + 1)
    ]


def test_a_jump_within_the_error_of_another_piece_is_not_declared() -> None:
    part = (Systematic(CALIBRATED, 0.5),)
    levels = [10.0 + 0.01 * (n % 3) + (0.6 if n >= 5 else 0.0) for n in range(10)]
    found = series(*(number(each, 0.02, systematic=part) for each in levels))

    def verdict(exchanged: list[tuple[str, Path]]) -> Verdict:
        told = with_exchanged(members(10), exchanged)
        points = zip(found.points, told, strict=True)
        own = replace(found, points=tuple(replace(p, member=m) for p, m in points))
        return judged(own)[0].verdict

    assert TIME.ordered
    assert verdict([]) is Verdict.JUMPED
    assert verdict([(CALIBRATED, at(6))]) is Verdict.NOT_SHOWN
    assert verdict([(CALIBRATED, at(3))]) is Verdict.JUMPED  # elsewhere, which explains nothing


def test_each_exchange_is_told_of_its_own_run_and_kept_for_all_behind() -> None:
    told = with_exchanged(members(6), [(CALIBRATED, at(3)), (CALIBRATED, at(5))])
    assert len({each.constants[CALIBRATED] for each in told}) == 3
    assert [each.exchanged for each in told] == [(), (), (CALIBRATED,), (), (CALIBRATED,), ()]


@pytest.mark.parametrize(
    ("source", "run", "why"),
    [
        ("torque konstant", 3, "is none of torque constant"),
        (CALIBRATED, 9, "none of the runs that are followed"),
        (CALIBRATED, 1, "name the first one with the new piece"),
    ],
)
def test_what_explains_nothing_is_refused(source: str, run: int, why: str) -> None:
    with pytest.raises(UsageError, match=why):
        with_exchanged(members(6), [(source, at(run))])


@pytest.mark.parametrize("name", [CALIBRATED, "force constant"])
def test_of_a_linear_rig_it_goes_by_the_name_that_its_page_shows(name: str) -> None:
    linear = Sides(AxisKind.LINEAR, AxisKind.LINEAR)
    axis = SimpleNamespace(bench=True, sides=linear)
    runs = [replace(each, tests=(axis,)) for each in members(6)]  # type: ignore[arg-type]
    told = with_exchanged(runs, [(name, at(3))])
    assert told[2].exchanged == (CALIBRATED,)
    assert len({each.constants[CALIBRATED] for each in told}) == 2
    with pytest.raises(UsageError, match=r"is none of force constant$"):
        with_exchanged(runs, [("mass", at(3))])


def test_it_is_said_on_the_command_line_and_beside_the_jump(runs: Path) -> None:
    told = "torque constant@jump-5"
    piece = _exchange(runs, told)
    assert piece == ("torque constant", runs / "jump-5.nxs")
    for wrong in ("torque constant", "@jump-5", "torque constant@"):
        with pytest.raises(UsageError, match='write "torque constant@RUN"'):
            _exchange(runs, wrong)
    own: list[RunReader] = [open_run(runs / f"jump-{n}.nxs") for n in range(8)]
    trends = follow(own, experiments(), exchanged=[piece])
    declared = trends.declared[0]
    beside = beside_the_jump(declared, declared.jumps[0], trends)
    assert "rig torque constant from one piece to another" in beside
    assert any("torque constant" in note for note in declared.notes)  # nobody said how uncertain
    shown = _command(["a", "b", "c"], "time", (), [f"torque constant@{runs}/jump-5"])
    assert shown == "campaign trend a b c --over 'time' --exchanged 'torque constant@jump-5'"
