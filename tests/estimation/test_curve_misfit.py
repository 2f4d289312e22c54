"""Residuals that neighboring speeds share widen intervals; scatter alone does not.

Expected numbers: friction and linear fits that are made up here; p-values are uniform.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import binomtest

from campaign.arrays import Array
from campaign.estimation.both_directions import fitted_nominal
from campaign.estimation.curve_misfit import SIGNIFICANCE, curve_misfit
from campaign.estimation.stribeck import PARAMETERS, stribeck
from campaign.estimation.velocity_map import (
    FORM,
    DirectionFit,
    direction_estimates,
    doubts,
    fit_direction,
)
from tests.estimation.coverage import holds

TRUE = dict(zip(PARAMETERS, (3.87, 25.3, 32.7, 0.0271, 0.96), strict=True))
SHARED = ("viscous_friction", "coulomb_torque", "static_torque")
"""What friction over speed has, whichever curve falls from Ts to Tc."""
BETWEEN = 0.002
Curve = Callable[[Array], Array]


def lorentzian(speed: Array) -> Array:
    """Steady friction of the model `armstrong` (Equation 3.5)."""
    return np.asarray(25.3 + 7.4 / (1.0 + (speed / 0.0271) ** 2) + 3.87 * speed)


def of_equation(speed: Array) -> Array:
    return stribeck(speed, TRUE)


def speeds(count: int) -> Array:
    return np.asarray(np.deg2rad(np.geomspace(0.1, 60.0, count)))


def fitted(curve: Curve, count: int, random: np.random.Generator) -> DirectionFit:
    speed = speeds(count)
    torque = curve(speed) * (1.0 + BETWEEN * random.normal(size=count))
    return fit_direction(speed, torque, np.full(count, 0.02))


@pytest.mark.parametrize("count", [16, 40, 80])
def test_intervals_hold_where_friction_follows_another_curve(count: int) -> None:
    """Without the part none held at 40 and 80 speeds; with it, more points make none narrower."""
    random = np.random.default_rng(5)
    for _ in range(5):
        found = fitted(lorentzian, count, random)
        assert found.curve_misfit is not None
        told = direction_estimates(found, "free")
        for name in SHARED:
            assert holds(told[name], TRUE[name]), name
            assert FORM in [part.source for part in told[name].systematic]
        assert told["coulomb_torque"].origin == "measured"
        assert any("neighboring speeds" in doubt for doubt in doubts(found))


def test_the_fast_branch_is_open_where_speeds_end_near_the_stribeck_velocity() -> None:
    """Seven times vs is less than half of the range: Tc missed by three half-widths there."""
    random, count = np.random.default_rng(10), 80
    speed = np.geomspace(1e-4, 0.2, count)
    torque = lorentzian(speed) * (1.0 + 0.0005 * random.normal(size=count))
    found = fit_direction(speed, torque, np.full(count, 0.002))
    told = direction_estimates(found, "free")
    for name in ("coulomb_torque", "viscous_friction"):
        assert told[name].origin == "not determined"
        assert told[name].reason.code == "misfit above vs"
    assert told["static_torque"].origin == "measured"
    assert holds(told["static_torque"], TRUE["static_torque"])
    nominal = fitted_nominal(found, found, "free")
    assert nominal["coulomb_torque"].origin == "not determined"


def test_more_points_do_not_average_a_misfit() -> None:
    """The part is the same at 20, 40, 80 and 160 speeds; scatter falls with the root of them."""
    random = np.random.default_rng(6)
    parts = [
        fitted(lorentzian, count, random).misfit_part("free", "coulomb_torque")
        for count in (20, 40, 80, 160)
    ]
    assert all(later > 0.7 * earlier for earlier, later in pairwise(parts))


@pytest.mark.parametrize("count", [8, 16, 40])
def test_maps_that_fit_keep_their_intervals(count: int) -> None:
    random = np.random.default_rng(7)
    maps = [fitted(of_equation, count, random) for _ in range(60)]
    alarms = [each for each in maps if each.curve_misfit is not None]
    assert binomtest(len(alarms), len(maps), SIGNIFICANCE, "greater").pvalue > 0.005
    for each in maps:
        if each.curve_misfit is None:
            assert each.misfit_part("free", "coulomb_torque") == 0.0
            assert not any("neighboring" in doubt for doubt in doubts(each))


@pytest.mark.parametrize(("count", "free"), [(7, 5), (12, 5), (40, 5), (16, 2)])
def test_p_values_are_those_of_scatter(
    count: int, free: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a linear fit with white residuals p is uniform: 2000 draws, shares within four sigmas."""
    monkeypatch.setattr("campaign.estimation.curve_misfit.SIGNIFICANCE", 1.0)
    p = p_values(count, free)
    for level in (0.02, 0.05, 0.5):
        share = np.mean(p < level)
        assert share == pytest.approx(level, abs=4.0 * np.sqrt(level * (1.0 - level) / 2000))


def p_values(count: int, free: int) -> Array:
    """Of 2000 linear fits with white residuals."""
    random, speed = np.random.default_rng(8), speeds(count)
    jacobian = np.stack([np.log(speed) ** power for power in range(free)], axis=1)
    influence = np.linalg.pinv(jacobian)
    torques = random.normal(size=(2000, count))
    found = [curve_misfit(speed, t - jacobian @ (influence @ t), influence) for t in torques]
    return np.array([1.0 if each is None else each.p for each in found])


def test_the_rarest_degrees_of_freedom_raise_few_false_alarms() -> None:
    """Of 8 speeds and 5 parameters the beta distribution is least exact."""
    assert np.mean(p_values(8, 5) < SIGNIFICANCE) < 0.05


def test_what_moves_a_parameter_is_as_large_as_it_is_said() -> None:
    """Differences of the assumed kind, of deviation 1, beside scatter of 0.1: 300 linear fits.

    The part is the deviation of what the fit takes for its parameters: within a quarter of it.
    """
    random, count = np.random.default_rng(9), 40
    speed = speeds(count)
    place = np.log(speed)
    jacobian = np.stack([np.ones(count), place - place.mean()], axis=1)
    influence = np.linalg.pinv(jacobian)
    length = float(np.ptp(place)) / 3.0
    alike = np.exp(-0.5 * (np.subtract.outer(place, place) / length) ** 2)
    root = np.linalg.cholesky(alike + 1e-9 * np.eye(count))
    moved, parts = [], []
    for _ in range(300):
        torque = root @ random.normal(size=count) + 0.1 * random.normal(size=count)
        found = curve_misfit(speed, torque - jacobian @ (influence @ torque), influence)
        moved.append((influence @ torque)[0])
        parts.append(0.0 if found is None else found.moves(influence[0]))
    size = float(np.sqrt(np.mean(np.square(moved))))
    assert float(np.sqrt(np.mean(np.square(parts)))) == pytest.approx(size, rel=0.25)


def test_exact_and_few_points_show_no_misfit() -> None:
    speed = speeds(6)
    influence = np.linalg.pinv(np.vander(np.log(speed), 5))
    assert curve_misfit(speed, np.ones(6), influence) is None  # one degree of freedom
    assert curve_misfit(speeds(12), np.zeros(12), np.zeros((2, 12))) is None


@pytest.mark.parametrize(("share", "scatters"), [(3.0, True), (1e3, False)])
def test_the_size_follows_from_two_moments(share: float, scatters: bool) -> None:
    """E r'r and E r'Kr over both variances, solved; without scatter r'r alone decides."""
    random, count = np.random.default_rng(4), 40
    speed, place = speeds(count), np.log(speeds(count))
    jacobian = np.stack([np.ones(count), place], axis=1)
    kernel = np.exp(-0.5 * ((place[:, None] - place) * 3.0 / np.ptp(place)) ** 2)
    rows = np.linalg.qr(jacobian, mode="complete")[0][:, 2:].T  # what no parameter follows
    within = rows @ kernel @ rows.T
    torque = random.multivariate_normal(np.zeros(count), np.eye(count) + share * kernel)
    rest = rows @ torque
    found = curve_misfit(speed, rows.T @ rest, np.linalg.pinv(jacobian))
    assert found is not None
    first = np.trace(within)
    moments = np.array([[len(rest), first], [first, np.sum(within**2)]])
    scatter, size = np.linalg.solve(moments, [rest @ rest, rest @ within @ rest])
    assert bool(scatter > 0.0) is scatters
    expected = size if scatters else rest @ rest / first
    assert found.covariance == pytest.approx(expected * kernel)
