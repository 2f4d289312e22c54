"""Margins of fitted loops: closed forms, coverage over random loops, bounds beyond the band."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest

from campaign.estimation.frequency.margins import (
    NOT_CROSSED,
    chosen_margins,
    fitted_margins,
    measured_margins,
)
from campaign.estimation.frequency.measured import closed_from_open
from campaign.estimation.frequency.orders import chosen_order
from campaign.estimation.frequency.rational import rational_fit
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.measured import noisy, scatter_as_told
from tests.estimation.loops import Truth, random_loop

# L = w / s exp(-s t): 0 dB at w, phase margin 90 deg - w t, -180 deg at pi / (2 t).
CROSSOVER, DELAY = 2 * math.pi * 5.0, 0.01
PHASE_MARGIN = math.pi / 2 - CROSSOVER * DELAY
GAIN_MARGIN = 20 * math.log10(math.pi / (2 * DELAY) / CROSSOVER)


def loop(frequency: np.ndarray) -> np.ndarray:
    s = 2j * np.pi * frequency
    return CROSSOVER / s * np.exp(-s * DELAY)


@pytest.mark.parametrize("closed", [False, True])
def test_an_integrator_with_a_delay_has_its_closed_form(closed: bool) -> None:
    frequency = np.geomspace(0.5, 60.0, 80)
    truth = loop(frequency)
    measured = noisy(frequency, truth, 1e-3 * np.abs(truth), np.random.default_rng(1))
    if closed:
        # T = w exp(-s t) / (s + w exp(-s t)) is no such function; up to the crossover it nearly is.
        kept = frequency < 12
        part = closed_from_open(measured).at(kept)
        found = chosen_margins(chosen_order(part), closed=True)
        assert found.phase_margin.value == pytest.approx(PHASE_MARGIN, abs=0.01)
        return
    found = fitted_margins(rational_fit(measured, (0, 1)))
    assert holds(found.phase_margin, PHASE_MARGIN)
    assert holds(found.gain_margin, GAIN_MARGIN)
    assert found.phase_margin.half_width < 0.002
    assert found.gain_margin.half_width < 0.1
    crossings = {each.level: each for each in found.crossings}
    assert crossings["0 dB"].frequency.value == pytest.approx(5.0, rel=1e-3)
    assert crossings["-180 deg"].frequency.value == pytest.approx(25.0, rel=1e-3)


def test_beyond_the_last_frequency_there_is_a_bound() -> None:
    frequency = np.geomspace(0.5, 15.0, 80)
    truth = loop(frequency)
    measured = noisy(frequency, truth, 1e-3 * np.abs(truth), np.random.default_rng(2))
    found = fitted_margins(rational_fit(measured, (0, 1)))
    assert found.gain_margin.kind == "at least"
    assert found.gain_margin.value == pytest.approx(20 * math.log10(3), abs=0.1)
    assert found.gain_margin.value < GAIN_MARGIN
    short = measured.at(frequency < 4.0)
    found = fitted_margins(rational_fit(short, (0, 1)))
    assert math.isnan(found.phase_margin.value)
    assert found.phase_margin.reason == NOT_CROSSED(side="above")
    assert (found.bandwidth.kind, found.bandwidth.value) == (
        "at least",
        pytest.approx(short.frequency[-1]),
    )


@pytest.mark.parametrize("count", [12, pytest.param(60, marks=pytest.mark.statistics)])
def test_margins_hold_the_truth_as_often_as_they_say(count: int) -> None:
    held: dict[str, list[bool]] = defaultdict(list)
    wide: dict[str, list[float]] = defaultdict(list)
    for seed in range(count):
        random = np.random.default_rng(seed)
        truth = random_loop(random)
        frequency = np.geomspace(truth.scale / 10, truth.scale * 12, 60)
        values = truth.loop(2j * np.pi * frequency)
        measured = noisy(
            frequency, values, random.choice([0.003, 0.01]) * np.abs(values), random, of=8
        )
        fitted = chosen_margins(chosen_order(measured))
        between = measured_margins(measured)
        for name in ("bandwidth", "phase_margin", "gain_margin"):
            told, expected = getattr(fitted, name), getattr(truth, name)
            if told.kind == "at least":
                held[name].append(told.value <= expected)
                continue
            held[name].append(holds(told, expected))
            wide[name].append(told.half_width / getattr(between, name).half_width)
    assert not rejected(held, "less")
    # A function through all points knows more than the points around a crossing.
    assert np.nanmedian(wide["phase_margin"]) < 0.7


@pytest.mark.parametrize("count", [24, pytest.param(120, marks=pytest.mark.statistics)])
def test_margins_near_the_last_frequency_hold_the_truth(count: int) -> None:
    """Loops with one crossing just before or behind it: intervals, open ends and bounds."""
    held: dict[str, list[bool]] = defaultdict(list)
    for seed in range(count):
        random = np.random.default_rng(5000 + seed)
        truth = random_loop(random)
        name = ("gain_margin", "bandwidth", "phase_margin")[seed % 3]
        ends = {
            "gain_margin": half_turn(truth),
            "bandwidth": truth.bandwidth,
            "phase_margin": truth.scale,
        }
        last = ends[name] * random.uniform(0.95, 1.06)
        frequency = np.geomspace(truth.scale / 10, last, int(random.choice([24, 40, 60])))
        values = truth.loop(2j * np.pi * frequency)
        share, floor = 10 ** random.uniform(-2.5, -1), 10 ** random.uniform(-3, -1.3)
        level = np.hypot(share * np.abs(values), floor)
        measured = noisy(frequency, values, level, random, of=int(random.integers(7, 12)))
        found = chosen_margins(chosen_order(measured, stable=False))
        for each in ("bandwidth", "phase_margin", "gain_margin"):
            told, expected = getattr(found, each), getattr(truth, each)
            if told.kind == "at least":
                held[each].append(told.value <= expected)
            elif told.has_interval:
                held[each].append(holds(told, expected))
    assert not rejected(held, "less")


@pytest.mark.parametrize("count", [25, pytest.param(200, marks=pytest.mark.statistics)])
def test_a_bandwidth_just_before_the_last_frequency_is_not_bounded_by_that(count: int) -> None:
    """Of a loop with -3 dB at 7.914 Hz, measured to hardly more: bounds count as intervals do."""
    width, held = 7.9141274721853, defaultdict(list)
    assert abs(loop(np.array([width])) / (1 + loop(np.array([width]))))[0] == pytest.approx(
        10**-0.15
    )
    for over in (1.002, 1.01, 1.03):
        bounds = 0
        for seed in range(count):
            frequency = np.geomspace(0.5, over * width, 40)
            truth, random = loop(frequency), np.random.default_rng(seed)
            measured = noisy(frequency, truth, 0.05 * np.abs(truth), random, of=20)
            told = fitted_margins(rational_fit(measured, (0, 1))).bandwidth
            if told.kind == "at least":
                bounds += 1
                held[str(over)].append(told.value <= width)
            else:
                held[str(over)].append(holds(told, width))
        assert bounds > count / 12  # else nothing was tried
    assert not rejected(held, "less")


def half_turn(truth: Truth) -> float:
    """Where a loop's phase is -180 deg (Hz), above its gain crossover."""
    grid = truth.scale * np.geomspace(1, 100, 8000)
    phase = np.unwrap(np.angle(truth.loop(2j * np.pi * grid)))
    return float(grid[np.flatnonzero(phase < -np.pi)[0]])


def test_an_end_that_may_lie_beyond_the_band_is_open() -> None:
    """-180 deg is at 25 Hz and the band ends at 25.2 Hz: whether it is in it, scatter hides."""
    kinds = []
    for seed in range(20):
        frequency = np.geomspace(0.5, 25.2, 40)
        truth = loop(frequency)
        measured = noisy(frequency, truth, 0.05 * np.abs(truth), np.random.default_rng(seed), of=20)
        found = fitted_margins(rational_fit(measured, (0, 1))).gain_margin
        if found.kind == "number":
            assert found.low is not None
            assert found.low <= GAIN_MARGIN + 0.3
            kinds.append(found.high is None)
    assert np.mean(kinds) > 0.8


@pytest.mark.parametrize("count", [50, pytest.param(600, marks=pytest.mark.statistics)])
def test_errors_are_the_scatter_of_repeated_measurements(count: int) -> None:
    frequency = np.geomspace(0.5, 60.0, 40)
    truth = loop(frequency)
    level = 0.02 * np.abs(truth)
    found = [
        fitted_margins(
            rational_fit(noisy(frequency, truth, level, np.random.default_rng(k), of=30), (0, 1))
        )
        for k in range(count)
    ]
    for name in ("bandwidth", "phase_margin", "gain_margin"):
        ratio = scatter_as_told([getattr(each, name) for each in found])
        assert ratio == pytest.approx(1, abs=2.6 / (2 * count) ** 0.5), name


def test_what_other_orders_say_is_a_systematic_part() -> None:
    """With a lag that scatter nearly hides, the order is open, and the interval says so."""
    shifts = []
    for seed in range(6):
        frequency = np.geomspace(0.5, 60.0, 60)
        truth = loop(frequency) / (1 + 2j * np.pi * frequency / 2500.0)
        measured = noisy(frequency, truth, 0.01 * np.abs(truth), np.random.default_rng(seed), of=20)
        chosen = chosen_order(measured)
        alone, told = fitted_margins(chosen.fit).gain_margin, chosen_margins(chosen).gain_margin
        others = [fitted_margins(each).gain_margin.value for each in chosen.near]
        expected = max(abs(each - alone.value) for each in others) / 3**0.5 if others else 0.0
        assert told.systematic_uncertainty == pytest.approx(expected)
        shifts.append(expected)
    assert np.median(shifts) > 0
