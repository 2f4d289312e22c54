"""Bandwidth and margins hold the truth as often as they say, over random loops of any speed.

The estimators alone: exact responses of PI-controlled axes with lags and a delay, 0.5 to 50 Hz,
with noise on T. Seeds were chosen before looking. Where points are close, bandwidth and phase
margin must be held in 95 % or more, and not in more than 98 %: a share of what interpolation may do
is part of each interval, also where it does nothing. Gain margins are told only where noise lets
the crossing be seen, and where points are far apart, or the sweep ends below the crossing, an
interval is wide on purpose: of these only what holds too seldom is rejected.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin
from campaign.identification.frequency_response import Response, make_response
from campaign.identification.refinement import refinement
from campaign.identification.servo import characteristics
from campaign.identification.sine_point import SinePoint
from tests.identification.coverage import holds, rejected
from tests.identification.loops import Array, Truth, closed, noisy, random_loop

Held = dict[str, list[bool]]
TOO_WIDE = 0.98
"""Coverage above which an interval of close points claims too little."""


@dataclass(frozen=True)
class Case:
    """A way to sweep: frequencies over the gain crossover, and noise of T.

    Attributes:
        noise: standard deviation of each part of T, over the gain crossover; above a third of it
            proportional to frequency, as it is for a command whose amplitude falls as 1/f.
    """

    grid: Array
    noise: float

    def measured(self, truth: Truth, random: np.random.Generator, at: Array) -> Response:
        error = self.noise * np.maximum(at / truth.scale, 0.3)
        return noisy(closed(truth.loop), at, error, random)


CLOSE = {
    "little noise": Case(np.geomspace(0.15, 40, 240), 3e-3),
    "much noise": Case(np.geomspace(0.15, 40, 240), 1e-2),
}
FAR = {
    "log 22": Case(np.geomspace(0.15, 45, 22), 1e-3),
    "log 40": Case(np.geomspace(0.15, 45, 40), 1e-4),
    "log 40, noisy": Case(np.geomspace(0.15, 45, 40), 3e-3),
    "linear 50": Case(0.35 * np.arange(1, 51), 1e-3),
    "linear 200": Case(0.09 * np.arange(1, 201), 1e-3),
}
SHORT = {
    "to 12 times": Case(np.linspace(0.3, 12, 60), 1e-3),
    "to 10 times, log": Case(np.geomspace(0.2, 10, 40), 1e-3),
}


def collected(
    case: Case, draws: int, seed: int, more: Callable[..., Response] | None = None
) -> Held:
    """What each interval and each bound did, by quantity."""
    random = np.random.default_rng(seed)
    held: Held = defaultdict(list)
    for _ in range(draws):
        truth = random_loop(random)
        sweep = case.measured(truth, random, truth.scale * case.grid)
        if more is not None:
            sweep = more(case, truth, sweep, random)
        for name, inside in _judged(sweep, truth):
            held[name].append(inside)
    return held


def _judged(sweep: Response, truth: Truth) -> Iterator[tuple[str, bool]]:
    found = characteristics(sweep)
    for estimate in (found.bandwidth, found.phase_margin, found.gain_margin):
        if estimate.kind == "number" and estimate.origin is not Origin.NOT_DETERMINED:
            yield _name(estimate), holds(estimate, getattr(truth, estimate.name))
    if found.gain_margin_bound is not None:
        yield "bound", found.gain_margin_bound.value <= truth.gain_margin


def _name(estimate: Estimate) -> str:
    return "hull" if estimate.method.startswith("hull") else estimate.name


def pooled(cases: dict[str, Case], draws: int, seed: int) -> Held:
    return {
        f"{label}: {name}": inside
        for k, (label, case) in enumerate(cases.items())
        for name, inside in collected(case, draws, seed + k).items()
    }


def refined(case: Case, truth: Truth, sweep: Response, random: np.random.Generator) -> Response:
    """The sweep and the frequencies that it asks for, together."""
    second = case.measured(truth, random, refinement(sweep))
    return make_response(
        [
            SinePoint(float(f), complex(value), float(error), 1.0)
            for each in (sweep, second)
            for f, value, error in zip(each.frequency, each.values, each.error, strict=True)
        ]
    )


quick = pytest.mark.parametrize(
    ("draws", "seed"), [(25, 31_000), pytest.param(4000, 32_000, marks=pytest.mark.soak)]
)


@quick
def test_close_points(draws: int, seed: int) -> None:
    held = pooled(CLOSE, draws, seed)
    assert rejected(held, "less") == {}
    narrow = ("bandwidth", "phase_margin")
    alike = {name: inside for name, inside in held.items() if name.endswith(narrow)}
    assert rejected(alike, "greater", TOO_WIDE) == {}


@quick
def test_far_points(draws: int, seed: int) -> None:
    assert rejected(pooled(FAR, draws, seed + 100), "less", 0.9) == {}


@quick
def test_sweeps_that_end_below_the_crossing(draws: int, seed: int) -> None:
    held = pooled(SHORT, draws, seed + 200)
    assert sum(len(inside) for name, inside in held.items() if name.endswith("hull")) > draws / 10
    assert rejected(held, "less", 0.9) == {}


@quick
def test_a_second_stage_makes_the_interval_narrow_and_keeps_it_honest(
    draws: int, seed: int
) -> None:
    case = Case(np.geomspace(0.2, 30, 20), 1e-3)
    held = collected(case, draws, seed + 300, refined)
    assert rejected(held, "less") == {}
    random = np.random.default_rng(seed + 301)
    widths = np.array([_widths(case, random_loop(random), random) for _ in range(30)])
    assert np.median(widths[:, 1] / widths[:, 0]) < 0.6


def _widths(case: Case, truth: Truth, random: np.random.Generator) -> tuple[float, float]:
    """Half-width of the bandwidth before and after."""
    sweep = case.measured(truth, random, truth.scale * case.grid)
    first = characteristics(sweep).bandwidth
    second = characteristics(refined(case, truth, sweep, random)).bandwidth
    return first.half_width / truth.bandwidth, second.half_width / truth.bandwidth
