"""The winding of the emulated motor, by the closed form of one time constant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.device.temperature import ROOM, THERMAL_RESISTANCE, TIME_CONSTANT, Winding


def test_a_current_heats_it_towards_what_its_loss_keeps() -> None:
    winding = Winding(resistance=0.5)
    winding.heat(np.full(100, 4.0), TIME_CONSTANT)
    rise = THERMAL_RESISTANCE * 0.5 * 16.0
    assert winding.temperature == pytest.approx(ROOM + rise * (1.0 - math.exp(-1.0)))
    winding.heat(np.zeros(0), TIME_CONSTANT)  # it rests
    assert winding.temperature == pytest.approx(
        ROOM + rise * (1.0 - math.exp(-1.0)) * math.exp(-1.0)
    )
    winding.heat(np.zeros(0), 50.0 * TIME_CONSTANT)
    assert winding.temperature == pytest.approx(ROOM)
