"""Friction by direction, and the constant force that may be in it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import TOO_WIDE, UNPHYSICAL
from campaign.experiments.any_motion.inverse_result import (
    BENCH,
    NO_BASE,
    NO_SLOPE,
    _settings,
    _with_base,
    _with_slope,
)
from campaign.experiments.frequency_response.model import analysis as frequency_response
from campaign.experiments.friction_map import map_result as friction_map
from campaign.experiments.presliding_multisine import parameters as presliding
from campaign.experiments.shared.directions import OFFSET_OR_ASYMMETRY, with_offset
from campaign.experiments.whole_model import experiment as whole_model
from campaign.experiments.whole_model.residuals import models
from campaign.parameter import Parameter
from campaign.physics.bench import Bench
from campaign.physics.friction.unknowns import Sizes
from tests.experiments.asked import data_of

RIG = {"name": "rig", "axis": {"name": "tilt"}}


def number(name: str, value: float, half: float, **more: Any) -> Estimate:
    return Estimate(name, value, "N m", value - half, value + half, 0.95, **more)


def test_half_of_the_difference_stands_beside_both_directions() -> None:
    """A sensor's zero of 0.4 N m on friction of 3.36 N m both ways."""
    found = {
        "coulomb_positive": number("coulomb_positive", 3.76, 0.37),
        "coulomb_negative": number("coulomb_negative", 2.95, 0.30),
    }
    for one in with_offset(found, "coulomb").values():
        assert one.reason in OFFSET_OR_ASYMMETRY
        assert dict(one.reason.values)["half"] == pytest.approx(0.405)
        assert one.origin is Origin.MEASURED


@pytest.mark.parametrize(
    "negative",
    [
        number("coulomb_negative", 3.6, 0.30),
        number("coulomb_negative", 0.2, 0.01, origin=Origin.NOT_DETERMINED),
        Estimate("coulomb_negative", 0.2, "N m", level=0.95, kind="at most"),
    ],
)
@pytest.mark.parametrize("first", ["coulomb_positive", "coulomb_negative"])
def test_nothing_is_said_where_they_do_not_differ_or_one_is_no_number(
    negative: Estimate, first: str
) -> None:
    both = {"coulomb_positive": number("coulomb_positive", 3.76, 0.37), negative.name: negative}
    found = {name: both[name] for name in sorted(both, reverse=first == "coulomb_positive")}
    assert with_offset(found, "coulomb") == found


def test_a_bench_gets_nothing_beside_a_measured_number_that_contradicts_it() -> None:
    """No static friction was looked for, and none is told; of a bound the lower end."""
    bound = Estimate("viscous_positive", 4.0, "N m s/rad", level=0.95, kind="at most")
    found = [
        number("coulomb_positive", 2.95, 0.3),
        number("coulomb_negative", 3.76, 0.3),
        bound,
        number("viscous_negative", 80.0, 6.0),
    ]
    parameters = [Parameter(one, "", bench=BENCH[one.name]) for one in found]
    told = _settings(parameters, data_of([SimpleNamespace(trial=SimpleNamespace(bench=RIG))]))
    assert told["friction.load.model"][0] == "coulomb"
    assert not any("static" in path or "stribeck" in path for path in told)
    assert told["friction.load.viscous_friction"][0] == 0.0
    assert "friction.load.negative.viscous_friction" not in told  # it is a parameter


def test_dry_friction_is_told_where_its_slope_over_the_rate_is_or_does_not_matter() -> None:
    """Rates that do not show friction rise may lie where it is static friction."""
    open_ = {"origin": Origin.NOT_DETERMINED}
    bound = Estimate("viscous_negative", 4.0, "N m s/rad", level=0.95, kind="at most")
    found = {
        "coulomb_positive": number("coulomb_positive", 5.0, 0.1),
        "viscous_positive": number("viscous_positive", -0.3, 0.2, **open_),
        "coulomb_negative": number("coulomb_negative", 5.0, 0.1),
        "viscous_negative": bound,
    }
    told = _with_slope(found)
    assert told["coulomb_positive"].reason in NO_SLOPE
    assert told["coulomb_negative"] == found["coulomb_negative"]
    assert _with_slope(told) == told


def test_what_else_is_in_a_force_is_not_told_where_neither_inertia_nor_friction_is() -> None:
    open_ = {"origin": Origin.NOT_DETERMINED}
    found = {
        "inertia": number("inertia", 1.0, 3.0, **open_),
        "coulomb": number("coulomb", 1.0, 3.0, **open_),
        "cogging_sine": number("cogging_sine", 33.0, 12.0),
    }
    assert _with_base(found)["cogging_sine"].reason in NO_BASE
    base = found | {"coulomb": number("coulomb", 1.0, 0.1)}
    assert _with_base(base) == base


def test_a_curve_gets_what_was_fitted_beside_what_was_measured() -> None:
    """A Stribeck velocity that is not determined is told as it was fitted, and not measured."""
    names = ("coulomb_torque", "static_torque", "stribeck_velocity")
    values = {"coulomb_torque": 3.0, "static_torque": 4.0, "stribeck_velocity": 1.2}
    found, parameters = {}, []
    for way, prefix in (("positive", ""), ("negative", "negative.")):
        found[way] = {name: number(name, values[name], 0.1) for name in names}
        open_ = number("stribeck_velocity", 1.2, 0.9, origin=Origin.NOT_DETERMINED)
        found[way]["stribeck_velocity"] = open_
        parameters += [
            Parameter(one, "", bench=f"friction.load.{prefix}{name}")
            for name, one in found[way].items()
        ]
    told = friction_map._settings(found, parameters)
    for prefix in ("", "negative."):
        assert told[f"friction.load.{prefix}stribeck_velocity"][0] == 1.2
        assert f"friction.load.{prefix}static_torque" not in told, "measured, and stands there"


def test_a_product_of_two_numbers_passes_the_gate_of_a_whole_model() -> None:
    """Coulomb friction and the ratio to it are each known well enough; their product is not."""

    told = {
        "coulomb": number("coulomb", 1.0, 0.45, standard_error=0.23),
        "static_over_coulomb": number("static_over_coulomb", 1.2, 0.55, standard_error=0.28),
    }
    stribeck = models(Sizes((1.0, 1.0), (0.0, 0.0), 1.0, 1.0), ("stribeck",))[0]
    best: Any = SimpleNamespace(
        fit=SimpleNamespace(estimates=told, correlation={}),
        values={name: each.value for name, each in told.items()},
        model=replace(stribeck, numbers=stribeck.numbers[:1]),
        extra=(),
    )
    trial = SimpleNamespace(
        trial=SimpleNamespace(recording={"channels": []}, bench=RIG), channel_names=frozenset
    )
    parameters = list(whole_model._parameters(best, data_of([trial])))
    found = {each.estimate.name: each for each in parameters}
    assert found["coulomb"].bench == "friction.load.coulomb_torque"
    assert found["static_torque"].estimate.reason in TOO_WIDE
    assert found["static_torque"].bench == ""


def test_a_damping_below_what_the_viscous_friction_takes_of_it_is_unphysical() -> None:
    bench = Bench.model_validate({"name": "rig", "axis": {"name": "tilt"}})
    found = {"damping_at_rest": number("damping_at_rest", 10.0, 1.0)}
    told = presliding._bristle_damping(found, bench, 20.0)
    assert told["bristle_damping"].value == -10.0
    assert told["bristle_damping"].reason in UNPHYSICAL


def test_a_mode_of_a_raw_response_passes_the_gate(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = number("resonance", 90.0, 80.0)
    monkeypatch.setattr(frequency_response, "_local", lambda *_: {"resonance": wide})
    monkeypatch.setattr(frequency_response, "too_few", lambda _: NO_BASE())
    masses: Any = SimpleNamespace(drive=None, places={}, reason=NO_BASE(), axis=None, bent="")
    best: Any = SimpleNamespace(source=None, margins=None)
    found = {each.estimate.name: each for each in frequency_response._parameters(masses, best)}
    assert found["resonance"].estimate.reason in TOO_WIDE
