"""Friction models along motions: what the engine makes of them, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.model_choice import FITTED, INERTIA, TRUTHS, identified
from campaign.axis_kind import AxisKind, Sides, axis_terms
from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation.inverse.motion import FilterSettings, Motion, motion_of_position
from campaign.estimation.unknowns import Unknown
from campaign.estimation.whole_model import ModelFit, fit_model, moved_with
from campaign.experiments.any_motion.motions import MotionPiece, with_slowest
from campaign.experiments.whole_model.doubts import (
    BASE_UNKNOWN,
    CORRELATED,
    OTHER_EXPONENT,
    derived,
    described,
    resolved,
    shifted,
    with_bases,
)
from campaign.experiments.whole_model.residuals import models
from campaign.experiments.whole_model.whole_model_fit import find
from campaign.physics.friction import friction_models
from campaign.physics.friction.stribeck import StribeckOptions, steady_state
from campaign.physics.friction.unknowns import DerivedOption, Sizes, product
from campaign.physics.friction_response import Along
from campaign.reason import Reason
from tests.estimation.coverage import holds, rejected
from tests.estimation.rigs import random_rigs

CURVE = {
    "model": "stribeck",
    "coulomb_torque": 2.0,
    "static_torque": 1.2,
    "stribeck_velocity": 0.1,
    "viscous_friction": 0.5,
    "negative": {"coulomb_torque": 2.5, "viscous_friction": 0.8},
}


def swinging() -> Motion:
    time = np.arange(5000) / 1000.0
    omega = 2 * np.pi * 0.7
    return Motion(time, -np.cos(omega * time) / omega, np.sin(omega * time), time, time)


def test_friction_along_a_motion_is_that_of_its_curve() -> None:
    motion = swinging()
    options = StribeckOptions.model_validate(CURVE, context={"si": True})
    found = Along.rates(motion.rate, motion.sample_rate).friction(CURVE)
    moves = np.abs(motion.rate) > 0.02
    assert found[moves] == pytest.approx(steady_state(options, motion.rate)[moves], rel=2e-3)


def test_a_line_is_fitted_with_the_intervals_of_its_closed_form() -> None:
    draw = np.random.default_rng(1)
    x = np.linspace(0.0, 1.0, 400)
    y = 2.0 + 3.0 * x + 0.1 * draw.standard_normal(400)
    unknowns = [Unknown("level", -10.0, 10.0, 0.0), Unknown("slope", 0.1, 100.0, 1.0, True)]
    fit = fit_model(unknowns, {}, lambda v: [y - v[0] - v[1] * x], starts=1)
    columns = np.column_stack([np.ones(400), x])
    exact = np.linalg.lstsq(columns, y, rcond=None)[0]
    assert fit.values == pytest.approx(exact, rel=1e-4)
    left = y - columns @ exact
    error = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * (left @ left) / 398)
    assert fit.estimates["level"].standard_error == pytest.approx(error[0], rel=0.25)
    assert fit.estimates["slope"].standard_error == pytest.approx(error[1], rel=0.25)


def test_what_nothing_tells_and_what_goes_to_its_bound_has_no_interval() -> None:
    x = np.linspace(0.0, 1.0, 200)
    y = 2.0 + 0.01 * np.random.default_rng(1).standard_normal(200)
    unknowns = [
        Unknown("level", 0.0, 10.0, 1.0),
        Unknown("nothing", 0.0, 1.0, 0.5),
        Unknown("kept", 1.0, 2.0, 1.5),
    ]
    fit = fit_model(unknowns, {}, lambda v: [y - v[0] - 0.0 * v[1] - 0.5 * v[2] * x], starts=1)
    assert fit.estimates["nothing"].origin is Origin.NOT_DETERMINED
    assert fit.estimates["kept"].origin is Origin.AT_BOUND
    assert not fit.estimates["kept"].has_interval


RATIOS = ("static_over_coulomb_positive", "static_over_coulomb_negative")


def test_what_others_do_when_one_is_held_elsewhere_is_that_of_a_fit() -> None:
    """A line whose slope is held beside its best: the level goes by minus the mean of x."""
    x = np.linspace(0.0, 1.0, 400)
    y = 2.0 + 3.0 * x + 0.1 * np.random.default_rng(1).standard_normal(400)
    unknowns = [Unknown("level", 0.1, 10.0, 1.0, True), Unknown("slope", 0.0, 10.0, 1.0)]
    fit = fit_model(unknowns, {}, lambda v: [y - v[0] - v[1] * x], starts=1)
    assert moved_with(fit, "slope", 0.02) == pytest.approx({"level": -0.02 * x.mean()}, rel=0.01)


def test_viscous_friction_may_be_much_more_than_a_plain_line_says() -> None:
    """Where friction falls as sliding sets in, a line through all of it is nearly level."""
    level = models(Sizes((2.0, 2.0), (0.01, 0.01), 0.5, 1.0))[0]
    [viscous] = [each for each in level.unknowns if each.name == "viscous"]
    assert viscous.upper >= 2.0 / 0.5


@pytest.mark.slow
def test_what_a_loop_makes_of_noise_is_in_the_interval_of_viscous_friction(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It looks like a delay: 0.7 ms of it, and viscous friction is 4 % too large."""
    monkeypatch.setattr(
        "campaign.experiments.whole_model.whole_model_fit.models", lambda *told: models(*told)[1:2]
    )
    rig = random_rigs(16, seed=51, stribeck=True)[1]
    filtering = FilterSettings.for_rate(1000.0)
    motion = motion_of_position(rig.time, rig.angle, rig.force, filtering.low_pass)
    filtering = replace(filtering, slowest=0.005 * float(np.abs(motion.rate).max()))
    found, free = find([MotionPiece(1, motion, None)], [], filtering, starts=1).fits
    assert free.model.name == f"{found.model.name}, exponent free"
    assert found.values["delay"] - rig.truth["delay"] > 5e-4
    for name in ("viscous_positive", "viscous_negative"):
        estimate = found.fit.estimates[name]
        assert [part.source for part in estimate.systematic] == ["band", "exponent", "delay"]
        assert holds(estimate, rig.truth[name])
        assert estimate.half_width < 0.15 * estimate.value


@pytest.mark.parametrize(
    ("slow", "stiff", "refused"),
    [
        (0.2, 100.0, set()),
        (0.01, 100.0, {"stribeck_velocity", *RATIOS}),
        (0.2, 1e6, {"bristle_stiffness", "bristle_damping"}),
    ],
)
def test_what_is_passed_faster_than_rows_show_is_refused(
    slow: float, stiff: float, refused: set[str]
) -> None:
    """A reversal at 4.4 rad/s² takes 2.3 ms through 0.01 rad/s, and rows show 12 ms."""
    motion = swinging()
    omega = 2 * np.pi * 0.7
    motion = replace(motion, acceleration=omega * np.cos(omega * motion.time))
    model = models(Sizes((2.0, 2.5), (0.5, 0.8), 1.0, 0.5))[2]
    told = {each.name: each.start for each in model.numbers}
    told |= {"stribeck_velocity": slow, "bristle_stiffness": stiff}
    found = SimpleNamespace(unknowns=[Unknown(name, -1.0, 1e9, v) for name, v in told.items()])
    sure = {name: Estimate(name, v, "", v - 0.1, v + 0.1, 0.95) for name, v in told.items()}
    fit = ModelFit(found, sure, tuple(told.values()), (), None, np.ones(len(told), dtype=bool))
    kept = resolved(fit, model, [motion], FilterSettings(100.0, 10)).estimates
    assert {name for name, each in kept.items() if not each.has_interval} == refused


BOUND = Estimate.without_interval(
    "coulomb_positive", 0.01, "N m", Reason("test", "at a bound"), origin=Origin.AT_BOUND
)


def told(name: str, value: float, error: float = 0.0, *parts: Systematic) -> Estimate:
    """A number with its interval: two standard errors."""
    error = error or 0.1 * value
    low, high = value - 2.0 * error, value + 2.0 * error
    return Estimate(
        name, value, "", low, high, 0.95, "m", standard_error=error, freedom=50.0, systematic=parts
    )


def fit_of(*estimates: Estimate, correlation: float = 0.0) -> Any:
    """A fit that found them, each pair with one correlation."""
    names = [each.name for each in estimates]
    pairs = {(a, b): correlation for i, a in enumerate(names) for b in names[:i]}
    return SimpleNamespace(
        estimates={each.name: each for each in estimates}, correlation=pairs, model=""
    )


def test_what_is_a_share_of_a_friction_at_its_bound_is_not_told() -> None:
    """As where the force has the wrong sign: friction goes to nothing; twice that is nothing."""
    model = models(Sizes((2.0, 2.5), (0.5, 0.8), 1.0, 0.5), ("stribeck",))[1]
    estimates = {each.name: told(each.name, 2.0) for each in model.numbers}
    estimates["coulomb_positive"] = BOUND
    fit = ModelFit(None, estimates, (), (), None, np.zeros(0, bool))  # type: ignore[arg-type]
    found = with_bases(fit, model).estimates
    assert found["static_over_coulomb_positive"].origin is Origin.NOT_DETERMINED
    assert found["static_over_coulomb_positive"].reason in BASE_UNKNOWN
    # The other direction has friction, and tells both.
    assert found["static_over_coulomb_negative"].has_interval
    assert found["stribeck_velocity"].has_interval
    both = {**estimates, "coulomb_negative": replace(BOUND, name="coulomb_negative")}
    found = with_bases(replace(fit, estimates=both), model).estimates
    assert {name for name, one in found.items() if one.has_interval} == {
        "viscous_positive", "viscous_negative",
    }  # fmt: skip


SLOW_FALL = {"stribeck_velocity": 0.3}  # which reversals take longer to pass than rows show
TRUE = {"coulomb_positive": 2.0, "static_over_coulomb_positive": 1.5} | SLOW_FALL


@pytest.mark.slow
@pytest.mark.parametrize("exponent", [0.7, 2.0, 3.0])
def test_an_exponent_unlike_the_usual_one_is_found_or_leaves_its_curve_open(
    monkeypatch: pytest.MonkeyPatch, exponent: float
) -> None:
    """Held at 2, static friction and Stribeck velocity of another curve are wrong by far."""
    truth = {**TRUTHS["stribeck"], **SLOW_FALL, "stribeck_exponent": exponent}
    monkeypatch.setitem(TRUTHS, "stribeck", truth)
    found = identified("stribeck", 1, ("stribeck",))
    held, free = found.fits[1:]
    usual = exponent == 2.0
    assert found.fits[found.best] is (held if usual else free)
    assert (free.model.name in found.as_good) is usual
    for name, value in TRUE.items():
        for fit in (held, free):
            one = fit.fit.estimates[name]
            assert holds(one, value) if one.origin is Origin.MEASURED else not usual
    if not usual:
        assert holds(free.fit.estimates["stribeck_exponent"], exponent)


def test_static_friction_rests_on_a_stribeck_velocity_that_the_motion_passes() -> None:
    """At three times it a twentieth of the fall is left (exponent 1)."""
    model = models(Sizes((2.0, 2.5), (0.5, 0.8), 1.2, 0.5), ("stribeck",))[1]
    [slow] = [each for each in model.unknowns if each.name == "stribeck_velocity"]
    assert np.exp(-1.2 / slow.upper) < 0.05
    estimates = {each.name: told(each.name, 2.0) for each in model.numbers}
    estimates["stribeck_velocity"] = replace(BOUND, name="stribeck_velocity")
    fit = ModelFit(None, estimates, (), (), None, np.zeros(0, bool))  # type: ignore[arg-type]
    for name in RATIOS:
        assert with_bases(fit, model).estimates[name].reason in BASE_UNKNOWN


def test_a_model_can_be_wanted_with_its_exponent_held_or_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By its name, as another recording is compared with; whatever the BIC says."""
    monkeypatch.setattr(
        "campaign.experiments.whole_model.whole_model_fit._fitted",
        lambda model, *told: SimpleNamespace(
            model=model, values={"inertia": 1.0} | {each.name: 1.0 for each in model.numbers}
        ),
    )
    piece = MotionPiece(1, swinging(), None)
    filtering = with_slowest(FilterSettings.for_rate(1000.0), [piece], None)
    for wanted in ("stribeck, by direction", "stribeck, by direction, exponent free"):
        found = find([piece], [], filtering, names=("stribeck",), wanted=wanted)
        assert found.fits[found.best].model.name == wanted
        assert found.fits[-1].model.name == "stribeck, by direction, exponent free"
    with pytest.raises(ValueError, match="there is no model 'dahl'"):
        find([piece], [], filtering, names=("stribeck",), wanted="dahl")


def test_what_happens_in_reversals_is_open_where_what_is_left_over_is_correlated() -> None:
    """Of a right model 95 % of the rows count; of one that lacks something a fifth."""
    model = models(Sizes((2.0, 2.5), (0.5, 0.8), 1.0, 0.5), ("lugre",))[1]
    estimates = {each.name: told(each.name, 2.0) for each in model.numbers}
    lost = {each.name for each in model.numbers if each.lasts is not None}
    assert {"stribeck_velocity", "bristle_stiffness", *RATIOS} <= lost
    for worth, refused in ((950.0, set()), (200.0, lost)):
        regression: Any = SimpleNamespace(effective=worth)
        fit = ModelFit(None, estimates, (), (np.zeros(1000),), regression, np.zeros(0, bool))  # type: ignore[arg-type]
        found = described(fit, model).estimates
        assert {name for name, one in found.items() if not one.has_interval} == refused


@pytest.mark.slow
def test_bristles_of_another_model_are_not_told() -> None:
    """Friction with hysteresis of its own, fitted as LuGre friction."""
    fit = identified("leuven", 1, ("lugre",)).fits[1].fit
    for name in ("bristle_stiffness", "bristle_damping"):
        assert fit.estimates[name].reason in CORRELATED


def test_another_exponent_is_told_in_the_units_of_the_axis() -> None:
    fit = fit_of(told("stribeck_velocity", 0.01, 1e-4))
    fit.estimates["stribeck_velocity"] = replace(fit.estimates["stribeck_velocity"], unit="rad/s")
    with axis_terms(Sides(AxisKind.LINEAR, AxisKind.LINEAR)):
        left = shifted(
            ModelFit(None, fit.estimates, (), (), None, np.zeros(0, bool)),
            {"stribeck_velocity": 0.02},
            "exponent",
            OTHER_EXPONENT,
        )
    [one] = left.estimates.values()
    assert one.origin is Origin.NOT_DETERMINED
    assert one.reason.text == "with another exponent it is 20 mm/s"


STATIC_TORQUE = DerivedOption("static", "static_torque", "N m", "", "", product("ratio", "coulomb"))


def test_a_product_keeps_what_is_systematic_in_its_factors() -> None:
    """Static friction as a ratio times Coulomb friction: scatter by the delta method, parts add."""
    ratio = told("ratio", 0.5, 0.01, Systematic("band", 0.03))
    base = told("coulomb", 20.0, 0.4, Systematic("band", 1.0))
    values = {"ratio": 0.5, "coulomb": 20.0, "viscous": 1.0}
    made = derived(STATIC_TORQUE, values, fit_of(ratio, base))
    assert made.value == 10.0
    assert made.standard_error == pytest.approx(10.0 * np.hypot(0.01 / 0.5, 0.4 / 20.0))
    assert made.high - made.value == pytest.approx(2.0 * made.standard_error)
    [part] = made.systematic
    assert part.source == "band"
    assert part.standard_uncertainty == pytest.approx(20.0 * 0.03 + 0.5 * 1.0)
    together = derived(STATIC_TORQUE, values, fit_of(ratio, base, correlation=1.0))
    assert together.standard_error == pytest.approx(10.0 * 0.04)
    lost = Estimate.without_interval(
        "ratio", 0.5, "", Reason("test", "nobody knows"), origin=Origin.NOT_DETERMINED
    )
    made = derived(STATIC_TORQUE, values, fit_of(lost, base))
    assert made.origin is Origin.NOT_DETERMINED


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, pytest.param(10, marks=pytest.mark.statistics)])
def test_intervals_hold_and_a_jump_of_friction_has_no_bristles(count: int) -> None:
    """Rigs without bristles: stiffness is refused, whatever a filtered jump looks like."""
    held: list[bool] = []
    for rig in random_rigs(count, seed=31, stribeck=True, seconds=15.0):
        filtering = FilterSettings.for_rate(1000.0)
        motion = motion_of_position(rig.time, rig.angle, rig.force, filtering.low_pass)
        piece = MotionPiece(1, motion, None)
        slow = 0.25 * with_slowest(filtering, [piece], None).slowest
        found = find([piece], [], with_slowest(filtering, [piece], slow), starts=1)
        for name in ("coulomb_positive", "coulomb_negative", "viscous_positive"):
            estimate = found.fits[1].fit.estimates[name]
            if estimate.has_interval:
                held.append(holds(estimate, rig.truth[name]))
        bristles = found.fits[2].fit.estimates
        assert bristles["bristle_stiffness"].origin is not Origin.MEASURED
        assert bristles["bristle_damping"].origin is not Origin.MEASURED
    assert len(held) >= 2 * count
    assert rejected({"all": held}, "less") == {}


@pytest.mark.slow
@pytest.mark.parametrize("truth", ["armstrong", "bliman-sorine"])
@pytest.mark.parametrize("count", [1, pytest.param(24, marks=pytest.mark.statistics)])
def test_intervals_of_a_models_own_numbers_hold(truth: str, count: int) -> None:
    """Of every option by direction, fitted or derived, and of the inertia."""
    whole = TRUTHS[truth]
    true = {
        "inertia": INERTIA,
        **whole,
        **{f"negative.{k}": v for k, v in whole.items() if k != "negative"},
    }
    true |= {f"negative.{key}": value for key, value in whole["negative"].items()}
    held: list[bool] = []
    for seed in range(20, 20 + count):
        one = identified(truth, seed, (truth,)).fits[1]
        told = [(each.key, one.fit.estimates[each.name]) for each in one.model.numbers if each.key]
        told += [(each.key, derived(each, one.values, one.fit)) for each in one.model.derived]
        told.append(("inertia", one.fit.estimates["inertia"]))
        held += [holds(each, true[key]) for key, each in told if each.has_interval]
    assert len(held) >= 6 * count
    assert rejected({"all": held}, "less") == {}


@pytest.mark.slow
@pytest.mark.parametrize("truth", ["coulomb", "dahl", "lugre"])
def test_the_model_that_a_rig_has_is_named(truth: str) -> None:
    """LuGre can be Dahl and Coulomb friction as well, with numbers that tell nothing."""
    found = identified(truth, 1, ("coulomb", "dahl", "lugre"), seconds=10.0)
    assert found.fits[found.best].model.model == truth
    assert all(each.startswith(truth) for each in found.as_good)


def test_a_model_that_states_no_unknowns_is_refused_by_name() -> None:
    sizes = Sizes((2.0, 2.0), (0.01, 0.01), 0.5, 1.0)
    with pytest.raises(ValueError, match="karnopp does not say what is fitted of it; there are"):
        models(sizes, ("karnopp",))
    with pytest.raises(ValueError, match="no friction model 'lugr'; did you mean 'lugre'"):
        models(sizes, ("lugr",))
    assert [each.name for each in models(sizes, ("gms", "dahl"))] == [
        "gms, directions alike",
        "gms, by direction",
        "dahl, by direction",
    ]


@pytest.mark.parametrize("name", FITTED)
def test_what_a_model_states_makes_valid_options(name: str) -> None:
    """At the start and at both bounds of every unknown."""
    sizes = Sizes((2.0, 2.5), (0.5, 0.8), 1.0, 0.5)
    for model in models(sizes, (name,)):
        start = {each.name: each.start for each in model.unknowns}
        for each in model.unknowns:
            for value in (each.lower, each.start, each.upper):
                options = model.options({**start, each.name: value})
                assert friction_models()[name].options.model_validate(options, context={"si": True})
