"""What noise may hide from the fit of one interface, on curves of two in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.bristle_fit import BristleFit, fit_bristles, one_interface
from campaign.estimation.hidden_interface import hidden_shift
from campaign.estimation.presliding import HIDDEN, NOT_RESOLVED, fit_presliding
from campaign.estimation.presliding_curve import Interface
from campaign.estimation.torque_ramp import ramp_of
from tests.estimation.test_ramp_coverage import REST, bending

ALL = 36.0


def single(noise: float, *interfaces: Interface) -> BristleFit:
    """One interface fitted to the ramp of all of them."""
    time, rate, torque = bending(*interfaces)
    rate = rate + noise * np.random.default_rng(1).normal(size=len(rate))
    ramp = ramp_of(time, rate, torque, REST, 0.8 * ALL)
    return fit_bristles(ramp, 0.05 * ALL, one_interface(ramp, ALL))


@pytest.mark.parametrize(("share", "earlier"), [(0.1, 20.0), (0.2, 10.0), (0.15, 300.0)])
def test_without_noise_the_pair_that_is_there_is_the_only_one_left(
    share: float, earlier: float
) -> None:
    strong = Interface(13_000.0, ALL * (1.0 - share))
    weak = Interface(earlier * 13_000.0 * share / (1.0 - share), ALL * share)
    one = single(1e-5, strong, weak)
    fitted, found = one.interfaces[0].stiffness, hidden_shift(one)
    assert 1.0 - found.stiffness == pytest.approx(strong.stiffness / fitted, rel=0.05)
    total = strong.stiffness + weak.stiffness
    assert 1.0 + found.at_rest == pytest.approx(total / fitted, rel=0.05)


def test_a_single_interface_hides_less_the_less_noise_there_is() -> None:
    shifts = [hidden_shift(single(noise, Interface(13_000.0, ALL))) for noise in (1e-5, 5e-4, 3e-3)]
    assert shifts[0] == (0.0, 0.0)
    assert 0.0 < shifts[1].stiffness < shifts[2].stiffness < 1.0
    assert 0.0 < shifts[1].at_rest < 1.0
    assert shifts[2].at_rest > 30.0  # as good as rigid: no upper bound


def test_what_may_be_hidden_widens_an_interval_until_it_is_a_bound() -> None:
    time, rate, torque = bending(Interface(13_000.0, ALL))
    found = {}
    for noise in (1e-5, 5e-4, 2e-3):
        noisy = rate + noise * np.random.default_rng(2).normal(size=len(rate))
        found[noise] = fit_presliding(time, noisy, torque, REST, ALL)
    clear, near, below = (each.stiffness_at_rest for each in found.values())
    sources = [{part.source for part in each.systematic} for each in (clear, near, below)]
    assert [HIDDEN in each for each in sources] == [False, True, False]
    assert clear.half_width < 0.01 * clear.value < 0.1 * near.half_width
    assert (below.kind, below.has_interval) == ("at least", False)
    assert below.reason in NOT_RESOLVED
    strongest = found[2e-3].stiffness
    assert strongest.kind == "at most"
    assert strongest.reason in NOT_RESOLVED
    assert below.value < 13_000.0 < strongest.value
