"""The search against scipy and closed forms: starts, losses, interruption, intervals."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from campaign.arrays import Array
from campaign.estimate import Origin
from campaign.estimation.intervals import NO_FREEDOM
from campaign.estimation.linear_uncertainty import INTERRUPTED, NOT_DETERMINED
from campaign.estimation.losses import cost
from campaign.estimation.multi_start import (
    Progress,
    SearchResult,
    Settings,
    Start,
    agreeing,
    fit_from,
    make_starts,
    search,
)
from campaign.estimation.objective import Objective, Values
from campaign.estimation.unknowns import Unknown

from .coverage import holds, rejected

X = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
Y = np.array([1.1, 2.9, 5.2, 6.8, 9.1, 11.4])
LINE = (Unknown("offset", -10.0, 10.0, 0.0), Unknown("slope", -10.0, 10.0, 0.0))
ONE = Settings(starts=1, tolerance=1e-12)


def line(values: Values) -> Array:
    return np.asarray(Y - values[0] - values[1] * X)


# One optimum


def test_a_straight_line_is_that_of_the_normal_equations() -> None:
    """Values, standard errors with n - k degrees of freedom, correlation, and Student's t."""
    found = search(Objective(LINE, line), replace(ONE, stated=False))
    design = np.stack([np.ones(6), X], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    expected = inverse @ design.T @ Y
    residuals = Y - design @ expected
    deviation = np.sqrt(residuals @ residuals / (6 - 2))
    assert list(found.values.values()) == pytest.approx(expected, rel=1e-7)
    assert found.residuals == pytest.approx(residuals, abs=1e-6)
    assert found.cost == pytest.approx(0.5 * residuals @ residuals)
    assert found.uncertainty.scatter == pytest.approx(deviation)
    share = inverse[0, 1] / np.sqrt(inverse[0, 0] * inverse[1, 1])
    assert found.uncertainty.correlation[0, 1] == pytest.approx(share)
    assert found.uncertainty.correlation[1, 1] == pytest.approx(1.0)
    told = found.estimates({"slope": "m"})
    for index, name in enumerate(("offset", "slope")):
        error = deviation * np.sqrt(inverse[index, index])
        assert told[name].standard_error == pytest.approx(error, rel=1e-6)
        assert told[name].half_width == pytest.approx(2.7764451 * error, rel=1e-6)  # t(4)
        assert told[name].freedom == 4
    assert told["slope"].unit == "m"


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "cauchy"])
def test_a_decay_with_an_outlier_is_scipys(loss: str) -> None:
    """Without bounds, in the parameters themselves, with scipy's own differences."""
    x = np.linspace(0.0, 3.0, 20)
    y = 2.0 * np.exp(-1.5 * x) + 0.05 * np.cos(40.0 * x)
    y[7] += 3.0

    def residuals(values: Values) -> Array:
        return np.asarray((values[0] * np.exp(-values[1] * x) - y) / 0.1)

    theirs = least_squares(residuals, [1.0, 1.0], loss=loss, xtol=1e-14, ftol=1e-14)
    unknowns = (Unknown("size", 0.1, 10.0, 1.0, logarithmic=True), Unknown("rate", 0.0, 5.0, 1.0))
    settings = Settings(starts=1, loss=loss, tolerance=1e-12)  # type: ignore[arg-type]
    objective = Objective(unknowns, residuals, step=1e-6)
    found = search(objective, settings)
    assert list(found.values.values()) == pytest.approx(theirs.x, rel=1e-4)
    assert found.cost == pytest.approx(theirs.cost, rel=1e-8)
    assert found.cost_before == pytest.approx(cost(settings.loss, residuals((1.0, 1.0))))


def test_residuals_that_do_not_count_change_nothing() -> None:
    """The last point, moved by a hundred, is left out: the line through the others."""

    def spoilt(values: Values) -> Array:
        return line(values) + np.array([0, 0, 0, 0, 0, 100.0])

    objective = Objective(LINE, spoilt)
    found = fit_from(objective, objective.start, ONE, used=np.arange(6) < 5)
    slope, offset = np.polyfit(X[:5], Y[:5], 1)
    assert 20 * found.end - 10 == pytest.approx([offset, slope], rel=1e-6)


# Several optima

SECONDS = np.linspace(0.0, 10.0, 60)
SWING = (Unknown("rate", 0.1, 9.0, 7.0), Unknown("phase", -3.0, 3.0, 0.0))


def swing(values: Values) -> Array:
    """sin(3.1 t + 1), of which a fit finds other rates as well, each in its own valley."""
    return np.sin(values[0] * SECONDS + values[1]) - np.sin(3.1 * SECONDS + 1.0)


def test_one_start_fails_and_several_find_it() -> None:
    alone = search(Objective(SWING, swing), replace(ONE, tolerance=1e-8))
    assert alone.cost > 5.0
    shown: list[Progress] = []
    settings = Settings(starts=20, tolerance=1e-8)
    found = search(Objective(SWING, swing), settings, shown.append)
    assert found.values == pytest.approx({"rate": 3.1, "phase": 1.0}, abs=1e-6)
    assert len(found.starts) == 20
    assert found.starts[0].cost == pytest.approx(alone.cost)
    near = [abs(start.end[0] - SWING[0].share(3.1)) < 1e-4 for start in found.starts]
    assert 1 <= sum(near) == found.agreeing < 20
    assert {start.reason for start in found.starts} == {"converged"}
    assert (shown[0].phase, shown[-1].phase) == ("start 1 of 20", "start 20 of 20")
    best = [progress.best for progress in shown]
    assert best == sorted(best, reverse=True)
    assert best[-1] == found.cost == min(progress.cost for progress in shown)


def test_a_better_point_than_any_end_counts() -> None:
    """The start is the optimum, and later fits that may take one step only end elsewhere."""
    unknowns = (replace(SWING[0], start=3.1), replace(SWING[1], start=1.0))
    found = search(Objective(unknowns, swing), Settings(starts=3, max_evaluations=1))
    assert found.values == pytest.approx({"rate": 3.1, "phase": 1.0})
    assert [start.reason for start in found.starts][1:] == ["stopped after max_evaluations"] * 2


def test_starts_follow_from_the_seed_and_keep_clear_of_the_bounds() -> None:
    first = np.array([0.0, 1.0])
    one, other = make_starts(first, 200, 3), make_starts(first, 200, 3)
    np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(one[0], first)
    assert not np.array_equal(make_starts(first, 2, 4)[1], one[1])
    others = np.array(one[1:])
    assert 0.05 <= others.min() < 0.07
    assert 0.93 < others.max() <= 0.95


def test_agreement_is_within_a_hundredth() -> None:
    def ended(*costs: float) -> list[Start]:
        return [Start(np.zeros(1), each, "converged") for each in costs]

    assert agreeing([]) == 0
    assert agreeing(ended(0.012, 0.001, 0.0109)) == 1 + 1  # within 0.01 of the best cost
    assert agreeing(ended(50.4, 50.0, 50.6)) == 2  # within 1 % of it
    # Exact fits agree, and small residuals are no agreement.
    assert agreeing(ended(1e-6, 2e-6), 1e-12) == 1
    assert agreeing(ended(1e-20, 2e-18), 1e-12) == 2


def test_a_loss_that_curbs_needs_a_size_to_curb_from() -> None:
    with pytest.raises(ValueError, match="soft_l1 needs residuals in standard deviations"):
        Settings(loss="soft_l1", stated=False)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_residuals_that_state_no_deviation_decides_nothing(unit: float) -> None:
    settings = Settings(starts=6, stated=False)
    plain = search(Objective(SWING, swing), settings)
    other = search(Objective(SWING, lambda values: unit * swing(values)), settings)
    assert other.values == pytest.approx(plain.values, rel=1e-6)
    assert other.agreeing == plain.agreeing
    ends = [start.cost for start in plain.starts]
    assert [start.cost / unit**2 for start in other.starts] == pytest.approx(ends, rel=1e-6)
    one, two = (found.estimates({})["rate"] for found in (plain, other))
    assert two.half_width == pytest.approx(one.half_width, rel=1e-3)


PAGE = Path(__file__).parents[2] / "docs" / "developers" / "estimators.md"


def test_the_example_of_the_page_finds_what_most_fits_miss() -> None:
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    names: dict[str, Any] = {}
    exec(compile(blocks[0], "estimators.md", "exec"), names)
    assert holds(names["frequency"], 3.1)
    assert 0 < names["frequency"].half_width < 0.01
    assert 1 <= names["found"].agreeing < 10
    first = names["found"].starts[0]
    assert names["found"].cost < 0.1 * first.cost


# Interruption


def interrupted_at(step: int) -> tuple[SearchResult, list[Progress]]:
    shown: list[Progress] = []

    def press(progress: Progress) -> None:
        shown.append(progress)
        if len(shown) == step:
            raise KeyboardInterrupt

    return search(Objective(SWING, swing), Settings(starts=5), press), shown


@pytest.mark.parametrize("step", [1, 2, 5, 12, 30])
def test_ctrl_c_keeps_the_best_point_seen(step: int) -> None:
    found, shown = interrupted_at(step)
    assert found.interrupted
    assert len(shown) == step
    lowest = min(found.cost_before, *(progress.cost for progress in shown))
    assert found.cost == lowest == cost("linear", swing(tuple(found.values.values())))
    np.testing.assert_array_equal(found.residuals, swing(tuple(found.values.values())))
    assert len(found.starts) == len({progress.phase for progress in shown}) - 1
    assert found.uncertainty is None
    assert found.jacobian is None
    told = found.estimates({})["rate"]
    assert (told.value, told.reason) == (found.values["rate"], INTERRUPTED())
    assert not told.has_interval


def test_ctrl_c_while_the_derivatives_are_taken_keeps_the_fits() -> None:
    whole = search(Objective(LINE, line), ONE)
    objective = Objective(LINE, line)

    def stop(values: Values) -> Array:
        if objective.evaluations >= counted:
            raise KeyboardInterrupt
        return line(values)

    counting = Objective(LINE, line)
    search(counting, ONE)
    counted = counting.evaluations - 4  # the central differences come last
    objective = Objective(LINE, stop)
    found = search(objective, ONE)
    assert found.interrupted
    assert found.cost == whole.cost
    assert len(found.starts) == 1
    assert found.uncertainty is None


def test_ctrl_c_before_anything_is_known_is_passed_on() -> None:
    def stop(values: Values) -> Array:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(Objective(LINE, stop), ONE)


# What is not determined, and bounds


def test_of_what_shows_only_as_a_sum_neither_is_determined() -> None:
    unknowns = (*LINE, Unknown("other", -10.0, 10.0, 1.0))

    def summed(values: Values) -> Array:
        return line((values[0] + values[2], values[1]))

    told = search(Objective(unknowns, summed), replace(ONE, stated=False)).estimates({})
    for name in ("offset", "other"):
        assert told[name].origin is Origin.NOT_DETERMINED
        assert told[name].reason in NOT_DETERMINED
        assert not told[name].has_interval
    assert told["slope"].origin is Origin.MEASURED
    # 0.04877 is the slope's error with 4 degrees of freedom; a third parameter takes one.
    alone = search(Objective(LINE, line), replace(ONE, stated=False)).estimates({})["slope"]
    assert told["slope"].standard_error == pytest.approx(
        np.sqrt(4 / 3) * (alone.standard_error or 0.0), rel=1e-4
    )


def test_no_spare_residual_is_a_reason() -> None:
    found = search(Objective(LINE, lambda values: line(values)[:2]), ONE)
    for told in found.estimates({}).values():
        assert told.reason in NO_FREEDOM
        assert told.origin is Origin.NOT_DETERMINED


@pytest.mark.parametrize("logarithmic", [False, True])
def test_a_bound_is_a_bound_and_the_limit_is_one_sided(logarithmic: bool) -> None:
    """The slope of the line is 2.06 ± 0.14 and may be no less than 2.3."""
    slope = Unknown("slope", 2.3, 10.0, 5.0, logarithmic)
    found = search(Objective((LINE[0], slope), line), replace(ONE, stated=False))
    told = found.estimates({})["slope"]
    assert told.origin is Origin.AT_BOUND
    assert (told.value, told.low) == (pytest.approx(2.3, abs=1e-3), None)
    assert 2.3 < told.high < 2.6
    mirrored = Unknown("slope", -10.0, -2.3, -5.0)
    turned = search(
        Objective((LINE[0], mirrored), lambda v: line((v[0], -v[1]))), replace(ONE, stated=False)
    ).estimates({})["slope"]
    assert turned.high is None
    if not logarithmic:
        assert turned.low == pytest.approx(-told.high, rel=1e-4)


# Intervals over repetitions, seeds fixed before looking


@pytest.mark.slow
def test_intervals_of_a_decay_hold() -> None:
    """A mildly nonlinear model: ln a and b of a exp(-b x), errors a tenth of a, 20 points."""
    x = np.linspace(0.0, 3.0, 20)
    unknowns = (Unknown("size", 0.1, 10.0, 1.0, logarithmic=True), Unknown("rate", 0.0, 5.0, 1.0))
    truth = {"size": 2.0, "rate": 1.5}
    clean = truth["size"] * np.exp(-truth["rate"] * x)
    held: dict[str, list[bool]] = {}
    for seed in range(400):
        y = clean + 0.1 * np.random.default_rng(seed).standard_normal(20)
        for stated in (True, False):

            def residuals(
                values: Values, y: Array = y, size: float = 0.1 if stated else 1.0
            ) -> Array:
                return np.asarray((values[0] * np.exp(-values[1] * x) - y) / size)

            settings = Settings(starts=1, stated=stated)
            told = search(Objective(unknowns, residuals), settings).estimates({})
            for name, value in truth.items():
                held.setdefault(f"{name}, stated {stated}", []).append(holds(told[name], value))
    unstated = {case: each for case, each in held.items() if "False" in case}
    assert rejected(unstated) == {}
    assert rejected(held, "less") == {}  # stated deviations are never narrowed: a little wide
