"""Units and words of a linear axis: a bench and its tests are read and told in its own."""

from __future__ import annotations

import math
import tomllib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from campaign.axis_kind import (
    _UNITS,
    BOTH_ROTARY,
    AxisKind,
    Sides,
    axis_terms,
    axis_unit,
    current_sides,
    each_in_axis_terms,
    in_axis_terms,
    is_linear,
    sides_in,
)
from campaign.backends.serial import _info
from campaign.estimate import Estimate, Systematic
from campaign.experiments import experiments
from campaign.experiments.post_processing.axis_units import in_axis_units
from campaign.experiments.shared.motion_series import kind_of
from campaign.experiments.stabilization.hull_motion import SeriesMotion, ShipMotion
from campaign.identify.tables import systematic
from campaign.options import TextFile
from campaign.physics.bench import Bench
from campaign.physics.bench_facts import facts_of
from campaign.physics.bench_knowledge import number_at
from campaign.physics.limit_watch import LimitWatch
from campaign.physics.limits import margins
from campaign.protocol.limit_check import in_display_units
from campaign.protocol.problems import find_faults
from campaign.published.scoreboard import Scoreboard
from campaign.reason import Reason
from campaign.report.content.first_screen import _answer
from campaign.report.content.references import References
from campaign.report.content.tables import remarks
from campaign.report.content.truth import _bias
from campaign.report.content.written_units import TestUnits
from campaign.resources import protocols_folder
from campaign.result import Axis, Column, Figure, Finding, Panel, Result, Table
from campaign.trial import Task
from campaign.unit_grammar import parse_unit
from campaign.units import (
    ANGLE,
    OBSERVER_GAIN,
    POSITION,
    angle_text,
    in_words,
    rate_text,
    torque_text,
)
from campaign.wire.messages import Channel

LEAD = Sides(AxisKind.LINEAR, AxisKind.ROTARY)
DIRECT = Sides(AxisKind.LINEAR, AxisKind.LINEAR)
BENCHES = protocols_folder() / "benches"


def written(name: str = "linear") -> dict[str, Any]:
    return tomllib.loads((BENCHES / f"{name}.toml").read_text(encoding="utf-8"))


def changed(path: str, value: Any, tree: dict[str, Any] | None = None) -> dict[str, Any]:
    """The linear bench with another value at a path; None takes it away."""
    tree = written() if tree is None else tree
    *above, last = path.split(".")
    table = tree
    for key in above:
        table = table.setdefault(key, {})
    if value is None:
        del table[last]
    else:
        table[last] = value
    return tree


def fault(tree: dict[str, Any]) -> tuple[str, str]:
    """The place and the text of the only thing that is wrong with a bench."""
    found = find_faults(Bench, tree)
    assert isinstance(found, list)
    ((keys, _, message),) = found
    return ".".join(map(str, keys)), message


# Benches ------------------------------------------------------------------------------------------


def test_a_linear_bench_is_read_in_its_units_and_its_motor_in_those_of_one_that_turns() -> None:
    bench = Bench.model_validate(written())
    assert bench.sides == LEAD
    assert bench.axis.inertia == 27.9
    assert bench.limits.angle == 0.15
    assert bench.limits.torque == 2000.0
    assert bench.gear.lead == pytest.approx(0.01)
    assert bench.gear.ratio == pytest.approx(2 * math.pi / 0.01)
    assert bench.motor.torque_constant == 0.5
    assert bench.friction["load"].bristle_stiffness == pytest.approx(2e6)
    assert bench.friction["screw"].stribeck_velocity == 3.0
    assert bench.sensors.resolver.resolution == pytest.approx(math.radians(0.0055))
    assert bench.sensors.encoder.resolution == pytest.approx(1e-7)
    assert bench.torque_per_current == pytest.approx(0.5 * 2 * math.pi / 0.01)


def test_its_archived_tree_reads_back_and_a_swept_lead_changes_the_ratio() -> None:
    tree = Bench.model_validate(written()).model_dump(mode="json")
    assert tree["axis"]["kind"] == "linear"
    assert Bench.model_validate(tree, context={"si": True}).model_dump(mode="json") == tree
    tree["gear"]["lead"] = "5 mm/rev"  # as a matrix puts it there
    again = Bench.model_validate(tree, context={"si": True})
    assert again.gear.ratio == pytest.approx(2 * math.pi / 0.005)


@pytest.mark.parametrize("name", ["simulink", "platform", "specimen-lugre-1995"])
def test_a_rotary_bench_is_archived_as_before_there_were_linear_ones(name: str) -> None:
    tree = Bench.model_validate(written(name)).model_dump(mode="json")
    assert "kind" not in tree["axis"]
    assert "lead" not in tree["gear"]
    assert "kind" not in Bench.model_validate(tree, context={"si": True}).axis.model_dump()


def test_a_linear_motor_needs_no_lead_and_has_linear_units() -> None:
    tree = changed("gear", {"ratio": 1.0})
    tree["motor"] |= {"torque_constant": "50 N/A", "back_emf_constant": "50 V s/m"}
    tree["sensors"]["resolver"] = {"resolution": "1 um"}
    tree["compensation"]["observer"]["gain"] = "60 N s/m"
    tree["friction"]["screw"] = dict(tree["friction"]["load"], side="motor")
    bench = Bench.model_validate(tree)
    assert bench.sides == DIRECT
    assert bench.motor.torque_constant == 50.0
    assert bench.compensation["observer"].gain == 60.0


@pytest.mark.parametrize(
    ("path", "value", "place", "message"),
    [
        (
            "limits.angle",
            "120 deg",
            "limits.angle",
            "'deg' is not a unit of position; allowed",
        ),
        ("limits.rate", "5 deg/s", "limits.rate", "; the axis of this bench is linear"),
        ("axis.inertia", "35 kg m^2", "axis.inertia", "'kg m^2' is not a unit of mass"),
        ("limits.angle", 0.15, "limits.angle", 'such as "0.15 mm"'),
        ("motor.torque_constant", "5 N/A", "motor.torque_constant", "; the motor of this bench is"),
        ("sensors.resolver.resolution", "1 um", "sensors.resolver.resolution", "motor of this"),
        ("compensation.observer.gain", "5 N s/m", "compensation.observer.gain", "N m s/m"),
        ("friction.screw.static_torque", "2 N", "friction.screw.static_torque", "unit of torque"),
        ("friction.load.static_torque", "2 N m", "friction.load.static_torque", "unit of force"),
        ("friction.screw.velocity", "load", "friction.screw", "write the same for both"),
        ("gear.lead", "10 mm", "gear.lead", "'mm' is not a unit of lead"),
        ("gear.ratio", 628.0, "gear.ratio", "'ratio' follows from 'lead'"),
        ("gear.lead", None, "gear", "'ratio' is missing"),
        ("gear.lead", "0 mm/rev", "gear.lead", "out of range; it must be greater than 0 m/rev"),
        ("axis.kind", "lineal", "axis.kind", "allowed are rotary, linear; did you mean 'linear'?"),
        ("limits.angle", None, "limits", 'a position such as "1 mm"; Largest position of the load'),
    ],
)
def test_what_is_wrong_with_a_linear_bench_is_told_in_its_terms(
    path: str, value: Any, place: str, message: str
) -> None:
    tree = changed(path, value)
    if path == "gear.lead" and value is None:  # or the motor's constants are wrong as well
        tree["motor"] |= {"torque_constant": "50 N/A", "back_emf_constant": "50 V s/m"}
        del tree["sensors"]["resolver"], tree["friction"]["screw"], tree["compensation"]["observer"]
    where, told = fault(tree)
    assert where == place
    assert message in told


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("limits.rate", "5 mm/s", "unit of angular rate; allowed are deg/s"),
        ("limits.torque", "5 N", "; the axis of this bench is rotary (axis.kind)"),
        ("motor.torque_constant", "5 N/A", "; the motor of this bench is rotary"),
        ("gear", {"lead": "10 mm/rev"}, "the axis is rotary (axis.kind)"),
    ],
)
def test_a_rotary_bench_takes_no_linear_units(path: str, value: Any, message: str) -> None:
    assert message in fault(changed(path, value, written("simulink")))[1]


def test_what_is_known_of_its_values_is_in_their_units() -> None:
    values: dict[str, Any] = {
        "axis.inertia": {"interval": ["27 kg", "29 kg"]},
        "motor.torque_constant": {"standard_uncertainty": "0.01 N m/A"},
        "friction.screw.static_torque": {"standard_uncertainty": "0.001 N m"},
    }
    bench = Bench.model_validate({**written(), "known": {"values": values}})
    assert bench.known_uncertainty("friction.screw.static_torque") == 0.001
    quantity = (number_at(bench, "limits.angle") or (0.0, None))[1]
    assert quantity is POSITION
    values["axis.inertia"] = {"standard_uncertainty": "1 kg m^2"}
    assert "unit of mass" in fault({**written(), "known": {"values": values}})[1]


# Options of tests ---------------------------------------------------------------------------------


def test_options_are_read_in_the_units_of_the_axis_that_is_meant() -> None:
    options = experiments()["step_response"].options
    with axis_terms(LEAD):
        valid = find_faults(options, {"step": "5 mm/s"})
        wrong = find_faults(options, {"step": "5 deg/s"})
    assert not isinstance(valid, list)
    assert valid.step == 0.005
    assert isinstance(wrong, list)
    assert "the axis of this bench is linear" in wrong[0][2]
    assert isinstance(find_faults(options, {"step": "5 mm/s"}), list)


def test_a_measured_motion_of_the_hull_may_be_a_travel_and_no_ship_rolls_a_carriage() -> None:
    table = {"kind": "series", "file": TextFile("a.csv", "time,value\n0,0\n9,1\n"), "value": "mm"}
    with pytest.raises(ValueError, match="no unit of a motion"):
        SeriesMotion.model_validate(table)
    with axis_terms(LEAD):
        motion = SeriesMotion.model_validate(table)
        assert (kind_of("mm"), kind_of("m/s^2")) == ("angle", "acceleration")
        with pytest.raises(ValueError, match="position: mm"):
            kind_of("deg")
        with pytest.raises(ValueError, match="the axis of this bench is linear"):
            ShipMotion.model_validate({"kind": "ship"})
    # As normalised it is read by who does not know of which axis it is.
    tree = motion.model_dump(mode="json")
    assert SeriesMotion.model_validate(tree, context={"si": True}).value == "mm"


# What is told -------------------------------------------------------------------------------------


def test_each_unit_has_one_of_the_same_size_in_SI() -> None:
    for rotary, linear in _UNITS.items():
        assert linear not in _UNITS, "telling twice must change nothing"
        own, other = dict(parse_unit(rotary).dimensions), dict(parse_unit(linear).dimensions)
        # A radian becomes a metre: what a torque has of an arm, it loses.
        arm = own.pop("rad", 0)
        lost = other.pop("m", 0) - own.pop("m", 0) - arm
        assert own == other
        assert lost in (0, -1, -2, 1, 2), rotary
        if not {"deg", "mrad", "urad"} & set(rotary.replace("/", " ").split()):
            assert parse_unit(rotary).factor == parse_unit(linear).factor


def test_numbers_in_sentences_are_converted_and_not_renamed() -> None:
    assert rate_text(0.005) == "0.286 deg/s"
    assert torque_text(3.0) == "3 N·m"
    with axis_terms(LEAD):
        assert rate_text(0.005) == "5 mm/s"
        assert angle_text(0.15, ".2g") == "1.5e+02 mm"
        assert torque_text(3.0) == "3 N"
        assert in_words(150.0, "N m s/rad") == "150 N·s/m"
        assert axis_unit("N m s/rad") == "N s/m"
        assert axis_unit("Hz") == "Hz"


@pytest.mark.parametrize(
    ("rotary", "linear"),
    [
        ("An angle and a torque", "A position and a force"),
        ("An inertia, two inertias", "A mass, two masses"),
        ("Friction torque", "Friction force"),
        ("Torque over angle", "Force over position"),
        ("raise limits.torque or peak_torque", "raise limits.torque or peak_torque"),
        ("the option `angle`", "the option `angle`"),
        ("the torque's own", "the force's own"),
        ("Of unknown size: torque constant, inertia", "Of unknown size: torque constant, mass"),
    ],
)
def test_words_of_a_linear_axis(rotary: str, linear: str) -> None:
    assert in_axis_terms(rotary) == rotary
    with axis_terms(LEAD):
        assert in_axis_terms(rotary) == linear
        assert in_axis_terms(linear) == linear


def test_a_linear_motor_has_a_force_constant() -> None:
    with axis_terms(DIRECT):
        assert in_axis_terms("torque constant") == "force constant"


def test_a_page_calls_a_source_as_its_axis_does() -> None:
    """In data it has one code for every axis."""
    found = Estimate("f", 3.0, "N", 2.0, 4.0, 0.95, systematic=(Systematic("torque constant"),))
    table = Table("t", "T", (Column("f", "F", "N"),), ({"f": found},))
    said = Result(key_numbers=(Finding.of(found, {}),))
    test = SimpleNamespace(
        name="t",
        title="T",
        kind="k",
        problem="",
        trials=(),
        failed=(),
        result=said,
        sides=DIRECT,
        experiment=None,
    )
    remark = "Not included in the intervals (size unknown): force constant."
    units = TestUnits(test)  # type: ignore[arg-type]
    answer = _answer(test, None, References({}, {}, ()), Scoreboard(), units)  # type: ignore[arg-type]
    assert answer.remarks == (remark,)
    with axis_terms(DIRECT):
        assert list(remarks(table)) == [remark]
        assert systematic(found, "N") == "force constant unknown"
        assert "; largest systematic part: force constant" in _bias(
            "f", np.array([1.0, 2.0, 3.0]), "torque constant"
        )
    assert systematic(found, "N") == "torque constant unknown"


def test_axis_terms_end_with_their_block() -> None:
    def told() -> Any:
        for _ in range(2):
            yield is_linear()

    assert [(each, is_linear()) for each in each_in_axis_terms(LEAD, told())] == [(True, False)] * 2
    assert current_sides() == BOTH_ROTARY
    assert sides_in({}) == sides_in(None) == sides_in({"axis": {"kind": "rotary"}}) == BOTH_ROTARY


def test_a_result_is_told_in_its_axis_units_and_phases_stay_angles() -> None:
    torque = Estimate("coulomb_torque", 3.0, "N m", reason=Reason("test", "torque is one reading"))
    margin = Estimate("phase_margin", 1.0, "rad", reason=Reason("test", "one"))
    columns = (
        Column("torque", "Torque", "N m", "N m"),
        Column("phase_margin", "Phase margin", "rad", "deg"),
    )
    table = Table("t", "Torques", columns, ({"torque": torque, "phase_margin": margin},))
    axes = Axis("Rate", "rad/s", "deg/s"), Axis("Phase", "rad", "deg")
    figure = Figure("f", "Torque", "The torque.", "A torque.", (Panel(*axes, ()),))
    result = Result((table,), (figure,), notes=("A torque.",))
    assert in_axis_units(result) is result
    with axis_terms(LEAD):
        told = in_axis_units(result)
    own = told.tables[0]
    assert [(c.unit, c.display, c.label) for c in own.columns] == [
        ("N", "N", "Force"),
        ("rad", "deg", "Phase margin"),
    ]
    cell = own.rows[0]["torque"]
    assert isinstance(cell, Estimate)
    assert (cell.name, cell.value, cell.unit, str(cell.reason)) == (
        *("coulomb_torque", 3.0, "N"),
        "force is one reading",
    )
    panel = told.figures[0].panels[0]
    assert (panel.x.unit, panel.x.display, panel.y.unit) == ("m/s", "mm/s", "rad")
    assert told.notes == ("A force.",)


def test_limits_margins_and_facts_are_in_its_units() -> None:
    bench = Bench.model_validate(written())
    task = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=1000.0)
    told = {each.limit: (each.called, in_display_units(each)[1]) for each in margins(bench, task)}
    assert told["angle"] == ("position", "150 mm")
    assert told["rate"] == ("rate", "300 mm/s")
    assert told["acceleration"][1] == "5000 mm/s^2"
    assert told["torque"] == ("force", "2000 N")
    assert {fact.unit for fact in facts_of(bench)} <= {"m", "m/s", "N", "A", "Hz"}
    assert any("force limit" in fact.subject for fact in facts_of(bench))


def test_a_broken_limit_is_told_in_its_units() -> None:
    import numpy as np

    bench = Bench.model_validate(written())
    watch = LimitWatch(bench.limits, 1000.0, ("relative_angle",), bench.sides)
    found = watch.look(np.arange(3) / 1000.0, np.array([[0.0, 0.1512, 0.0]]))
    assert found is not None
    assert found.text == (
        "relative_angle reached 151.2 mm at 0.001 s; the position limit is 150 mm"
    )


def test_a_controller_that_knows_of_no_linear_axes_records_in_its_units_all_the_same() -> None:
    def told(name: str, unit: str) -> tuple[str, str]:
        info = _info(Channel(name, unit, unit, "its own label"), "rate", LEAD)
        return info.unit, info.label

    assert told("relative_angle", "rad") == ("m", "Position of the load relative to the hull")
    assert told("relative_angle", "m") == ("m", "its own label")
    assert told("motor_angle", "rad") == ("rad", "its own label")
    assert told("vibration", "rad") == ("rad", "its own label")


def test_quantities_know_their_sides() -> None:
    assert ANGLE.of(BOTH_ROTARY) is ANGLE
    assert ANGLE.of(LEAD) is POSITION
    assert OBSERVER_GAIN.of(LEAD).si == "N m s/m"
    assert OBSERVER_GAIN.of(DIRECT).si == "N s/m"
