"""Covariance and what a Jacobian leaves open, the small search, profiles: closed forms."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from campaign.arrays import Array
from campaign.estimation.least_squares import (
    covariance,
    gradients,
    minimum,
    profile_limit,
    propagated,
    refuse_too_few,
    straight_line,
)

# The Jacobian itself


@pytest.mark.parametrize("count", [1, 2])
def test_no_more_points_than_parameters_are_refused(count: int) -> None:
    """Two points give a line through both, and no word of how far it is off."""
    with pytest.raises(ValueError, match=f"{count} points cannot determine 2 .* 3 are the fewest"):
        refuse_too_few(count, 2)
    refuse_too_few(3, 2)


def errors(jacobian: Array) -> tuple[Array, list[int]]:
    """Standard errors for a residual deviation of 1, and the parameters that are left open."""
    inverse, left_open = covariance(jacobian)
    return np.sqrt(np.diag(inverse)), np.flatnonzero(left_open).tolist()


def test_the_units_of_a_parameter_decide_nothing() -> None:
    """Columns of 1e-9 and 1e9 are as independent as those of 1."""
    jacobian = np.random.default_rng(5).normal(size=(40, 3))
    plain, none = errors(jacobian)
    scale = np.array([1e-9, 1.0, 1e9])
    scaled, neither = errors(jacobian * scale)
    assert none == neither == []
    np.testing.assert_allclose(scaled, plain / scale, rtol=1e-9)
    expected = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    np.testing.assert_allclose(plain, expected, rtol=1e-9)


def nearly(apart: float) -> Array:
    """Two columns of length 1 that differ by `apart`, and a third across them."""
    one = np.array([1.0, 0.0, 0.0, 0.0])
    other = np.array([np.cos(apart), np.sin(apart), 0.0, 0.0])
    third = np.array([0.0, 0.0, 2.0, 0.0])
    return np.stack([one, other, third], axis=1)


def test_columns_that_differ_in_the_eighth_digit_are_the_same() -> None:
    """Their singular values are the angle over the square root of 2, and that root."""
    assert errors(nearly(2.2e-8))[1] == []
    found, named = errors(nearly(1.8e-8))
    assert named == [0, 1]
    assert found[2] == pytest.approx(1.0 / 2.0)


@pytest.mark.parametrize(("share", "expected"), [(0.09, [0, 1]), (0.11, [0, 1, 2])])
def test_a_tenth_of_what_is_not_shown_is_enough_to_be_named(
    share: float, expected: list[int]
) -> None:
    """Columns u, v, w of length 1 with a u + b v + share w = 0, where u and w are orthogonal."""
    a = np.sqrt(0.5 - share**2)
    b = np.sqrt(a**2 + share**2)
    u, w = np.eye(4)[0], np.eye(4)[2]
    jacobian = np.stack([u, -(a * u + share * w) / b, w], axis=1)
    found, named = errors(jacobian)
    assert named == expected
    truth = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)))
    rest = np.setdiff1d(np.arange(3), named)
    np.testing.assert_allclose(found[rest], truth[rest], rtol=1e-9)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_columns_that_are_next_to_nothing_are_null_where_units_are_comparable(unit: float) -> None:
    """A column of 1e-7 of the longest, as seen with a share of 1e-6 and of 1e-8."""
    jacobian = unit * np.array([[1.0, 0.0], [0.0, 1e-7], [0.0, 0.0]])
    assert covariance(jacobian)[1].tolist() == [False, False]
    assert covariance(jacobian, 1e-6, 1e-8)[1].tolist() == [False, False]
    inverse, left_open = covariance(jacobian, 1e-6, 1e-6)
    assert left_open.tolist() == [False, True]
    np.testing.assert_allclose(inverse, np.diag([unit**-2, 0.0]), rtol=1e-12)


def test_a_column_of_zeros_is_left_open_and_the_others_are_not() -> None:
    jacobian = np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    found, named = errors(jacobian)
    assert named == [1]
    assert found[0] == pytest.approx(np.sqrt(1 / 3))
    inverse, left_open = covariance(np.zeros((3, 2)))
    assert left_open.all()
    assert not inverse.any()
    assert covariance(np.array([[1.0, 0.0]]))[1].tolist() == [False, True]  # a single residual


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


@pytest.mark.parametrize(("lower", "upper", "x"), [(-np.inf, 0.5, 0.5), (1.5, np.inf, 1.5)])
def test_a_bound_holds_and_the_others_go_on(lower: float, upper: float, x: float) -> None:
    """With x held at 0.5 or at 1.5 the rest is smallest at y = x^2: cost 0.25."""
    ends = np.array([lower, -np.inf]), np.array([upper, np.inf])
    found = minimum(valley, np.array([-1.2, 1.0]), *ends)
    assert found.point == pytest.approx([x, x * x], abs=1e-6)
    assert found.cost == pytest.approx(0.25)
    assert found.held.tolist() == [True, False]
    with pytest.raises(FrozenInstanceError):
        found.point = np.zeros(2)  # type: ignore[misc]


@pytest.mark.parametrize("slope", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("optimum", "start"), [(2.0, 0.0), (2.0, 5.0), (-1.0, 0.0), (6.0, 5.0)])
def test_a_start_at_a_bound_leaves_it_only_inward(
    slope: float, optimum: float, start: float
) -> None:
    """A parabola between 0 and 5, flat or steep."""

    def parabola(point: Array) -> tuple[Array, Array]:
        return slope * (point - optimum), np.array([[slope]])

    found = minimum(parabola, np.array([start]), np.zeros(1), np.full(1, 5.0))
    assert found.point[0] == pytest.approx(np.clip(optimum, 0.0, 5.0), abs=1e-6)
    assert found.held[0] == (not 0.0 < optimum < 5.0)


@pytest.mark.parametrize("bound", [0.0, 5.0])
def test_an_optimum_at_a_bound_is_held(bound: float) -> None:
    """Without a slope there is nowhere to go, either."""
    found = minimum(
        lambda point: (point - bound, np.eye(1)), np.array([bound]), np.zeros(1), np.full(1, 5.0)
    )
    assert found.held.tolist() == [True]


def test_a_start_outside_is_moved_inside_and_a_held_parameter_stays() -> None:
    both = np.array([0.5, 0.7])
    found = minimum(valley, np.array([9.0, 9.0]), both, both)
    assert found.point.tolist() == [0.5, 0.7]


def test_a_profile_of_a_parabola_ends_where_it_has_risen() -> None:
    """3 + (x - 1)^2 / 4 rises by 9 at 1 + 6, and at 1 - 6."""
    for step in (0.01, 100.0, -0.3):
        end = profile_limit(lambda x: 3.0 + (x - 1.0) ** 2 / 4.0, 1.0, step, 9.0)
        assert end == pytest.approx(1.0 + np.sign(step) * 6.0, rel=1e-5)
    far = profile_limit(lambda x: 3.0 + (x - 1.0) ** 2 / 4.0, 1.0, 0.01, 9e8)
    assert far == pytest.approx(1.0 + 6e4, rel=1e-5)
    with pytest.raises(ValueError, match="no limit on that side"):
        profile_limit(lambda x: 0.0 * x, 1.0, 0.1, 9.0)


def test_derivatives_and_deviations_of_a_product_and_a_quotient() -> None:
    """Of a b and a / b at a = 2, b = 4, with deviations 0.1 and 0.2 and a covariance of 0.01."""

    def numbers(point: Array) -> Array:
        return np.array([point[0] * point[1], point[0] / point[1]])

    by = gradients(numbers, np.array([2.0, 4.0]), np.array([1e-4, 1e-3]))
    assert by == pytest.approx(np.array([[4.0, 2.0], [0.25, -0.125]]), rel=1e-6)
    covariance_ = np.array([[0.01, 0.01], [0.01, 0.04]])
    expected = np.sqrt([0.16 + 0.16 + 0.16, 0.000625 + 0.000625 - 0.000625])
    assert propagated(by, covariance_) == pytest.approx(expected, rel=1e-6)


def test_the_straight_line_is_that_of_a_regression() -> None:
    values = np.array([1.0, 3.0, 2.0, 7.0, 5.0])
    fitted = np.polyval(np.polyfit(np.arange(5.0), values, 1), np.arange(5.0))
    assert straight_line(values) == pytest.approx(fitted)
