"""What of an identification goes into the file of a bench, and that the file is a bench then."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from campaign.estimate import Estimate
from campaign.identify import experiments_by_model
from campaign.identify.bench_document import bench_text, keys_by_method
from campaign.identify.identification import Identification, Section, _with_place
from campaign.identify.material import ChosenRun, choose
from campaign.parameter import IdentifiedRig, Parameter
from campaign.physics.bench import Bench
from campaign.protocol.problems import find_faults
from campaign.result import Result

HEAD = 'name = "rig"\n[axis]\nname = "tilt"\ninertia = "2 kg m^2"\n'
LUGRE = """
[friction.load]
model = "lugre"
static_torque = "20 N m"
coulomb_torque = "16 N m"
stribeck_velocity = "0.03 rad/s"
stribeck_exponent = 0.9
bristle_stiffness = "15000 N m/rad"
bristle_damping = "900 N m s/rad"

[friction.load.negative]
static_torque = "22 N m"
stribeck_exponent = 0.8
"""
SMOOTH = """
[friction.load]
model = "stribeck"
static_torque = "20 N m"
coulomb_torque = "16 N m"
stribeck_velocity = "0.03 rad/s"
sign_smoothing = "0.001 rad/s"
"""


def measured(key: str, value: float, unit: str) -> Parameter:
    one = Estimate(key, value, unit, 0.9 * value, 1.1 * value, 0.95, "test", standard_error=0.05)
    return Parameter(one, "", bench=f"friction.load.{key}")


CURVE = (
    measured("coulomb_torque", 10.0, "N m"),
    measured("static_torque", 12.0, "N m"),
    measured("stribeck_velocity", 0.02, "rad/s"),
)
STRIBECK = {"friction.load.model": ("stribeck", "", "fitted")}


def bench_of(text: str) -> Bench:
    made = find_faults(Bench, tomllib.loads(text))
    assert isinstance(made, Bench), made
    return made


@pytest.fixture
def write(results: Path):  # type: ignore[no-untyped-def]
    """The bench of a text with what sections of that name found."""
    run = next(results.glob("*-rig-mapping.nxs")).stem
    chosen = choose(results, f"{run}:monday")

    def written(text: str, **sections: IdentifiedRig) -> Bench:
        name = str(chosen.run.header.tests[0]["bench"])
        header = SimpleNamespace(tests=chosen.run.header.tests, sources={name: text})
        run = SimpleNamespace(header=header, name=chosen.run.name, identity=chosen.run.identity)
        bench = bench_of(text)
        made = tuple(
            Section(
                experiments_by_model()[which],
                None,
                result=_with_place(Result(identified=each), bench),
            )
            for which, each in sections.items()
        )
        found = Identification(
            ChosenRun(cast("Any", run), "monday", chosen.trials), None, None, bench, made
        )
        bench = bench_of(bench_text(found, "campaign identify"))
        keys = {key for each in keys_by_method(found).values() for key in each}
        told = bench.known.values.items()
        assert keys == {
            k for k, v in told if v.origin == "measured" and not k.startswith("compensation")
        }
        return bench

    return written


@pytest.mark.slow
def test_a_curve_replaces_another_whole_and_leaves_bristles(write) -> None:  # type: ignore[no-untyped-def]
    bench = write(HEAD + LUGRE, friction_map=IdentifiedRig(CURVE, settings=STRIBECK))
    load = bench.friction["load"]
    assert load.model == "lugre"
    assert load.bristle_stiffness == 15000.0
    assert (load.coulomb_torque, load.static_torque) == (10.0, 12.0)
    assert load.stribeck_exponent == 2.0  # what was fitted, not what stood there
    assert load.negative.static_torque is None


@pytest.mark.parametrize("before", ["", "friction = {}"])
def test_a_curve_is_written_whatever_form_the_table_has(write, before: str) -> None:  # type: ignore[no-untyped-def]
    """An inline table, as of a bench whose friction is not known, holds inline tables only."""
    name, axis = HEAD.split("\n", 1)
    bench = write(f"{name}\n{before}\n{axis}", friction_map=IdentifiedRig(CURVE, settings=STRIBECK))
    assert bench.friction["load"].coulomb_torque == 10.0


OPEN = {
    "friction.load.model": ("lugre", "", "fitted"),
    "friction.load.static_torque": (30.0, "N m", "the motion leaves it open"),
    "friction.load.negative.static_torque": (9.0, "N m", "the motion leaves it open"),
    "friction.load.stribeck_velocity": (0.01, "rad/s", "the motion leaves it open"),
    "friction.load.bristle_stiffness": (1e7, "N m/rad", "the motion leaves it open"),
    "friction.load.bristle_damping": (1e4, "N m s/rad", "the motion leaves it open"),
    "friction.load.viscous_friction": (2.0, "N m s/rad", "the motion leaves it open"),
}
"""What a whole model fits and does not determine."""


@pytest.mark.parametrize("before", ["", SMOOTH])
@pytest.mark.parametrize("measured", [1, 2])
def test_what_a_motion_leaves_open_makes_no_curve_of_a_bench(  # type: ignore[no-untyped-def]
    write, before: str, measured: int
) -> None:
    """Nor does static friction of one direction, or without its Stribeck velocity."""
    found = IdentifiedRig(CURVE[:measured], settings=OPEN)
    bench = write(HEAD + before, whole_model=found)
    load = bench.friction["load"]
    assert load.model == "coulomb"
    assert (load.coulomb_torque, load.viscous_friction) == (10.0, 2.0)
    assert set(bench.known.values) == {
        "friction.load.coulomb_torque",
        "friction.load.viscous_friction",
    }


def test_what_a_motion_leaves_open_stays_as_a_bench_with_bristles_has_it(write) -> None:  # type: ignore[no-untyped-def]
    bench = write(HEAD + LUGRE, whole_model=IdentifiedRig(CURVE[:2], settings=OPEN))
    load = bench.friction["load"]
    assert (load.model, load.coulomb_torque, load.viscous_friction) == ("lugre", 10.0, 2.0)
    assert (load.static_torque, load.bristle_stiffness) == (20.0, 15000.0)


def test_a_whole_curve_comes_before_a_later_one_that_is_open(write) -> None:  # type: ignore[no-untyped-def]
    bench = write(
        HEAD,
        friction_map=IdentifiedRig(CURVE, settings=STRIBECK),
        whole_model=IdentifiedRig(CURVE[:2], settings=OPEN),
    )
    assert bench.friction["load"].model == "stribeck"


def test_a_bench_gets_no_friction_of_which_nothing_is_told(write) -> None:  # type: ignore[no-untyped-def]
    inertia = replace(measured("inertia", 3.0, "kg m^2"), bench="axis.inertia")
    bench = write(HEAD, whole_model=IdentifiedRig((inertia,), settings=OPEN))
    assert bench.axis.inertia == 3.0
    assert not bench.friction


def test_directions_are_not_lost_to_one_number_and_an_offset(write) -> None:  # type: ignore[no-untyped-def]
    """Which of the two comes last does not matter."""
    coulomb = {"friction.load.model": ("coulomb", "", "fitted")}
    apart = (CURVE[0], measured("negative.coulomb_torque", 14.0, "N m"))
    one = (measured("coulomb_torque", 12.0, "N m"),)
    for each in ((apart, one), (one, apart)):
        first, last = (IdentifiedRig(found, settings=coulomb) for found in each)
        load = write(HEAD, inverse_dynamics=first, whole_model=last).friction["load"]
        assert (load.coulomb_torque, load.negative.coulomb_torque) == (10.0, 14.0)


def test_what_another_model_does_not_have_goes(write) -> None:  # type: ignore[no-untyped-def]
    settings = {
        "friction.load.model": ("lugre", "", "fitted"),
        "friction.load.bristle_stiffness": (1e4, "N m/rad", "assumed"),
    }
    bench = write(HEAD + SMOOTH, whole_model=IdentifiedRig(CURVE, settings=settings))
    assert bench.friction["load"].model == "lugre"


def test_a_number_without_a_unit_is_a_number(write) -> None:  # type: ignore[no-untyped-def]
    curve = (*CURVE, measured("stribeck_exponent", 0.7, ""))
    bench = write(HEAD + LUGRE, friction_map=IdentifiedRig(curve, settings=STRIBECK))
    assert bench.friction["load"].stribeck_exponent == 0.7
    assert bench.known.values["friction.load.stribeck_exponent"].interval == (0.63, 0.77)


def test_curves_of_two_methods_are_not_mixed(write) -> None:  # type: ignore[no-untyped-def]
    first = {**STRIBECK, "friction.load.negative.stribeck_velocity": (1e-3, "rad/s", "open")}
    bench = write(
        HEAD,
        friction_map=IdentifiedRig(CURVE, settings=first),
        inverse_dynamics=IdentifiedRig((measured("coulomb_torque", 9.0, "N m"),)),
        whole_model=IdentifiedRig(CURVE, settings=STRIBECK),
    )
    assert bench.friction["load"].coulomb_torque == 10.0
    assert bench.friction["load"].negative.stribeck_velocity is None


def test_friction_of_all_interfaces_goes_to_none(write) -> None:  # type: ignore[no-untyped-def]
    text = HEAD + LUGRE + SMOOTH.replace("friction.load", "friction.mesh")
    inertia = replace(measured("inertia", 3.0, "kg m^2"), bench="axis.inertia")
    found = IdentifiedRig((*CURVE, inertia), settings=STRIBECK)
    bench = write(text, whole_model=found)
    assert bench.friction["load"].coulomb_torque == 16.0
    assert bench.axis.inertia == 3.0
    assert "mesh" in _with_place(Result(identified=found), bench).notes[-1]


def of_appendage(*keys: str) -> IdentifiedRig:
    units = {"inertia": "kg m^2", "frequency": "Hz", "damping_ratio": ""}
    parts = (replace(measured(k, 0.3, units[k]), bench=f"appendage.{k}") for k in keys)
    inertia = replace(measured("total", 3.0, "kg m^2"), bench="axis.inertia")
    return IdentifiedRig((inertia, *parts))


def test_half_an_elastic_part_is_not_written(write) -> None:  # type: ignore[no-untyped-def]
    """A resonance alone tells no inertia, and the file would be no bench any more."""
    found = of_appendage("frequency", "damping_ratio")
    bench = write(HEAD, frequency_response=found)
    assert bench.appendage is None
    assert bench.axis.inertia == 3.0
    note = "Without appendage.inertia there is no [appendage] to write: the file gets none of it."
    assert _with_place(Result(identified=found), bench).notes[-1] == note


def test_a_whole_elastic_part_is_written(write) -> None:  # type: ignore[no-untyped-def]
    found = of_appendage("inertia", "frequency", "damping_ratio")
    assert write(HEAD, frequency_response=found).appendage.frequency == 0.3
    had = "[appendage]\ninertia = '1 kg m^2'\nfrequency = '9 Hz'\ndamping_ratio = 0.1\n"
    bench = write(HEAD + had, frequency_response=of_appendage("frequency"))
    assert (bench.appendage.frequency, bench.appendage.inertia) == (0.3, 1.0)


def test_correlations_of_other_values_stay(write) -> None:  # type: ignore[no-untyped-def]
    known = """
[known]
correlations = [["axis.inertia", "friction.load.bristle_damping", 0.5]]
[known.values]
"axis.inertia" = {origin = "fitted"}
"friction.load.bristle_damping" = {origin = "fitted"}
"""
    pair = {("coulomb_torque", "static_torque"): 0.4}
    found = IdentifiedRig(CURVE, settings=STRIBECK, correlations=pair)
    told = write(HEAD + LUGRE + known, friction_map=found).known.correlations
    assert len(told) == 2
    assert told[0] == ("axis.inertia", "friction.load.bristle_damping", 0.5)


def test_what_is_identified_stands_in_the_file_beside_the_compensation_it_is_for(write) -> None:  # type: ignore[no-untyped-def]
    """And how well it is known; identifying once more replaces it."""
    observer = '[compensation.observer]\ngain = "5 N s/m"\ninertia = "2 kg"\n'
    old = observer.replace("observer]", 'observer-identified]\nmethod = "observer"')
    inertia = replace(measured("inertia", 3.0, "kg"), bench="axis.inertia")
    head = HEAD.replace("kg m^2", "kg").replace('"tilt"', '"x"\nkind = "linear"')
    for text in (head + observer, head + observer + old):
        bench = write(text, whole_model=IdentifiedRig((inertia,)))
        assert bench.compensation["observer"].inertia == 2.0
        assert bench.compensation["observer-identified"].inertia == 3.0
        assert bench.compensation["observer-identified"].gain == 5.0
        told = bench.known.values["compensation.observer-identified.inertia"]
        assert told.interval == pytest.approx((2.7, 3.3))
