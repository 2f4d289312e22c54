"""Drawn margins are read from many loops at a time as they are from one."""

from __future__ import annotations

import math

import numpy as np

from campaign.estimation.frequency.drawn_margins import MINUS_3_DB, _read


def crossings(frequency: np.ndarray, values: np.ndarray, *, falling: bool) -> list[float]:
    """Frequencies (Hz) of zeros, by straight lines over log frequency."""
    found = []
    for k in range(len(values) - 1):
        one, other = values[k], values[k + 1]
        if (one > 0 >= other) or (not falling and one < 0 <= other):
            share = one / (one - other)
            found.append(frequency[k] * (frequency[k + 1] / frequency[k]) ** share)
    return found


def slowly(frequency: np.ndarray, log: np.ndarray) -> tuple[float, float, float, bool]:
    """Bandwidth, phase margin (rad), gain margin (dB) of one loop, from their definitions."""
    closed = np.abs(np.exp(log) / (1.0 + np.exp(log)))
    drop = np.log(closed / MINUS_3_DB)
    widths = crossings(frequency, drop, falling=True)
    width = (
        widths[0] if widths else math.inf if all(drop > 0) else 0.0 if all(drop < 0) else math.nan
    )
    crossed = crossings(frequency, log.real, falling=False)
    last = -20.0 / math.log(10.0) * log.real[-1]
    if not crossed:
        return width, -math.inf if last < 0 else math.inf, last, False
    phase, at = np.unwrap(log.imag), np.log(frequency)

    def of(values: np.ndarray, where: float) -> float:
        return float(np.interp(math.log(where), at, values))

    over = [math.remainder(of(phase, each) - math.pi, 2.0 * math.pi) for each in crossed]
    turns = [
        each
        for each in crossings(frequency, np.sin(phase), falling=False)
        if each > crossed[0] and math.cos(of(phase, each)) < 0.0
    ]
    gains = [-20.0 / math.log(10.0) * of(log.real, each) for each in turns]
    return width, min(over, key=abs), min(gains, default=last), bool(gains)


def test_many_loops_are_read_as_one_is() -> None:
    """Smooth loops that fall by some 40 dB, with bumps: up to seven crossovers and turns."""
    random = np.random.default_rng(2)
    frequency = np.geomspace(0.5, 200.0, 500)
    place = np.linspace(0.0, 1.0, 500)
    waves = np.cos(np.pi * np.arange(1, 9)[:, None] * place)
    gain = 2.5 - 5.0 * place + random.normal(size=(100, 8)) * 0.5 @ waves
    phase = -0.5 - 5.0 * place + random.normal(size=(100, 8)) * 0.4 @ waves
    gain[:5] += 8.0  # no crossover within the frequencies
    gain[5:10] -= 8.0
    logs = gain + 1j * phase
    found = np.array(_read(frequency, logs), dtype=float).T
    expected = np.array([slowly(frequency, log) for log in logs], dtype=float)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    several = [len(crossings(frequency, each, falling=False)) for each in gain]
    assert sum(count > 1 for count in several) > 20
