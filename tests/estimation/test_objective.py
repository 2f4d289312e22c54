"""Evaluations are counted, remembered, and made together; derivatives against closed forms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from campaign.arrays import Array
from campaign.estimation.objective import Objective, Values
from campaign.estimation.unknowns import Unknown

UNKNOWNS = (Unknown("a", 0.0, 4.0, 1.0), Unknown("b", 1.0, 100.0, 10.0, logarithmic=True))


def residuals(values: Values) -> Array:
    a, b = values
    return np.array([a * a, a * np.log(b), 3.0 * np.log(b)])


def derivatives(values: Values) -> Array:
    a, b = values
    return np.array([[2 * a, 0.0], [np.log(b), a / b], [0.0, 3.0 / b]])


def by_shares(values: Values) -> Array:
    """By hand: da = 4 ds, d(ln b) = ln(100) ds."""
    a, b = values
    span = np.log(100.0)
    return np.array([[8 * a, 0.0], [4 * np.log(b), a * span], [0.0, 3 * span]])


def test_the_latest_point_is_remembered() -> None:
    objective = Objective(UNKNOWNS, residuals)
    np.testing.assert_allclose(objective.start, [0.25, 0.5], rtol=1e-12)
    for _ in range(3):
        np.testing.assert_allclose(objective.at(objective.start), residuals((1.0, 10.0)))
    assert objective.evaluations == 1
    objective.at(np.array([0.5, 0.5]))
    objective.at(objective.start)
    assert objective.evaluations == 3


def test_central_differences_of_parabolas_are_exact() -> None:
    objective = Objective(UNKNOWNS, residuals, step=0.1)
    found = objective.jacobian(objective.start, central=True)
    np.testing.assert_allclose(found, by_shares((1.0, 10.0)), rtol=1e-9, atol=1e-12)
    assert objective.evaluations == 1 + 4


def test_differences_to_one_side_are_off_by_the_step() -> None:
    """The parabola's chord over 0.4 of a: slope 2 a + 0.4, or 2 a - 0.4 where there is no room."""
    objective = Objective(UNKNOWNS, residuals, step=0.1)
    found = objective.jacobian(np.array([0.25, 0.5]), central=False)
    assert found[0, 0] == pytest.approx(4 * (2 * 1.0 + 0.4), rel=1e-9)
    assert objective.evaluations == 1 + 2
    found = objective.jacobian(np.array([0.95, 0.5]), central=False)
    assert found[0, 0] == pytest.approx(4 * (2 * 3.8 - 0.4), rel=1e-9)


@pytest.mark.parametrize("central", [True, False])
def test_no_difference_leaves_the_bounds(central: bool) -> None:
    seen: list[Values] = []

    def watched(values: Values) -> Array:
        seen.append(values)
        return residuals(values)

    objective = Objective(UNKNOWNS, watched, step=0.1)
    for point in ([0.0, 1.0], [1.0, 0.0], [0.05, 0.97]):
        objective.jacobian(np.array(point), central=central)
    a, b = np.array(seen).T
    assert a.min() >= 0.0
    assert a.max() <= 4.0
    assert b.min() >= 1.0 * (1 - 1e-12)
    assert b.max() <= 100.0 * (1 + 1e-12)


def test_several_at_once_give_the_same() -> None:
    batches: list[int] = []

    def together(sets: Sequence[Values]) -> list[Array]:
        batches.append(len(sets))
        return [residuals(values) for values in sets]

    alone, both = Objective(UNKNOWNS, residuals), Objective(UNKNOWNS, residuals, together)
    for central in (True, False):
        one, other = (each.jacobian(each.start, central=central) for each in (alone, both))
        np.testing.assert_array_equal(one, other)
    assert batches == [4, 2]
    assert alone.evaluations == both.evaluations == 1 + 4 + 2


def test_derivatives_that_are_handed_in_are_taken_by_shares() -> None:
    objective = Objective(UNKNOWNS, residuals, derivatives=derivatives)
    found = objective.jacobian(objective.start, central=False)
    np.testing.assert_allclose(found, by_shares((1.0, 10.0)), rtol=1e-12)
    assert objective.evaluations == 0
