"""What is wrong with a calibration is said with its place; nothing is simulated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from campaign.calibration.objective import Simulation
from campaign.errors import ProtocolError, UsageError
from campaign.experiments import experiments
from campaign.experiments.interface import Stage
from campaign.protocol import load_protocol, make_plan
from campaign.trial import Most

from .laboratory import BENCH, PROTOCOL, problem, write

GAIN = '[[calibration.parameter]]\nname = "g"\npath = "compensation.static.gain"\n'


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ('"axis.inertia"', '"axis.inertai"', 'path = "', "did you mean 'axis.inertia'?"),
        ('"axis.inertia"', '"axis.name"', 'path = "', "the bench writes no number at 'axis.name'"),
        ('"axis.inertia"', '"controller.delay"', 'path = "', "only what stands in its file"),
        ('lower = "20 kg m^2"', "lower = 20", "lower = ", "20 has no unit"),
        ('"20 kg m^2"', '"20 Hz"', "lower = ", "'Hz' is not a unit of moment of inertia"),
        ('"80 kg m^2"', '"10 kg m^2"', "upper = ", "it must be greater than 'lower'"),
        ('"20 kg m^2"', '"0 kg m^2"', "lower = ", "logarithmic scale needs"),
        ('"80 kg m^2"', '"45 kg m^2"', "lower = ", "the bench's present value, 50000 g m^2"),
        ('"5 N m s/rad"', '"-5 N m s/rad"', "lower = ", "it must be at least 0"),
        ('cells = ["A.1"]', 'cells = ["A.2"]', "cells = [", "no published table is called 'A.2'"),
        ('cells = ["A.1"]', 'cells = ["A.1/7"]', "cells = [", "'A.1/7' is no cell of Table A.1"),
        ('cells = ["A.1"]', 'cells = ["A.1", "B.1"]', 'cells = ["A.1", "', "no test reproduces"),
        ('"1 %"', '"0 %"', '{ "A.1" = ', "it must be positive"),
        ('"1 %"', '"3 dB"', '{ "A.1" = ', "write it in urad or in %"),
        ('{ "A.1" = "1 %" }', '{ "B.1" = "1 %" }', "{ ", "'B.1' is none of"),
        ('name = "viscous"', 'name = "inertia"', 'name = "', "a second 'inertia'"),
        ("starts = 2", "starts = 0", "starts = ", "it must be at least 1"),
        ("starts = 2", "start = 2", "", "did you mean 'starts'?"),
        ('path = "axis.inertia"', "", "[[calibration.parameter]]", "give one of"),
        (
            'path = "friction.load.viscous_friction"',
            'paths = ["friction.load.viscous_friction", "friction.load.viscous_friction"]',
            'paths = ["friction.load.viscous_friction", "',
            "'friction.load.viscous_friction' is driven by 'viscous' already",
        ),
        (
            'path = "axis.inertia"',
            'paths = ["axis.inertia", "compensation.static.gain"]',
            'paths = ["axis.inertia", ',
            "'compensation.static.gain' is a number without a unit, 'axis.inertia' a moment",
        ),
        (
            'matrix = { frequency',
            'matrix = { "bench.axis.inertia" = ["9 kg m^2"], frequency',
            'path = "',
            "'axis.inertia' is swept by the test 'sea'",
        ),
    ],
)  # fmt: skip
def test_mistake(tmp_path: Path, old: str, new: str, place: str, message: str) -> None:
    assert PROTOCOL.count(old) >= 1
    # The last place where it stands: the tables of the calibration come last.
    before, _, after = PROTOCOL.rpartition(old)
    path = write(tmp_path, before + new + after)
    with pytest.raises(ProtocolError) as caught:
        problem(path)
    (found, *more) = caught.value.problems
    assert not more, caught.value
    assert message in found.message
    line = path.read_text().splitlines()[found.line - 1]
    if not place.startswith("["):
        assert line[: found.column - 1].endswith(place.removesuffix('"'))


def test_every_test_uses_the_bench_that_is_fitted(tmp_path: Path) -> None:
    other = '[[test]]\nname = "b"\nkind = "stabilization"\nbench = "other.toml"\n'
    path = write(tmp_path, PROTOCOL.replace("[calibration]", other + "[calibration]", 1))
    (tmp_path / "other.toml").write_text(BENCH)
    with pytest.raises(ProtocolError, match=r"calibrate\.toml:14:9: the calibration is of the"):
        problem(path)


def test_a_protocol_without_a_calibration(tmp_path: Path) -> None:
    path = write(tmp_path, PROTOCOL.partition("[calibration]")[0])
    with pytest.raises(UsageError, match=r"has no \[calibration\]"):
        problem(path)


def test_a_run_does_not_look_at_it(tmp_path: Path) -> None:
    def fingerprint(text: str) -> str:
        path = write(tmp_path, text)
        protocol = load_protocol(path, experiments(), shipped=tmp_path)
        return make_plan(protocol, seed=1).fingerprint

    assert fingerprint(PROTOCOL) == fingerprint(PROTOCOL.partition("[calibration]")[0])


def test_many_parameters_are_a_warning(tmp_path: Path) -> None:
    made = problem(write(tmp_path, PROTOCOL + GAIN + "lower = 0.1\nupper = 1\n"))
    assert made.warnings == ()
    few = PROTOCOL.replace('cells = ["A.1"]', 'cells = ["A.1/1.0", "A.1/3.0"]')
    assert "no intervals" in problem(write(tmp_path, few)).warnings[0]


def test_a_test_with_later_stages_is_refused(tmp_path: Path) -> None:
    """What follows depends on what was found, so a cell's value would jump while it is fitted."""
    found = problem(write(tmp_path, PROTOCOL))
    (test,) = found.tests
    stage = Stage("more", "", lambda options, bench: Most(1, 1.0, 1), lambda o, b, data: ())
    staged = replace(test, experiment=replace(experiments()[test.entry.kind], stages=(stage,)))
    simulation = Simulation(replace(found, tests=(staged,)), experiments(), 1)
    with pytest.raises(ProtocolError, match="executes planned trials only; leave out the more"):
        simulation.check()
