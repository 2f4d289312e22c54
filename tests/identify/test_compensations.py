"""Twins of compensations that hold what was identified, and that it is these that compensate."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import pytest
import tomlkit

from campaign.estimate import Estimate
from campaign.identify import experiments_by_model
from campaign.identify.compensations import Entries, identified_compensations, without_identified
from campaign.identify.identification import Identification, Section, _with_place
from campaign.parameter import IdentifiedRig, Parameter
from campaign.physics.bench import Bench
from campaign.reason import Reason
from campaign.result import Result
from tests.experiments.laboratory import analyse, execute, finding, trials

BENCHES = Path(__file__).parents[2] / "protocols" / "benches"
TRUE = {"coulomb_torque": 26.0, "static_torque": 33.0, "stribeck_velocity": 0.03,
        "viscous_friction": 4.0}  # fmt: skip
UNITS = {"coulomb_torque": "N m", "static_torque": "N m", "stribeck_velocity": "rad/s",
         "viscous_friction": "N m s/rad"}  # fmt: skip


def measured(name: str, value: float, unit: str, bench: str = "", half: float = 0.01) -> Parameter:
    ends = value * (1.0 - half), value * (1.0 + half)
    error = 0.5 * half * value
    return Parameter(
        Estimate(name, value, unit, *ends, 0.95, "test", standard_error=error), "", bench=bench
    )


def curve(factor: float = 1.0) -> list[Parameter]:
    """Of both directions, torques `factor` times too large."""
    return [
        measured(
            way + name,
            value * (factor if "torque" in name else 1.0),
            UNITS[name],
            f"friction.load.{way}{name}",
        )
        for way in ("", "negative.")
        for name, value in TRUE.items()
    ]


SMALL = [
    measured("stiffness_at_rest", 430e3, "N m/rad"),
    measured("bristle_damping", 1180.0, "N m s/rad"),
    measured("inertia", 70.0, "kg m^2", "axis.inertia"),
]
RAMPS = [
    measured("strongest_stiffness", 15e3, "N m/rad"),
    measured("weaker_share", 0.25, ""),
]


def text_of(name: str) -> str:
    return (BENCHES / f"{name}.toml").read_text(encoding="utf-8")


def bench_of(text: str) -> Bench:
    tree = tomllib.loads(text)
    tree.pop("schema", None)
    return Bench.model_validate(tree)


def entries(text: str, **sections: Sequence[Parameter]) -> Entries:
    bench = bench_of(text)
    made = tuple(
        Section(
            experiments_by_model()[name],
            None,
            result=_with_place(Result(identified=IdentifiedRig(tuple(own))), bench),
        )
        for name, own in sections.items()
    )
    nowhere: Any = None
    found = Identification(cast("Any", nowhere), None, None, bench, made)
    return identified_compensations(found, text)


def with_twins(text: str, **sections: Sequence[Parameter]) -> Bench:
    """The bench whose file has them."""
    tree = tomllib.loads(text)
    tree.pop("schema", None)
    for path, value in entries(text, **sections).values.items():
        *tables, key = path.split(".")
        within = tree
        for each in tables:
            within = within.setdefault(each, {})
        within[key] = value
    return Bench.model_validate(tree)


def test_the_curve_of_all_interfaces_goes_to_what_compensates_them() -> None:
    bench = with_twins(text_of("platform"), friction_map=curve())
    stated, twin = (bench.compensation[name] for name in ("static", "static-identified"))
    assert twin.gain == stated.gain  # what was not identified is as it was
    load = twin.friction["load"]
    assert load.sign_smoothing == stated.friction["load"].sign_smoothing
    assert (load.coulomb_torque, load.negative.static_torque) == (26.0, 33.0)
    assert load.stribeck_exponent == 2.0
    assert bench.friction["load"].coulomb_torque == 16.12  # the bench's own interface gets none


def test_bristles_that_slip_one_after_the_other_are_two() -> None:
    found = {"friction_map": curve(), "presliding": SMALL, "ramps": RAMPS}
    friction = with_twins(text_of("platform"), **found).compensation["lugre-identified"].friction
    load, weaker = friction["load"], friction["weaker"]
    assert load.coulomb_torque + weaker.coulomb_torque == pytest.approx(26.0)
    assert weaker.negative.static_torque == pytest.approx(0.25 * 33.0)
    assert load.bristle_stiffness + weaker.bristle_stiffness == pytest.approx(430e3)
    assert load.bristle_stiffness == 15e3
    assert (load.bristle_damping, weaker.bristle_damping) == (1180.0, 0.0)
    assert load.viscous_friction == 4.0  # once, not twice
    assert weaker.viscous_friction == 0.0


def test_the_sum_of_several_interfaces_goes_to_no_single_bristle() -> None:
    """Nobody knows, without a ramp, whether they yield at one time."""
    found = entries(text_of("platform"), friction_map=curve(), presliding=SMALL)
    assert "compensation.lugre-identified.friction.load.bristle_damping" in found.values
    own = found.values["compensation.lugre-identified.friction.load.bristle_stiffness"]
    assert own == "15284 N m/rad"  # as it was stated


def test_the_observer_gets_the_inertia_and_its_interval() -> None:
    found = entries(text_of("platform"), presliding=SMALL)
    assert found.values["compensation.observer-identified.inertia"] == "70 kg m^2"
    told = found.known["compensation.observer-identified.inertia"]
    assert told == {"interval": ["69.3 kg m^2", "70.7 kg m^2"], "origin": "measured"}


def test_a_curve_of_one_direction_goes_nowhere() -> None:
    assert entries(text_of("platform"), friction_map=curve()[:4]).values == {}


def test_a_number_without_an_interval_goes_nowhere() -> None:
    alone = Parameter(
        Estimate.without_interval("inertia", 70.0, "kg m^2", Reason("test", "why")),
        "",
        bench="axis.inertia",
    )
    assert entries(text_of("platform"), presliding=[alone]).values == {}


def test_twins_of_before_are_taken_out() -> None:
    text = text_of("platform-identified")
    left = without_identified(text)
    assert "-identified." not in left.replace("platform-identified.", "")
    bench = bench_of(left)
    assert set(bench.compensation) == {"static", "lugre", "observer"}
    assert not [path for path in bench.known.values if "-identified" in path]
    assert without_identified(left) == left


def test_what_is_identified_is_what_compensates() -> None:
    """With torques 30 % too large the twin leaves far more than the compensation beside it."""
    document = tomlkit.parse(text_of("simulink"))
    tables: Any = document
    del tables["friction"]["motor"], tables["compensation"]["lugre"]["friction"]["motor"]
    bench = with_twins(document.as_string(), friction_map=curve(1.3))
    names = [{"compensation": name} for name in ("lugre", "lugre-identified")]
    result = analyse("stabilization", execute(trials("stabilization", bench, {"cycles": 1}, names)))
    stated, twin = (finding(result, "stabilization_error", **name).value for name in names)
    assert twin > 5.0 * stated
