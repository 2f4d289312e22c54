"""Amplitude at one frequency: its value, and how often its interval holds the truth."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.sine_amplitude import TOO_FEW_CYCLES, amplitude
from tests.estimation.coverage import autoregressive, draws, holds, rejected

STEP = 1e-3
FREQUENCY = 10.0


def test_amplitude_with_offset_and_whole_cycles_only_in_its_scatter() -> None:
    time = np.arange(450) * STEP  # 4.5 cycles
    found = amplitude("rate", time, 0.7 * np.sin(62.8318530718 * time + 1) + 5, FREQUENCY, "rad/s")
    assert found.value == pytest.approx(0.7, rel=1e-9)
    assert found.freedom == 3
    once = amplitude("rate", time[:150], np.sin(time[:150]), FREQUENCY, "rad/s")
    assert once.low is None
    assert once.reason in TOO_FEW_CYCLES


@draws(250)
def test_the_interval_holds_the_amplitude(count: int) -> None:
    held = {}
    for number, (cycles, level, memory) in enumerate(
        ((3, 0.1, 0.0), (8, 0.1, 0.0), (8, 0.1, 0.8), (8, 1.0, 0.8))
    ):
        random, time = np.random.default_rng([515, number]), np.arange(100 * cycles) * STEP
        found = []
        for _ in range(count):
            noise = level * autoregressive(random, len(time), memory)
            wave = np.sin(2 * np.pi * FREQUENCY * time + random.uniform(0, 2 * np.pi))
            found.append(holds(amplitude("a", time, wave + noise, FREQUENCY, ""), 1.0))
        held[f"{cycles} cycles, noise {level}, memory {memory}"] = found
    assert rejected(held) == {}
