"""Vectors of lanes compute what single numbers do, to the bit."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
import pytest

from campaign.physics import elementary
from campaign.physics.blocks import zeros
from campaign.physics.elementary import any_of, where
from campaign.physics.equal_interfaces import alike, side_by_side
from campaign.physics.rows import ANSWERS, HAS, KEEPS, MEETS, MEETS_RATE_END, MEETS_RATE_MEAN
from campaign.physics.step_function import Motion, compiled_step
from campaign.physics.vector import CACHE_LINE, LANES, add_up, by_lanes, each_lane

ARGUMENTS = np.concatenate([
    np.random.default_rng(1).normal(size=992) * np.repeat([1e-8, 1e-2, 1.0, 30.0], 248),
    [0.0, -0.0, np.inf, -np.inf, np.nan, 1e-320, 709.0, 709.9, -706.9, -707.1, -745.0, 1e300],
    [-1e300, 1e-18, -39.9, -40.1, 20.1, -20.1, 0.5, 1.0, -1.0, 2.0, 3.0, 4.0],
    [1e16, -1e16, 1e6, 5.0, 6.0, 7.0, 8.0, 9.0],
])  # fmt: skip


def by(lanes: int, function: Callable[..., Any], arguments: np.ndarray) -> np.ndarray:
    """`function` of all arguments, compiled for vectors of so many lanes."""

    @numba.njit(error_model="numpy")
    def run(given: Any, found: Any) -> None:
        x, y = by_lanes(given, lanes), by_lanes(found, lanes)
        for n in range(x.shape[0]):
            y[n] = function(x[n])

    found = np.empty((len(arguments) // lanes, lanes))
    run(arguments.reshape(found.shape), found)
    return found.ravel()


@cache
def alone(name: str) -> np.ndarray:
    """An elementary function of all arguments, one by one: compiled once for all vectors."""
    return by(1, getattr(elementary, name), ARGUMENTS)


@numba.njit(error_model="numpy", inline="always")
def _operations(x: Any) -> Any:
    larger = where(x > 1.0, x, 2.0 - x)
    larger += 0.5 * abs(x) / (1.0 + x * x)
    return where(x != x, -1.0, where(x <= -3.0, -larger, larger - 1))


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [2, 4, LANES])
@pytest.mark.parametrize("name", ["exp", "expm1", "log", "sin", "cos", "tanh", "nearest"])
def test_elementary_functions(name: str, lanes: int) -> None:
    arguments = ARGUMENTS[: len(ARGUMENTS) // lanes * lanes]
    one, many = alone(name)[: len(arguments)], by(lanes, getattr(elementary, name), arguments)
    undefined = np.isnan(one)
    assert (np.isnan(many) == undefined).all()
    assert one[~undefined].tobytes() == many[~undefined].tobytes()


def test_operators() -> None:
    """Against numpy, which rounds as IEEE 754 has it."""
    x = ARGUMENTS
    with np.errstate(all="ignore"):
        larger = np.where(x > 1.0, x, 2.0 - x) + 0.5 * np.abs(x) / (1.0 + x * x)
        expected = np.where(np.isnan(x), -1.0, np.where(x <= -3.0, -larger, larger - 1.0))
    np.testing.assert_array_equal(by(LANES, _operations, x), expected)


@pytest.mark.parametrize("lane", [0, 7, LANES - 1, None])
def test_any_of_looks_into_every_lane(lane: int | None) -> None:
    @numba.njit(error_model="numpy", inline="always")
    def marked(x: Any) -> Any:
        return where(any_of(x > 0.0), 1.0, 0.0) + 0.0 * x

    numbers = -np.ones(LANES)
    if lane is not None:
        numbers[lane] = 1.0
    assert (by(LANES, marked, numbers) == (lane is not None)).all()


def test_a_total_grows_lane_after_lane() -> None:
    @numba.njit(error_model="numpy")
    def total_of(numbers: Any) -> float:
        return add_up(1.0, by_lanes(numbers, 4)[0])

    numbers = np.array([[1e16, 1.0, -1e16, 0.5]])
    assert total_of(numbers) == 1.0 + 1e16 + 1.0 - 1e16 + 0.5 == 0.5  # in another order 2.5


@pytest.mark.parametrize("lanes", [1, LANES])
def test_what_a_vector_cannot_do_is_done_lane_by_lane(lanes: int) -> None:
    @numba.njit(error_model="numpy")
    def clip(numbers: Any) -> None:
        single = each_lane(by_lanes(numbers, lanes))
        for row in range(single.shape[0]):
            for lane in range(single.shape[1]):
                if single[row, lane] < 0.0:
                    single[row, lane] = 0.0

    numbers = np.random.default_rng(5).normal(size=(3, lanes))
    expected = np.maximum(numbers, 0.0)
    clip(numbers)
    np.testing.assert_array_equal(numbers, expected)


def test_rows_of_lanes_begin_where_cache_lines_do() -> None:
    assert all(zeros(n, LANES).ctypes.data % CACHE_LINE == 0 for n in range(1, 20))


def test_only_neighbours_of_one_kind_are_asked_together() -> None:
    def parts(kinds: str, alone: str) -> str:
        groups = alike(list(kinds), [mark == "x" for mark in alone])
        return " ".join(kinds[group] for group in groups)

    assert parts("aabaab", "......") == "aa b aa b"
    assert parts("aaaaaaa", ".......") == "aaaa aa a"  # vectors have a power of two of lanes
    assert parts("aaaaaa", "...x..") == "aa a a aa"
    assert parts("", "") == ""


def _branching(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """No vector can do this: it goes lane by lane."""
    if motion.rate_mean > 0.5:
        state[0] = state[0] + parameters[0]
    return state[0] * motion.rate_mean, parameters[0]


def _selecting(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """The same for vectors."""
    state[0] = where(motion.rate_mean > 0.5, state[0] + parameters[0], state[0])
    return state[0] * motion.rate_mean, parameters[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "lanes", "members"),
    [  # what goes by single numbers anyway needs no vector of every kind
        (_branching, LANES, 2),
        *((_selecting, *sizes) for sizes in ((1, 4), (LANES, 1), (LANES, 2))),
    ],
)
def test_step_functions_of_many_interfaces_and_lanes(step: Any, lanes: int, members: int) -> None:
    """The sum of what each interface answers, in their order, and what each one keeps."""
    random = np.random.default_rng(3)
    fixed = np.ones((HAS + 1, members, lanes))
    fixed[HAS] = random.normal(size=(members, lanes))
    kept = random.normal(size=(KEEPS + 1, members, lanes))
    met, answer = np.ones((MEETS, lanes)), np.zeros((ANSWERS, lanes))
    met[2] = random.uniform(0.0, 1.0, lanes)
    state = np.where(met[2] > 0.5, kept[KEEPS] + fixed[HAS], kept[KEEPS])
    mean, change = np.zeros(lanes), np.zeros(lanes)
    for member in range(members):
        mean, change = mean + state[member] * met[2], change + fixed[HAS, member]
    run = compiled_step(step, lanes, members, 1, 1).ctypes
    doubles = run.argtypes[0]
    run(*(ctypes.cast(each.ctypes.data, doubles) for each in (fixed, kept, met, answer)))
    assert kept[KEEPS].tobytes() == state.tobytes()
    assert answer[0].tobytes() == mean.tobytes()
    assert answer[1].tobytes() == change.tobytes()


def test_a_group_has_its_rows_together() -> None:
    rows = np.arange(24.0).reshape(3, 4, 2)
    arranged = side_by_side(rows, [slice(0, 2), slice(2, 3)])
    np.testing.assert_array_equal(arranged[:2].reshape(4, 2, 2), rows[:2].swapaxes(0, 1))
    np.testing.assert_array_equal(arranged[2], rows[2])


def signs(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """Truth values as numbers: Python's idiom for a sign without a branch."""
    v = motion.rate_mean
    sign = (v > 0.0) * 1 - (v < 0.0) * 1
    return where(sign < 0, -parameters[0], parameters[0]), 1.0 * sign


def ordered(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    v, end = motion.rate_mean, motion.rate_end
    return where((v > 0.0) > (end > 0.0), parameters[0], 2.0 * parameters[0]), 0.0


def counted(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    v, end = motion.rate_mean, motion.rate_end
    return parameters[0] * ((v > 0.0) + (end > 0.0)), 0.0


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (signs, lambda v, end: (v, v)),
        (ordered, lambda v, end: (1.0 if v > 0.0 > end else 2.0, 0.0)),
        (counted, lambda v, end: (float((v > 0.0) + (end > 0.0)), 0.0)),
    ],
    ids=["signs", "ordered", "counted"],
)
def test_truth_values_are_numbers_in_company_too(step: Any, expected: Any) -> None:
    """In one bit they would be others: such a function is computed lane by lane."""
    rates = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)]
    fixed, kept = np.ones((HAS + 1, 1, LANES)), np.zeros((KEEPS, 1, LANES))
    met, answer = np.ones((MEETS, LANES)), np.zeros((ANSWERS, LANES))
    for lane in range(LANES):
        met[MEETS_RATE_MEAN, lane], met[MEETS_RATE_END, lane] = rates[lane % 4]
    run = compiled_step(step, LANES, 1, 1, 0).ctypes
    doubles = run.argtypes[0]
    run(*(ctypes.cast(each.ctypes.data, doubles) for each in (fixed, kept, met, answer)))
    for lane in range(LANES):
        assert (answer[0, lane], answer[1, lane]) == expected(*rates[lane % 4])
