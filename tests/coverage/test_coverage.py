"""Intervals hold the truth of benches without a word of it: a sample; `make statistics` has all."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from campaign.physics.true_values import stribeck_parameters
from campaign.physics.variation import of_its_day
from tests.coverage.benches import BENCHES, INERTIA_ERROR, TORQUE_CONSTANT_ERROR, make_case
from tests.coverage.bounds import NAMES, _curve, _slope
from tests.coverage.judging import Entry, entries, holm, pooled
from tests.coverage.laboratory import KINDS, execute, options_for, plan, run
from tests.coverage.truths import Array, Truths, largest_friction, loop_numbers

SAMPLE = range(0, 12, 2)
"""Benches of the sample."""
DRAWS = {"velocity_map": 3, "breakaway": 1, "frequency_response": 2, "stabilization": 3}


def estimated(kind: str, benches: Iterable[int], draws: int) -> Iterator[Entry]:
    for number in benches:
        case = make_case(number)
        for draw in range(draws):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                yield from entries(run(case, kind, draw), draw)


def judge(found: Iterable[Entry]) -> None:
    short = [
        f"{group.kind}: {group.parameter} holds in {group.held} of {group.of}"
        for group in pooled(found)
        if group.short
    ]
    assert not short, "\n".join(short)


@pytest.mark.slow
def test_a_sample_of_maps_and_waves_holds() -> None:
    """Six benches: what holds in two of six or fewer is found."""
    found = [*estimated("velocity_map", SAMPLE, 1), *estimated("stabilization", SAMPLE, 1)]
    assert {entry.bench for entry in found} == set(SAMPLE)
    assert len({entry.parameter for entry in found}) >= 16
    judge(found)


@pytest.mark.statistics
@pytest.mark.parametrize("kind", KINDS)
def test_all_benches_hold(kind: str) -> None:
    judge(estimated(kind, range(BENCHES), DRAWS[kind]))


@pytest.mark.statistics
def test_little_is_hidden() -> None:
    """At most a tenth is not determined where a tenth of the value could be known."""
    groups = pooled(estimated("velocity_map", range(BENCHES), 1))
    hidden = {g.parameter: g.hidden for g in groups if g.hidden[1] and g.undetermined}
    assert all(count <= 0.1 * of for count, of in hidden.values()), hidden


# --- the benches -------------------------------------------------------------------------------


def test_the_benches_are_unlike_each_other() -> None:
    cases = [make_case(number) for number in range(1, BENCHES)]
    inertias = [case.truth.axis.inertia for case in cases]
    ratios = [case.truth.gear.ratio for case in cases]
    bits = [math.log2(2.0 * math.pi / case.truth.sensors.encoder.resolution) for case in cases]
    assert min(inertias) < 0.02
    assert max(inertias) > 50.0
    assert min(ratios) < 3.0
    assert max(ratios) > 150.0
    assert round(min(bits)) == 10
    assert round(max(bits)) == 20
    below = [
        case
        for case in cases
        if (p := stribeck_parameters(case.truth, 1.0))["static_torque"] < p["coulomb_torque"]
    ]
    assert 4 <= len(below) <= 14
    assert sum(len(case.truth.friction) > 1 for case in cases) >= 8


def test_what_is_stated_is_off_and_has_no_friction() -> None:
    cases = [make_case(number) for number in range(BENCHES)]
    assert all(not case.stated.friction and case.stated.variation is None for case in cases)
    constants = np.array([1.0 / case.torque_ratio - 1.0 for case in cases])
    inertias = np.array([c.stated.axis.inertia / c.truth.axis.inertia - 1.0 for c in cases])
    for errors, size in ((constants, TORQUE_CONSTANT_ERROR), (inertias, INERTIA_ERROR)):
        assert 0.6 * size < np.sqrt(np.mean(errors**2)) < 1.4 * size
        assert np.max(np.abs(errors)) <= 2.0 * size + 1e-12


def test_a_case_is_the_same_whenever_it_is_made() -> None:
    assert make_case(7) == make_case(7)
    one, other = plan(make_case(7), "velocity_map"), plan(make_case(7), "velocity_map", draw=1)
    assert one[0].seed != other[0].seed
    assert one[0].truth == other[0].truth


def test_nothing_of_the_truth_is_recorded() -> None:
    case = make_case(4)
    (done,) = execute(case, plan(case, "stabilization")[:1])
    assert all(channel.measured for channel in done.samples.channels.values())


# --- the truths --------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_loop_of_platform_is_known() -> None:
    """As whole sweeps find it that have a point every 0.1 or 0.2 Hz: 7.158 Hz and 70.74 degrees (at
    34 deg/s); 30.99 dB by one to 300 Hz."""
    found = loop_numbers(make_case(0), options_for(make_case(0), "frequency_response")[0])
    assert found["bandwidth"] == pytest.approx(7.158, rel=0.0005)
    assert math.degrees(found["phase_margin"]) == pytest.approx(70.74, abs=0.03)
    assert found["gain_margin"] == pytest.approx(30.99, abs=0.05)


def test_a_ramp_breaks_away_at_the_sum_of_all_interfaces() -> None:
    """Slowly enough the largest friction is Ts, less what the bristles still lag: a few percent."""
    case = make_case(4)
    trial = plan(case, "breakaway")[0]
    friction, _ = largest_friction(case, trial)
    static = stribeck_parameters(case.truth, 1.0)["static_torque"]
    amplitude = case.truth.friction["load"].ripple.amplitude
    assert 0.9 * static < friction < (1.0 + amplitude) * (1.0 + 4 * 0.004) * static


@pytest.mark.slow
def test_the_truth_of_a_wrong_exponent_is_the_closest_curve_of_its_kind() -> None:
    """Another optimiser, with a start of its own, finds the same curve; it is not the bench's."""
    from scipy.optimize import curve_fit

    done = run(make_case(0), "velocity_map")
    truths = Truths(done)
    fit = truths._map().fits["positive"]
    p = stribeck_parameters(of_its_day(done.case.truth), 1.0)

    def square(v: Array, viscous: float, coulomb: float, static: float, velocity: float) -> Array:
        return coulomb + (static - coulomb) * np.exp(-((v / velocity) ** 2)) + viscous * v

    names, sigma = NAMES[:4], fit.deviation
    start = [4.0, 25.0, 30.0, 0.02]
    closest, _ = curve_fit(square, fit.speed, _curve(p, fit.speed), p0=start, sigma=sigma)
    of = {
        finding.quantity: truths.of(finding)
        for finding in done.result.findings
        if finding.conditions == {"direction": "positive", "exponent": "2"}
    }
    assert [of[name] for name in names] == pytest.approx(closest, rel=1e-5)
    assert abs(of["static_torque"] - p["static_torque"]) > 0.01 * p["static_torque"]


# --- the judgement -----------------------------------------------------------------------------


def entry(**fields: object) -> Entry:
    made = Entry(
        1, 0, "velocity_map", "p", truth=1.0, value=1.0, low=0.9, high=1.1, held=True,
        combined=True, bias=0.0, half_width=0.1, bound=0.04, determined=True,
    )  # fmt: skip
    return replace(made, **fields)


def test_a_parameter_that_holds_too_seldom_is_found() -> None:
    """P(32 or fewer of 41 | 0.9) is 2.2 %, of 28 or fewer 2e-4: rejected, alone at 1 %."""
    for held, short in ((32, False), (28, True)):
        found = [entry(bench=k, held=k < held) for k in range(41)]
        assert [group.short for group in pooled(found)] == [short]


def test_holm() -> None:
    """Steps down: 0.01/3, 0.01/2, 0.01/1."""
    assert holm({"a": 0.003, "b": 0.004, "c": 0.02}, 0.01) == {"a", "b"}
    assert holm({"a": 0.004, "b": 0.004, "c": 0.02}, 0.01) == frozenset()


def test_what_is_not_determined_is_counted_where_it_could_be_known() -> None:
    open_ = {"determined": False, "value": None, "low": None, "high": None, "held": None}
    found = [entry(), entry(**open_), entry(**open_, bound=0.3)]
    (group,) = pooled(found)
    assert (group.of, group.undetermined, group.hidden) == (1, 2, (1, 2))


def test_the_bound_is_what_least_squares_reaches() -> None:
    """Weighted least squares of 4000 draws scatters by the bound, within 5 % (linear model)."""
    p = {
        "viscous_friction": 4.0, "coulomb_torque": 26.0, "static_torque": 33.0,
        "stribeck_velocity": 0.03, "stribeck_exponent": 1.0,
    }  # fmt: skip
    v = np.geomspace(0.003, 0.6, 16)
    s = 0.001 * _curve(p, v)
    jacobian = np.stack([_slope(p, name, v) for name in NAMES], axis=1) / s[:, None]
    bound = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    noise = np.random.default_rng(5).standard_normal((len(v), 4000))
    draws = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    assert np.std(draws, axis=1) == pytest.approx(bound, rel=0.05)
