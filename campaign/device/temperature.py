"""Winding temperature: one thermal mass, heated by current, cooled by the room."""

from __future__ import annotations

import math

import numpy as np

from campaign.recording import Array

ZERO_CELSIUS = 273.15
ROOM = 293.15
"""K."""
THERMAL_RESISTANCE = 0.4
"""K/W, winding to room, of a servo motor of several hundred watts."""
TIME_CONSTANT = 600.0
"""s."""
LIMIT = 393.15
"""K; a controller switches off above it."""


class Winding:
    """Temperature of the winding, only for the status: it does not affect the simulated bench.

    Attributes:
        temperature: K.
    """

    def __init__(self, resistance: float) -> None:
        self._resistance = resistance
        self.temperature = ROOM

    @property
    def celsius(self) -> float:
        """Its temperature in degrees Celsius, as in STATUS."""
        return self.temperature - ZERO_CELSIUS

    def overheat(self) -> float:
        """Set the temperature 5 K above the limit; return it (degree Celsius)."""
        self.temperature = LIMIT + 5.0
        return self.celsius

    def heat(self, current: Array, duration: float) -> None:
        """Update the temperature after `duration` (s) with `current` (A), shape (n,)."""
        loss = self._resistance * float(np.mean(np.square(current))) if len(current) else 0.0
        goal = ROOM + THERMAL_RESISTANCE * loss
        if math.isfinite(goal):
            self.temperature = goal + (self.temperature - goal) * math.exp(
                -duration / TIME_CONSTANT
            )
