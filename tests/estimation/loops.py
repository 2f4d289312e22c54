"""Loops with closed forms: exact responses, and margins found where the formula says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from campaign.arrays import Array
from campaign.estimation.frequency_response import Response

Transfer = Callable[[Array], Array]
"""Of s (1/s)."""

SWEEP = np.arange(0.5, 100.01, 0.5)
MINUS_3_DB = 10**-0.15


def response(of: Transfer, at: Array = SWEEP, error: float = 0.0) -> Response:
    """The exact response of a transfer function."""
    return Response(at, of(2j * np.pi * at), np.full(len(at), error), np.ones(len(at)))


def closed(loop: Transfer) -> Transfer:
    return lambda s: loop(s) / (1.0 + loop(s))


def noisy(of: Transfer, at: Array, error: Array, random: np.random.Generator) -> Response:
    """With noise of standard deviation `error` on the real and on the imaginary part."""
    noise = random.standard_normal((2, len(at))) * error
    return Response(at, of(2j * np.pi * at) + noise[0] + 1j * noise[1], error, np.ones(len(at)))


@dataclass(frozen=True)
class Truth:
    """Of a loop with one crossing of each level; Hz, rad, dB.

    Attributes:
        loop: L(s).
        scale: its gain crossover.
    """

    loop: Transfer
    bandwidth: float
    phase_margin: float
    gain_margin: float
    scale: float


def random_loop(random: np.random.Generator) -> Truth:
    """A stable PI-controlled axis with lags and a delay, of any speed.

    Those with several crossings of a level, or hardly stable ones, are drawn anew.
    """
    while True:
        found = _truth(*_random_transfer(random))
        if found is not None:
            return found


def _random_transfer(random: np.random.Generator) -> tuple[Transfer, float]:
    crossover = 10 ** random.uniform(-0.3, 1.7)
    w = 2 * np.pi * crossover
    corner, damping = w * random.uniform(0.02, 0.4), w * 10 ** random.uniform(-2, -0.3)
    lags = w * 10 ** random.uniform(0.4, 1.8, random.integers(1, 4))
    delay = 10 ** random.uniform(-1.9, -0.4) / w

    def shape(s: Array) -> Array:
        value = (1 + corner / s) / (s + damping) * np.exp(-delay * s)
        return value / np.prod([1 + s / lag for lag in lags], axis=0)

    gain = 1 / abs(shape(np.array([2j * np.pi * crossover]))[0])
    return lambda s: gain * shape(s), crossover


def _truth(loop: Transfer, scale: float) -> Truth | None:
    grid = scale * np.geomspace(1 / 200, 100, 4000)
    values = loop(2j * np.pi * grid)
    phase = np.unwrap(np.angle(values))
    phase -= 2 * np.pi * np.round((phase[0] + np.pi / 2) / (2 * np.pi))
    width = _only_fall(np.log(abs(values / (1 + values)) / MINUS_3_DB))
    cross, turn = _only_fall(np.log(abs(values))), _only_fall(phase + np.pi)
    if width is None or cross is None or turn is None:
        return None

    def at(quantity: Callable[[complex], float], k: int) -> float:
        inner = lambda f: quantity(complex(loop(np.array([2j * np.pi * f]))[0]))  # noqa: E731
        return float(brentq(inner, grid[k], grid[k + 1], xtol=1e-12 * scale))

    crossover = at(lambda l: np.log(abs(l)), cross)
    half_turn = at(lambda l: np.angle(-l), turn)
    lowest = loop(2j * np.pi * np.array([crossover, half_turn]))
    margin = float(np.angle(-lowest[0]))
    gain = float(-20 * np.log10(abs(lowest[1])))
    if margin < np.deg2rad(20) or gain < 3 or half_turn < crossover:
        return None
    bandwidth = at(lambda l: np.log(abs(l / (1 + l)) / MINUS_3_DB), width)
    return Truth(loop, bandwidth, margin, gain, scale)


def _only_fall(above: Array) -> int | None:
    """The point before the only passing of zero, if that falls."""
    passed = np.flatnonzero((above[:-1] > 0) != (above[1:] > 0))
    return int(passed[0]) if len(passed) == 1 and above[0] > 0 else None
