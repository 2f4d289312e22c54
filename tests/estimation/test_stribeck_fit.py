"""Fitting Equation 4.6: known parameters come back, with honest errors and honest doubts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.stats import t as t_distribution

from campaign.estimate import Origin
from campaign.estimation.both_directions import fitted_nominal
from campaign.estimation.stribeck import PARAMETERS, Problem, fit_stribeck
from campaign.estimation.velocity_map import (
    CONTRADICTED,
    EXPONENT_ENDED,
    NO_EFFECT,
    DirectionFit,
    Model,
    direction_estimates,
    doubts,
    fit_direction,
    fitted_estimates,
    is_bent,
    passed,
)
from tests.estimation.coverage import holds, rejected

SPEED = np.deg2rad(np.geomspace(0.05, 65.0, 80))
TRUE = {
    "viscous_friction": 4.14,
    "coulomb_torque": 30.2,
    "static_torque": 37.6,
    "stribeck_velocity": 0.03,
    "stribeck_exponent": 2.0,
}


def equation_4_6(speed: np.ndarray, **changed: float) -> np.ndarray:
    """Typed from the thesis, not taken from the program."""
    p = {**TRUE, **changed}
    fall = np.exp(-((speed / p["stribeck_velocity"]) ** p["stribeck_exponent"]))
    drop = p["static_torque"] - p["coulomb_torque"]
    return p["coulomb_torque"] + drop * fall + p["viscous_friction"] * speed


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"stribeck_exponent": 0.8},
        {"static_torque": 25.0},  # Fs < Fc: real axes do this, and no fit may force it away
        {"stribeck_velocity": 0.004, "viscous_friction": 0.5},
        # the motor's own side, in its own small numbers
        {"coulomb_torque": 0.03, "static_torque": 0.04, "viscous_friction": 0.001},
    ],
)
def test_exact_data_give_the_parameters_back(changed: dict[str, float]) -> None:
    found = fit_stribeck(SPEED, equation_4_6(SPEED, **changed))
    assert found.values == pytest.approx({**TRUE, **changed}, rel=1e-6)
    assert not found.bounds
    assert not found.open
    assert found.rms < 1e-9


def test_the_exponent_can_be_held() -> None:
    found = fit_stribeck(SPEED, equation_4_6(SPEED), exponent=2.0)
    assert found.values == pytest.approx(TRUE, rel=1e-6)
    assert "stribeck_exponent" not in found.free
    wrong = fit_stribeck(SPEED, equation_4_6(SPEED, stribeck_exponent=0.8), exponent=2.0)
    assert wrong.values["stribeck_exponent"] == 2.0
    assert wrong.rms > 0.05


def test_the_covariance_is_that_of_the_normal_equations() -> None:
    """Against a Jacobian by differences of Equation 4.6 as typed above."""
    deviation = 0.01 * np.geomspace(1.0, 3.0, len(SPEED))
    found = fit_stribeck(SPEED, equation_4_6(SPEED), deviation)
    columns = []
    for name in PARAMETERS:
        step = 1e-6 * TRUE[name]
        up, down = (equation_4_6(SPEED, **{name: TRUE[name] + s}) for s in (step, -step))
        columns.append((up - down) / (2 * step))
    jacobian = np.stack(columns, axis=1) / deviation[:, None]
    scale = np.linalg.norm(jacobian, axis=0)
    expected = np.linalg.inv((jacobian / scale).T @ (jacobian / scale)) / np.outer(scale, scale)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-4)


@pytest.mark.parametrize("noise", [0.001, 0.05])
def test_a_flat_map_says_that_it_shows_no_stribeck_effect(noise: float) -> None:
    random = np.random.default_rng(3)
    flat = equation_4_6(SPEED, static_torque=TRUE["coulomb_torque"])
    found = fit_direction(SPEED, flat + noise * random.normal(size=80), np.zeros(80))
    assert any("no Stribeck effect" in doubt for doubt in doubts(found))
    assert found.preferred == "none"
    estimates = direction_estimates(found, "free")
    assert estimates["stribeck_velocity"].origin == "not determined"
    assert estimates["stribeck_velocity"].reason in NO_EFFECT
    # A fall below the slowest speed would not show: the curve's end there is no static torque.
    assert estimates["static_torque"].reason in NO_EFFECT
    line = direction_estimates(found, "none")
    assert holds(line["coulomb_torque"], TRUE["coulomb_torque"])


def test_a_map_without_slow_points_doubts_its_parameters() -> None:
    """From 0.5 rad/s on the fall is over: neither vs nor Ts are in such data."""
    random = np.random.default_rng(4)
    fast = np.linspace(0.5, 1.2, 30)
    found = fit_direction(fast, equation_4_6(fast) + 0.05 * random.normal(size=30), np.zeros(30))
    assert any("stribeck_velocity" in doubt for doubt in doubts(found))
    assert direction_estimates(found, "free")["stribeck_velocity"].origin == "not determined"


MANY = pytest.mark.statistics


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slowest", "count"),
    [
        (0.035, 20),
        (0.04, 15),
        pytest.param(0.035, 400, marks=MANY),
        pytest.param(0.04, 400, marks=MANY),
    ],
)
def test_static_torque_of_maps_that_begin_above_vs_holds_where_it_is_told(
    slowest: float, count: int
) -> None:
    """vs is 0.03: by the slopes of the curve half of those that were told missed the truth."""
    speed, told = np.geomspace(slowest, 1.2, 30), []
    for seed in range(count):
        noise = 0.002 * np.random.default_rng([seed, 7]).standard_normal(30)
        fit = fit_direction(speed, equation_4_6(speed) * (1.0 + noise), np.zeros(30))
        one = direction_estimates(fit, "free")["static_torque"]
        if one.origin is Origin.MEASURED:
            told.append(holds(one, TRUE["static_torque"]))
    assert len(told) > count / 40
    assert not rejected({"static_torque": told}, "less")


def test_few_speeds_below_the_stribeck_velocity_are_told() -> None:
    speed = np.geomspace(0.025, 1.2, 30)
    found = fit_direction(speed, equation_4_6(speed), np.zeros(30))
    assert any("2 speeds are below vs; add slower ones" in d for d in doubts(found))
    told = direction_estimates(found, "free")
    assert str(told["static_torque"].reason) == "Ts is extrapolated: 2 speeds are below vs"
    assert not told["coulomb_torque"].reason


@pytest.mark.parametrize(("fastest", "is_extrapolated"), [(2.8, True), (3.2, False)])
def test_no_speed_far_above_the_stribeck_velocity_is_told(
    fastest: float, is_extrapolated: bool
) -> None:
    """By the fit's own vs, which is the true one where nothing scatters."""
    speed = np.geomspace(0.1, fastest, 30) * TRUE["stribeck_velocity"]
    found = fit_direction(speed, equation_4_6(speed), np.zeros(30))
    told = direction_estimates(found, "free")
    why = "Tc is extrapolated: no speed is above 3 times vs"
    assert str(told["coulomb_torque"].reason) == (why if is_extrapolated else "")
    assert not told["static_torque"].reason
    assert (f"{why}; add faster ones" in doubts(found)) == is_extrapolated
    both = {
        n: passed(e, "free", found, found) for n, e in fitted_nominal(found, found, "free").items()
    }
    assert both["coulomb_torque"].reason == told["coulomb_torque"].reason


def test_a_friction_that_would_be_negative_has_a_limit_on_one_side() -> None:
    """At zero, with the largest value that the points allow.

    sigma2 is nearly linear: chi-square over it is a parabola about the free estimate b of width s,
    which has risen by t² above its value at zero where x = b + sqrt(b² + t² s²). t is two-sided:
    with the one-sided one a truth 1.8 s from zero would be held in 92.5 % of repetitions only.
    """
    random = np.random.default_rng(8)
    torque = equation_4_6(SPEED, viscous_friction=-0.1) + 0.05 * random.normal(size=80)
    found = direction_estimates(fit_direction(SPEED, torque, np.zeros(80)), "free")
    viscous = found["viscous_friction"]
    assert viscous.value == 0.0
    assert viscous.origin == "at its bound"
    assert viscous.low is None
    assert found["static_torque"].low is not None
    assert found["static_torque"].freedom == 75  # a parameter at its bound was fitted all the same

    def free(speed: np.ndarray, *values: float) -> np.ndarray:
        return equation_4_6(speed, **dict(zip(PARAMETERS, values, strict=True)))

    start = [-0.1, *list(TRUE.values())[1:]]
    best, covariance = curve_fit(free, SPEED, torque, start, sigma=torque)
    assert best[0] < 0
    # The scatter is judged by the residuals with sigma2 at zero: their chi-square is larger by
    # (b / s)². Other parameters bend the parabola by some more.
    scatter = (75 + best[0] ** 2 / covariance[0, 0]) / 75
    rise = float(t_distribution.ppf(0.975, 75)) ** 2 * covariance[0, 0] * scatter
    assert viscous.high == pytest.approx(best[0] + np.sqrt(best[0] ** 2 + rise), rel=0.15)


def test_the_derivative_of_the_residuals_is_theirs() -> None:
    problem = Problem.of(SPEED, equation_4_6(SPEED), np.full(80, 0.1), None)
    point = np.array([0.1, 0.5, 0.9, -3.5, 0.1])
    step = 1e-6
    found = [(problem(point + s)[0] - problem(point - s)[0]) / (2 * step) for s in step * np.eye(5)]
    np.testing.assert_allclose(problem(point)[1], np.stack(found, axis=1), atol=1e-6)


def test_residuals_are_data_minus_model() -> None:
    torque = equation_4_6(SPEED)
    torque[40] += 1.0
    assert fit_stribeck(SPEED, torque).residuals[40] > 0.5


@pytest.mark.parametrize("count", [0, 1, 4, 5])
def test_too_few_points_are_refused(count: int) -> None:
    """Five points and five parameters had an error of 2.5e-12 once."""
    with pytest.raises(ValueError, match=f"{count} points .* 6 are the fewest"):
        fit_stribeck(SPEED[:count], equation_4_6(SPEED)[:count])
    with pytest.raises(ValueError, match=f"{count} points"):
        fit_direction(SPEED[:count], equation_4_6(SPEED)[:count], np.zeros(count))


def bent(exponent: float, seed: int) -> DirectionFit:
    speed = np.geomspace(0.002, 1.0, 20)
    scatter = 1.0 + 0.002 * np.random.default_rng(seed).standard_normal(20)
    torque = equation_4_6(speed, stribeck_exponent=exponent) * scatter
    return fit_direction(speed, torque, np.zeros(20))


def test_parameters_of_a_model_that_the_points_contradict_say_so() -> None:
    found = bent(1.0, seed=3)
    models: tuple[Model, ...] = ("2", "none")
    for model in models:
        told = direction_estimates(found, model)
        for one in told.values():
            if one.origin is not Origin.GIVEN and one.has_interval:
                assert one.origin in (Origin.CONTRADICTED, Origin.NOT_DETERMINED), one
        assert told["coulomb_torque"].reason in CONTRADICTED[model]
        assert told["coulomb_torque"].has_interval, "a reader sees what the curve of its kind has"
    free = direction_estimates(found, "free").values()
    assert all(one.origin is Origin.MEASURED for one in free)
    both = {n: passed(e, "2", found, found) for n, e in fitted_nominal(found, found, "2").items()}
    assert both["viscous_friction"].origin is Origin.CONTRADICTED


@pytest.mark.slow
def test_a_model_that_is_true_is_contradicted_once_in_five() -> None:
    count = sum(bool(bent(2.0, seed).contradiction("2")) for seed in range(200))
    low, high = 23, 60  # binomial, 200 of 0.2, 99.9 %
    assert low <= count <= high


def test_where_the_preferred_model_is_contradicted_the_free_one_is_accepted() -> None:
    """The criterion of information is more patient with an exponent of 2 than the F test."""
    found = [bent(2.0, seed) for seed in range(60)]
    contradicted = [bool(fit.contradiction(fit.preferred)) for fit in found]
    assert any(contradicted)
    for fit, against in zip(found, contradicted, strict=True):
        told = direction_estimates(fit, fit.accepted)
        assert told["coulomb_torque"].origin is Origin.MEASURED
        assert fit.accepted == ("free" if against else fit.preferred)


def test_a_parameter_at_its_bound_says_that_its_model_is_contradicted() -> None:
    """Of a curve with little viscous friction and a long tail the exponent 2 finds none at all."""
    speed = np.geomspace(0.002, 1.0, 24)
    scatter = 1.0 + 1e-4 * np.random.default_rng(2).standard_normal(24)
    torque = equation_4_6(speed, stribeck_exponent=0.5, viscous_friction=0.03) * scatter
    fit = fit_direction(speed, torque, np.zeros(24))
    assert "viscous_friction" in fit.fits["2"].bounds
    told = direction_estimates(fit, "2")["viscous_friction"]
    assert told.origin is Origin.CONTRADICTED
    assert told.reason in CONTRADICTED["2"]


def lines(count: int) -> list[DirectionFit]:
    """Maps of 20 points of Coulomb and viscous friction alone, which scatter by 0.2 %."""
    random = np.random.default_rng(11)
    speed = np.geomspace(0.003, 1.5, 20)
    line = equation_4_6(speed, static_torque=TRUE["coulomb_torque"])
    scatter = 1.0 + 2e-3 * random.standard_normal((count, 20))
    return [fit_direction(speed, line * each, np.full(20, 1e-3)) for each in scatter]


@pytest.mark.slow
@pytest.mark.parametrize("count", [60, pytest.param(600, marks=MANY)])
def test_a_line_shows_no_stribeck_effect_and_its_intervals_hold(count: int) -> None:
    """Ts and Tc of the curve are apart by their interval in 6 of 100. Of the fit with delta = 2,
    which bends somewhere, the intervals alone hold Tc and viscous friction in 86 of 100.
    """
    fits = lines(count)
    assert sum(fit.shows_stribeck_effect for fit in fits) <= count / 200
    for name in ("coulomb_torque", "viscous_friction"):
        told = [direction_estimates(fit, "2")[name].combined for fit in fits]
        ends = [(low, high) for low, high in told if low is not None and high is not None]
        assert not rejected({name: [low <= TRUE[name] <= high for low, high in ends]}, "less")
        assert len(ends) > 0.75 * count
    for fit in fits[:20]:  # the mean of two alike has their part, too
        one, mean = direction_estimates(fit, "2"), fitted_nominal(fit, fit, "2")
        if one["coulomb_torque"].origin is Origin.MEASURED:
            expected = one["coulomb_torque"].systematic_uncertainty
            assert expected > 0.0
            assert mean["coulomb_torque"].systematic_uncertainty == pytest.approx(expected)


def test_the_mean_of_a_bent_curve_has_the_mean_of_both_ends() -> None:
    """By profile on either side: no covariance tells how lopsided it is."""
    speed = np.geomspace(0.02, 1.5, 20)
    scatter = 1.0 + 4e-3 * np.random.default_rng(5).standard_normal((2, 20))
    one, other = (fit_direction(speed, equation_4_6(speed) * s, np.full(20, 1e-3)) for s in scatter)
    found = [fitted_estimates(fit, "free")["static_torque"] for fit in (one, other)]
    assert is_bent(one, "free", "static_torque")
    mean = fitted_nominal(one, other, "free")["static_torque"]
    assert mean.low == pytest.approx(np.mean([each.low for each in found]))
    assert mean.high == pytest.approx(np.mean([each.high for each in found]))


def test_what_rests_on_an_exponent_at_its_limit_is_left_open() -> None:
    """A step where the search allows no more than an exponent of 5."""
    torque = equation_4_6(SPEED, stribeck_exponent=12.0)
    torque *= 1.0 + 1e-3 * np.random.default_rng(3).standard_normal(len(SPEED))
    told = direction_estimates(fit_direction(SPEED, torque, np.full(len(SPEED), 1e-3)), "free")
    for name in ("static_torque", "stribeck_velocity"):
        assert told[name].origin is Origin.NOT_DETERMINED
        assert told[name].reason in EXPONENT_ENDED
    assert told["coulomb_torque"].origin is Origin.MEASURED


def bound_of_viscous(speed: np.ndarray, viscous: float, deviation: np.ndarray) -> float:
    """Cramér-Rao half-width of viscous friction (95 %, Student's t), by differences of 4.6."""
    true, columns = TRUE | {"viscous_friction": viscous}, []
    for name in PARAMETERS:
        step = 1e-6 * true[name]
        up, down = (equation_4_6(speed, **true | {name: true[name] + s}) for s in (step, -step))
        columns.append((up - down) / (2 * step) / deviation)
    scale = np.linalg.norm(columns, axis=1)
    jacobian = np.array(columns).T / scale
    error = np.sqrt(np.linalg.inv(jacobian.T @ jacobian)[0, 0]) / scale[0]
    return float(t_distribution.ppf(0.975, len(speed) - len(PARAMETERS)) * error)


@pytest.mark.parametrize("dry", [True, False])
def test_points_say_which_part_of_friction_scatters(dry: bool) -> None:
    """Where its dry part scatters alone, weights of all friction make the intervals of viscous
    friction 2.6 times as wide; where all scatters, weights of the dry part miss 23 of 60.
    """
    speed, held, steady, widths = np.geomspace(0.0015, 3.0, 36), [], 0, []
    torque = equation_4_6(speed, viscous_friction=50.0)
    part = torque - 50.0 * speed if dry else torque
    for seed in range(60):
        noise = 0.003 * np.random.default_rng([seed, 9]).standard_normal(36)
        fit = fit_direction(speed, torque + part * noise, np.zeros(36))
        between = np.max([each.deviation(speed, fit.torque) for each in fit.scatters], axis=0)
        np.testing.assert_allclose(fit.deviation, between, rtol=1e-6)
        one = direction_estimates(fit, "free")["viscous_friction"]
        held.append(one.low <= 50.0 <= one.high)
        widths.append(one.half_width)
        steady += fit.scatters[0].steady_viscous > 0
    assert held.count(False) <= 7  # binomial, 60 of 0.05, 99 %
    assert steady >= 45 if dry else steady <= 3
    assert np.median(widths) == pytest.approx(bound_of_viscous(speed, 50.0, 0.003 * part), rel=0.15)


@pytest.mark.parametrize(("fastest", "told"), [(2.5, False), (30.0, True)])
def test_coulomb_torque_follows_an_exponent_at_its_limit_without_fast_speeds(
    fastest: float, told: bool
) -> None:
    """On two rigs it was 5 to 9 half-widths off; the bend of the curve was its viscous friction."""
    speed = np.geomspace(0.3, fastest, 30)
    bent = equation_4_6(speed, static_torque=28.0, stribeck_velocity=1.0, stribeck_exponent=8.0)
    noise = 0.0005 * np.random.default_rng(6).standard_normal(30)
    fit = fit_direction(speed, bent * (1.0 + noise), np.zeros(30))
    assert fit.fits["free"].bounds == {"stribeck_exponent": "upper"}
    for name in ("coulomb_torque", "viscous_friction"):
        one = direction_estimates(fit, "free")[name]
        assert (one.origin is Origin.MEASURED) == told
        assert (one.reason in EXPONENT_ENDED) != told
