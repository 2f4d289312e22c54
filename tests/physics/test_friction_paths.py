"""Scatter and preload by path: what a path reaches, and that one which reaches nothing is refused.

`Grease` is a friction model that the program does not know, as an installed package may bring one.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field, ValidationError

from campaign.physics.bench import Bench
from campaign.physics.friction.interface import FrictionModel, FrictionOptions
from campaign.physics.steady_friction import steady_friction
from campaign.physics.variation import as_it_is, of_its_day
from campaign.testing import known
from campaign.units import RotationalDamping, Torque
from tests.physics.benches import RATIO, Tree, bench, stribeck

LUGRE = (
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "stribeck_exponent",
    "viscous_friction",
    "bristle_stiffness",
    "bristle_damping",
)
"""What may change of it; the first five of static friction, too."""


PLAIN = bench()


class GreaseOptions(FrictionOptions):
    """A film with a yield torque."""

    model: Literal["grease"]
    """Grease."""
    yield_torque: Torque = Field(gt=0)
    """Below which nothing moves."""
    film_damping: RotationalDamping = Field(default=1.0, ge=0)
    """Of the film."""
    seal_torque: Torque | None = None
    """Of a seal, if there is one."""
    order: float = 1.0
    """Without a unit: a matter of numerics."""


GREASE = FrictionModel(
    name="grease",
    summary="made up",
    options=GreaseOptions,
    parameters=lambda options: np.array([options.yield_torque]),
    state_size=lambda options, step: 0,
    step=lambda parameters, state, motion: (0.0, 0.0),
    viscous=lambda options: options.film_damping,
    steady_state=lambda options, v: options.yield_torque * np.sign(v) + options.film_damping * v,
)


@pytest.fixture
def greased() -> Iterator[Any]:
    """Makes a bench with LuGre friction on the load and grease in the mesh."""

    def make(**changes: Any) -> Bench:
        tree = bench().model_dump(mode="json")
        tree["friction"] = {
            "load": tree["friction"]["load"],
            "mesh": {"model": "grease", "yield_torque": 8.0},
        }
        tree["gear"]["preload"] = changes.pop("preload", None)
        tree["friction"]["load"] |= changes.pop("load", {})
        return Bench.model_validate({**tree, **changes}, context={"si": True})

    with known(GREASE):
        yield make


def scattering(table: Tree, day: int = 1, seed: int = 5, **rest: Tree) -> Bench:
    def edit(tree: Tree) -> None:
        tree["variation"] = {"seed": seed, "day": day, "day_to_day": table, **rest}

    return bench(edit)


def factor(changed: Bench, path: str) -> float:
    interface, parameter = path.split(".")
    now = getattr(changed.friction[interface], parameter)
    return float(now / getattr(PLAIN.friction[interface], parameter))


def refusal(variation: Tree | None = None, shares: Tree | None = None) -> tuple[str, str]:
    """Where the only error is, its keys joined by slashes, and its message."""

    def edit(tree: Tree) -> None:
        tree["friction"]["motor"] = stribeck(0.04, 0.03, side="motor")
        tree["variation"] = variation
        if shares is not None:
            tree["gear"]["preload"] = {"torque": "50 N m", "nominal": "33 N m", "shares": shares}

    with pytest.raises(ValidationError) as caught:
        bench(edit)
    [error] = caught.value.errors()
    return "/".join(str(key) for key in error["loc"]), error["msg"]


@pytest.mark.parametrize(
    "parameter", ["stribeck_exponent", "bristle_damping", "coulomb_torque", "bristle_stiffness"]
)
def test_what_scatters_is_what_the_path_says_and_nothing_else(parameter: str) -> None:
    draws = []
    on = scattering({parameter: 0.04})
    for day in range(1, 201):
        today = on.variation.model_copy(update={"day": day})
        changed = of_its_day(on.model_copy(update={"variation": today}))
        draws.append(factor(changed, f"load.{parameter}"))
        assert factor(changed, f"motor.{parameter}") == pytest.approx(draws[-1])  # all interfaces
        others = {f"load.{name}" for name in LUGRE} - {f"load.{parameter}"}
        assert {factor(changed, path) for path in others} == {1.0}
    # 200 draws: four standard errors of the mean and of the deviation.
    assert abs(np.mean(draws) - 1.0) < 4 * 0.04 / np.sqrt(200)
    assert np.std(draws) == pytest.approx(0.04, rel=4 / np.sqrt(400))


def test_an_exponent_that_scatters_bends_the_curve() -> None:
    """s(v) at the Stribeck velocity is Tc + (Ts - Tc)/e whatever the exponent, elsewhere not."""
    plain, changed = bench(), scattering({"load.stribeck_exponent": 0.2})
    at, beside = np.array([0.03]), np.array([0.015])
    assert steady_friction(changed, at)[0] == pytest.approx(steady_friction(plain, at)[0])
    exponent = of_its_day(changed).friction["load"].stribeck_exponent
    difference = steady_friction(changed, beside)[0] - steady_friction(plain, beside)[0]
    assert difference == pytest.approx(6.0 * (np.exp(-(0.5**exponent)) - np.exp(-0.25)))
    assert abs(difference[0]) > 1e-3


def test_one_interface_alone() -> None:
    for table in ({"load.coulomb_torque": 0.02}, {"load": {"coulomb_torque": 0.02}}):
        changed = of_its_day(scattering(table))
        assert factor(changed, "load.coulomb_torque") != 1.0
        assert factor(changed, "motor.coulomb_torque") == 1.0
    both = of_its_day(scattering({"load.coulomb_torque": 0.02, "motor.coulomb_torque": 0.02}))
    assert factor(both, "load.coulomb_torque") == factor(changed, "load.coulomb_torque")
    assert factor(both, "motor.coulomb_torque") not in (1.0, factor(both, "load.coulomb_torque"))


def test_every_line_acts_by_a_draw_of_its_own() -> None:
    common = of_its_day(scattering({"coulomb_torque": 0.02}))
    own = of_its_day(scattering({"load.coulomb_torque": 0.05}))
    both = of_its_day(scattering({"load.coulomb_torque": 0.05, "coulomb_torque": 0.02}))
    product = factor(common, "load.coulomb_torque") * factor(own, "load.coulomb_torque")
    assert factor(both, "load.coulomb_torque") == pytest.approx(product)
    assert factor(both, "motor.coulomb_torque") == factor(common, "motor.coulomb_torque")


def test_a_common_draw_is_one_draw_and_its_trials_are_not_its_days() -> None:
    joint = {"paths": ["load.bristle_damping", "motor.static_torque"], "relative": 0.1}
    on = scattering({"wear": joint}, trial_to_trial={"wear": joint, "stribeck_exponent": 0.1})
    day, trial, other = of_its_day(on), as_it_is(on, 1), as_it_is(on, 2)
    for one in (day, trial):
        damping = factor(one, "load.bristle_damping")
        assert factor(one, "motor.static_torque") == pytest.approx(damping)
        assert factor(one, "motor.bristle_damping") == factor(one, "load.static_torque") == 1.0
    drawn = {
        factor(each, "load.bristle_damping") / factor(day, "load.bristle_damping")
        for each in (trial, other)
    } | {factor(day, "load.bristle_damping"), factor(trial, "load.stribeck_exponent")}
    assert len(drawn) == 4
    assert 1.0 not in drawn
    assert as_it_is(on, 1) == trial


def test_a_trials_draw_is_not_that_of_the_day_of_its_number() -> None:
    table = {"bristle_damping": 0.1}
    day = of_its_day(scattering(table, day=7))
    trial = as_it_is(scattering({}, trial_to_trial=table), 7)
    assert factor(day, "load.bristle_damping") != factor(trial, "load.bristle_damping")


def test_a_model_without_the_parameter_is_passed_over_when_another_has_it() -> None:
    def edit(tree: Tree) -> None:
        tree["friction"]["motor"] = stribeck(0.04, 0.03, side="motor")
        tree["variation"] = {"day": 1, "day_to_day": {"bristle_stiffness": 0.1}}

    assert factor(of_its_day(bench(edit)), "load.bristle_stiffness") != 1.0


@pytest.mark.parametrize(
    ("variation", "shares", "where", "message"),
    [  # what a protocol's file can say wrong is in tests/protocol/test_errors.py
        (
            {"day_to_day": {"motor": {"bristle_damping": 0.01}}},  # declared by another model
            None,
            "variation/day_to_day/motor/interface/bristle_damping",
            f"'bristle_damping' that can change; allowed are {', '.join(LUGRE[:5])}",
        ),
        (None, {"load": {"gain": 0.1}}, "gear/preload/shares/load/interface/gain", "no parameter"),
        (None, {"laod.static_torque": 1.0}, "gear/preload/shares/laod.static_torque", "'load'?"),
    ],
)
def test_a_path_that_leads_nowhere_is_refused(
    variation: Tree | None, shares: Tree | None, where: str, message: str
) -> None:
    found, text = refusal(variation, shares)
    assert found == where
    assert message in text


def test_a_share_of_an_interface_that_is_spared_is_refused() -> None:
    def edit(tree: Tree) -> None:
        tree["friction"]["load"]["preloaded"] = False
        tree["gear"]["preload"] = {
            "torque": "50 N m",
            "nominal": "33 N m",
            "shares": {"load.static_torque": 1.0},
        }

    with pytest.raises(ValidationError, match=r"friction\.load is not preloaded; allowed are mot"):
        bench(edit)


def test_a_share_names_one_interface_and_the_axis_gains_it_there() -> None:
    def edit(tree: Tree) -> None:
        tree["gear"]["preload"] = {
            "torque": "50 N m",
            "nominal": "33 N m",
            "shares": {"motor": {"static_torque": 0.5}, "load.coulomb_torque": 0.25},
        }

    now, was = as_it_is(bench(edit), 1).friction, bench().friction
    gain = RATIO * (now["motor"].static_torque - was["motor"].static_torque)
    assert gain == pytest.approx(0.5 * 17.0)
    assert now["load"].coulomb_torque - was["load"].coulomb_torque == pytest.approx(0.25 * 17.0)
    assert now["load"].static_torque == was["load"].static_torque
    assert now["motor"].coulomb_torque == was["motor"].coulomb_torque


def test_scatter_on_the_parameter_of_a_made_up_model(greased: Any) -> None:
    table = {"mesh.yield_torque": 0.1, "film_damping": 0.05}
    changed = of_its_day(greased(variation={"day": 3, "day_to_day": table})).friction["mesh"]
    assert changed.yield_torque != 8.0
    assert changed.film_damping != 1.0
    assert changed.order == 1.0


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("mesh.order", "allowed are yield_torque, film_damping"),  # it has no unit
        ("mesh.preloaded", "allowed are yield_torque, film_damping"),
        ("mesh.seal_torque", "allowed are yield_torque, film_damping"),  # there is no seal
        ("mesh.coulomb_torque", "friction.mesh has no parameter 'coulomb_torque'"),
        ("load.yield_torque", "friction.load has no parameter 'yield_torque'"),
    ],
)
def test_what_a_made_up_model_does_not_declare_is_refused(
    greased: Any, path: str, message: str
) -> None:
    with pytest.raises(ValidationError) as caught:
        greased(variation={"day_to_day": {path: 0.1}})
    assert message in str(caught.value)


def test_a_model_may_declare_what_it_likes(greased: Any) -> None:
    with known(dataclasses.replace(GREASE, changeable=("order",))):
        on = greased(variation={"day": 1, "day_to_day": {"mesh.order": 0.1}})
        assert of_its_day(on).friction["mesh"].order != 1.0
        with pytest.raises(ValidationError, match="allowed are order"):
            greased(variation={"day_to_day": {"mesh.yield_torque": 0.1}})


def test_a_preload_raises_a_torque_that_a_made_up_model_declares(greased: Any) -> None:
    preload = {"torque": 50.0, "nominal": 33.0}
    on = greased(preload={**preload, "shares": {"yield_torque": 1.0}})
    now = as_it_is(on, 1).friction
    assert now["mesh"].yield_torque == pytest.approx(8.0 + 17.0)
    assert now["load"].static_torque == 32.0
    with pytest.raises(ValidationError, match="no parameter 'film_damping' that is a torque"):
        greased(preload={**preload, "shares": {"mesh": {"film_damping": 1.0}}})
    with pytest.raises(ValidationError, match=r"shares\.static_torque\n +no friction interface"):
        greased(preload=preload, load={"preloaded": False})


def test_interfaces_without_a_static_torque_gain_as_they_hold(greased: Any) -> None:
    """By friction of the slowest sliding: 8 and 24 N m share 17 N m as 1 to 3."""
    film = {"model": "grease", "yield_torque": 24.0}
    preload = {"torque": 50.0, "nominal": 33.0, "shares": {"yield_torque": 1.0}}
    friction = {"mesh": {"model": "grease", "yield_torque": 8.0}, "seal": film}
    now = as_it_is(greased(preload=preload, friction=friction), 1).friction
    assert now["mesh"].yield_torque == pytest.approx(8.0 + 17.0 / 4, rel=1e-6)
    assert now["seal"].yield_torque == pytest.approx(24.0 + 17.0 * 3 / 4, rel=1e-6)


def test_a_bench_with_less_friction_keeps_what_is_said_of_the_rest() -> None:
    def edit(tree: Tree) -> None:
        tree["variation"] = {
            "day": 1,
            "day_to_day": {"load.coulomb_torque": 0.1, "motor.coulomb_torque": 0.1},
            "trial_to_trial": {
                "all": {"paths": ["load.static_torque", "motor.static_torque"], "relative": 0.1},
                "own": {"paths": ["load.static_torque"], "relative": 0.1},
            },
        }
        shares = {"load": {"static_torque": 1.0}, "motor": {"static_torque": 1.0}}
        tree["gear"]["preload"] = {"torque": "33 N m", "nominal": "33 N m", "shares": shares}

    whole = bench(edit)
    motor = whole.with_friction({"motor": whole.friction["motor"]})
    tree = motor.model_dump(mode="json")
    assert tree["variation"]["day_to_day"] == {"motor": {"coulomb_torque": 0.1}}
    assert tree["variation"]["trial_to_trial"] == {
        "all": {"paths": ["motor.static_torque"], "relative": 0.1}
    }
    assert tree["gear"]["preload"]["shares"] == {"motor": {"static_torque": 1.0}}
    again = Bench.model_validate(copy.deepcopy(tree), context={"si": True})
    assert as_it_is(again, 3).friction["motor"] == as_it_is(whole, 3).friction["motor"]
