"""Least squares against closed forms: values, standard errors, criterion, and every doubt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from campaign.identification.least_squares import (
    Array,
    Fit,
    Parameter,
    _standard_errors,
    covariance,
    fit,
    minimum,
    profile_limit,
)

X = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
Y = np.array([1.1, 2.9, 5.2, 6.8, 9.1, 11.4])


def parameter(name: str, *starts: float, lower: float = -100.0, upper: float = 100.0) -> Parameter:
    return Parameter(name, lower, upper, starts or (0.5,))


def line(x: Array, values: Mapping[str, float]) -> Array:
    return np.asarray(values["offset"] + values["slope"] * x)


def constant(x: Array, values: Mapping[str, float]) -> Array:
    return np.full(len(x), values["level"])


def level(*data: float, **bounds: float) -> Fit:
    """The fit of one number, which is the mean."""
    y = np.array(data)
    return fit(constant, np.zeros(len(y)), y, [parameter("level", **bounds)])


def test_a_straight_line_is_that_of_the_normal_equations() -> None:
    found = fit(line, X, Y, [parameter("offset"), parameter("slope")])
    design = np.stack([np.ones(6), X], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    offset, slope = inverse @ design.T @ Y
    residuals = Y - offset - slope * X
    variance = residuals @ residuals / (6 - 2)
    errors = np.sqrt(variance * np.diag(inverse))
    assert found.values == pytest.approx({"offset": offset, "slope": slope}, rel=1e-7)
    assert found.errors == pytest.approx({"offset": errors[0], "slope": errors[1]}, rel=1e-6)
    assert found.residuals == pytest.approx(residuals, abs=1e-7)
    assert found.rms == pytest.approx(np.sqrt(residuals @ residuals / 6), rel=1e-6)
    bic = 6 * np.log(residuals @ residuals / 6) + 2 * np.log(6)
    assert found.bic == pytest.approx(bic, rel=1e-6)
    assert found.doubts == ()


def test_the_variance_has_as_many_degrees_of_freedom_as_points_beyond_the_parameters() -> None:
    """The mean of 1 and 3: squares sum to 2, over one degree of freedom, so an error of 1."""
    assert level(1.0, 3.0).errors["level"] == pytest.approx(1.0, rel=1e-6)


def test_exact_data_have_a_criterion_that_is_a_number() -> None:
    found = fit(constant, np.zeros(2), np.zeros(2), [parameter("level", 0.0)])
    assert found.rms == 0.0
    assert found.doubts == ()  # an exact zero is no doubtful one
    assert found.bic == pytest.approx(2 * np.log(np.finfo(float).tiny) + np.log(2))


@pytest.mark.parametrize("count", [1, 2])
def test_no_more_points_than_parameters_are_refused(count: int) -> None:
    """Two points give a line through both, and no word of how far it is off."""
    both = [parameter("offset"), parameter("slope")]
    with pytest.raises(ValueError, match=f"{count} points cannot determine 2 .* 3 are the fewest"):
        fit(line, X[:count], Y[:count], both)
    assert np.isfinite(fit(line, X[:3], Y[:3], both).errors["slope"])


# Where it starts


def swing(x: Array, values: Mapping[str, float]) -> Array:
    return np.asarray(np.sin(values["rate"] * x + values["phase"]))


@pytest.mark.parametrize("rates", [(0.4, 3.0, 7.0), (3.0, 0.4, 7.0), (7.0, 0.4, 3.0)])
@pytest.mark.parametrize("phases", [(-2.0, 1.0), (1.0, -2.0)])
def test_the_best_of_all_combinations_of_starts_counts(
    rates: tuple[float, ...], phases: tuple[float, ...]
) -> None:
    x = np.linspace(0.0, 10.0, 60)
    y = swing(x, {"rate": 3.1, "phase": 1.0})
    parameters = [
        parameter("rate", *rates, lower=0.0),
        parameter("phase", *phases, lower=-4.0, upper=4.0),
    ]
    assert fit(swing, x, y, parameters).values == pytest.approx(
        {"rate": 3.1, "phase": 1.0}, rel=1e-5
    )


@pytest.mark.parametrize("start", [-1000.0, 1000.0])
def test_a_start_beyond_a_bound_is_moved_to_it(start: float) -> None:
    found = fit(constant, np.zeros(3), np.full(3, 2.0), [parameter("level", start)])
    assert found.values["level"] == pytest.approx(2.0, rel=1e-6)


def test_a_fit_and_its_parameters_are_what_they_are() -> None:
    with pytest.raises(FrozenInstanceError):
        parameter("level").lower = 0.0  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        level(1.0, 2.0).bic = 0.0  # type: ignore[misc]


# What is doubted


@pytest.mark.parametrize(("sign", "share", "doubted"), [
    (1, 0.49, False), (1, 0.51, True), (-1, 0.49, False), (-1, 0.51, True),
])  # fmt: skip
def test_less_than_two_standard_errors_from_zero(sign: int, share: float, doubted: bool) -> None:
    """The mean of (v - d) and (v + d) has the standard error d."""
    value = 3.0 * sign
    doubts = level(value - 3.0 * share, value + 3.0 * share).doubts
    assert [doubt.split(":")[0] for doubt in doubts] == ["level cannot be told from zero"] * doubted
    if doubted:
        assert doubts[0].endswith(f": {value:.3g} ± {3.0 * share:.2g} (1σ)")


@pytest.mark.parametrize(("bounds", "bound"), [
    ({"upper": 1.0}, "1"), ({"lower": 9.0}, "9"), ({}, None),
])  # fmt: skip
def test_a_parameter_at_its_bound_is_named(bounds: dict[str, float], bound: str | None) -> None:
    at = [doubt for doubt in level(4.9, 5.1, 5.0, **bounds).doubts if "bound" in doubt]
    assert at == ([] if bound is None else [f"level ended at its bound {bound}"])


def test_a_parameter_that_the_data_do_not_show_is_named_and_has_no_error() -> None:
    found = fit(line, np.zeros(6), Y, [parameter("offset"), parameter("slope")])
    assert "slope is not determined by these data" in found.doubts
    assert not any(doubt.startswith("offset") for doubt in found.doubts)
    assert np.isnan(found.errors["slope"])
    spread = np.std(Y, ddof=1) / np.sqrt(6) * np.sqrt(5 / 4)  # two parameters were asked for
    assert found.errors["offset"] == pytest.approx(spread, rel=1e-6)


def test_data_that_show_nothing_name_every_parameter() -> None:
    def nothing(x: Array, values: Mapping[str, float]) -> Array:
        return np.zeros(len(x))

    found = fit(nothing, X, Y, [parameter("offset"), parameter("slope")])
    assert [doubt.split()[0] for doubt in found.doubts] == ["offset", "slope"]
    assert np.isnan(list(found.errors.values())).all()


def test_two_parameters_of_which_only_the_sum_shows_are_both_named() -> None:
    def summed(x: Array, values: Mapping[str, float]) -> Array:
        return np.asarray(values["one"] + values["other"] + values["slope"] * x)

    parameters = [parameter("one", 0.2), parameter("other", 0.7), parameter("slope", 1.0)]
    found = fit(summed, X, Y, parameters)
    named = [doubt.split()[0] for doubt in found.doubts if "not determined" in doubt]
    assert named == ["one", "other"]
    assert np.isnan([found.errors["one"], found.errors["other"]]).all()
    true = fit(line, X, Y, [parameter("offset"), parameter("slope")])
    share = np.sqrt(4 / 3)  # a parameter more, a degree of freedom less
    assert found.errors["slope"] == pytest.approx(share * true.errors["slope"], rel=1e-5)


# The Jacobian itself


def test_the_units_of_a_parameter_decide_nothing() -> None:
    """Columns of 1e-9 and 1e9 are as independent as those of 1."""
    random = np.random.default_rng(5)
    jacobian = random.normal(size=(40, 3))
    residuals = random.normal(size=40)
    plain, none = _standard_errors(jacobian, residuals)
    scale = np.array([1e-9, 1.0, 1e9])
    scaled, neither = _standard_errors(jacobian * scale, residuals)
    assert none == neither == []
    np.testing.assert_allclose(scaled, plain / scale, rtol=1e-9)
    variance = residuals @ residuals / 37
    np.testing.assert_allclose(
        plain, np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian))), rtol=1e-9
    )


def nearly(apart: float) -> Array:
    """Two columns of length 1 that differ by `apart`, and a third across them."""
    one = np.array([1.0, 0.0, 0.0, 0.0])
    other = np.array([np.cos(apart), np.sin(apart), 0.0, 0.0])
    third = np.array([0.0, 0.0, 2.0, 0.0])
    return np.stack([one, other, third], axis=1)


def test_columns_that_differ_in_the_eighth_digit_are_the_same() -> None:
    """Their singular values are the angle over the square root of 2, and that root."""
    residuals = np.array([0.0, 0.0, 0.0, 3.0])
    errors, named = _standard_errors(nearly(2.2e-8), residuals)
    assert named == []
    assert np.isfinite(errors).all()
    errors, named = _standard_errors(nearly(1.8e-8), residuals)
    assert named == [0, 1]
    assert np.isnan(errors[:2]).all()
    assert errors[2] == pytest.approx(3.0 / 2.0)


@pytest.mark.parametrize(("share", "expected"), [(0.09, [0, 1]), (0.11, [0, 1, 2])])
def test_a_tenth_of_what_is_not_shown_is_enough_to_be_named(
    share: float, expected: list[int]
) -> None:
    """Columns u, v, w of length 1 with a u + b v + share w = 0, where u and w are orthogonal."""
    a = np.sqrt(0.5 - share**2)
    b = np.sqrt(a**2 + share**2)
    u, w = np.eye(4)[0], np.eye(4)[2]
    jacobian = np.stack([u, -(a * u + share * w) / b, w], axis=1)
    errors, named = _standard_errors(jacobian, np.ones(4))
    assert named == expected
    assert np.isnan(errors[named]).all()
    variance = 4.0  # of four ones with one degree of freedom
    expected_errors = np.sqrt(variance * np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
    rest = np.setdiff1d(np.arange(3), named)
    np.testing.assert_allclose(errors[rest], expected_errors[rest], rtol=1e-9)


def test_columns_that_are_next_to_nothing_are_null_where_units_are_comparable() -> None:
    jacobian = np.array([[1.0, 0.0], [0.0, 1e-7], [0.0, 0.0]])
    assert covariance(jacobian)[1].tolist() == [False, False]
    inverse, left_open = covariance(jacobian, 1e-6, 1e-6)
    assert left_open.tolist() == [False, True]
    assert inverse[0, 0] == pytest.approx(1.0)


# The search with a derivative, and profiles


def valley(point: Array) -> tuple[Array, Array]:
    """Rosenbrock's: residuals 10 (y - x^2) and 1 - x; the minimum is at (1, 1)."""
    x, y = point
    residuals = np.array([10.0 * (y - x * x), 1.0 - x])
    return residuals, np.array([[-20.0 * x, 10.0], [-1.0, 0.0]])


FREE = np.full(2, np.inf)


def test_the_minimum_of_a_curved_valley() -> None:
    found = minimum(valley, np.array([-1.2, 1.0]), -FREE, FREE)
    assert found.point == pytest.approx([1.0, 1.0], abs=1e-6)
    assert found.cost < 1e-12
    assert not found.held.any()


def test_a_bound_holds_and_the_others_go_on() -> None:
    """With x at most 0.5 the rest is smallest at y = x^2: cost 0.25."""
    found = minimum(valley, np.array([-1.2, 1.0]), -FREE, np.array([0.5, np.inf]))
    assert found.point == pytest.approx([0.5, 0.25], abs=1e-6)
    assert found.cost == pytest.approx(0.25)
    assert found.held.tolist() == [True, False]


def test_a_start_outside_is_moved_inside_and_a_held_parameter_stays() -> None:
    both = np.array([0.5, 0.7])
    found = minimum(valley, np.array([9.0, 9.0]), both, both)
    assert found.point.tolist() == [0.5, 0.7]


def test_a_profile_of_a_parabola_ends_where_it_has_risen() -> None:
    """3 + (x - 1)^2 / 4 rises by 9 at 1 + 6, and at 1 - 6."""
    for step in (0.01, 100.0, -0.3):
        end = profile_limit(lambda x: 3.0 + (x - 1.0) ** 2 / 4.0, 1.0, step, 9.0)
        assert end == pytest.approx(1.0 + np.sign(step) * 6.0, rel=1e-5)
    with pytest.raises(ValueError, match="no limit on that side"):
        profile_limit(lambda x: 0.0 * x, 1.0, 0.1, 9.0)
