"""Chirp: a sine with a swept frequency, as points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from campaign.arrays import Array

Law = Literal["linear", "logarithmic"]
PER_CYCLE = 32
"""Points per cycle; straight lines between them have an error of at most 0.5 %."""


@dataclass(frozen=True)
class Chirp:
    """sin(phase(t)) with a whole number of cycles.

    Attributes:
        lowest, highest: frequency at the beginning and at the end (Hz).
        duration: (s).
        law: whether the frequency or its logarithm is linear in time.
    """

    lowest: float
    highest: float
    duration: float
    law: Law

    def phase(self, time: Array) -> Array:
        """Phase (rad) at `time` (s), shape (n,): the integral of 2 pi times the frequency."""
        share = time / self.duration
        if self.law == "linear":
            cycles = (
                self.duration * share * (self.lowest + 0.5 * (self.highest - self.lowest) * share)
            )
        else:
            growth = math.log(self.highest / self.lowest)
            cycles = self.duration * self.lowest * np.expm1(growth * share) / growth
        return np.asarray(2.0 * np.pi * cycles)

    def points(self) -> Array:
        """Times (s) at even steps of phase, `PER_CYCLE` of each cycle, shape (n,)."""
        whole = round(float(self.phase(np.array([self.duration]))[0] / (2.0 * np.pi)))
        cycles = np.arange(whole * PER_CYCLE + 1) / PER_CYCLE
        if self.law == "linear":
            slope = (self.highest - self.lowest) / self.duration
            time = 2.0 * cycles / (self.lowest + np.sqrt(self.lowest**2 + 2.0 * slope * cycles))
        else:
            growth = math.log(self.highest / self.lowest) / self.duration
            time = np.log1p(growth * cycles / self.lowest) / growth
        return np.minimum(time, self.duration)


def chirp(lowest: float, highest: float, duration: float, law: Law) -> Chirp:
    """Sweep of about a duration (s), with a whole number of cycles, so that it ends at 0.

    Raises ValueError unless 0 < `lowest` < `highest`, and for half a cycle or less.
    """
    if not 0.0 < lowest < highest:
        raise ValueError("highest must be above lowest")
    cycles = float(Chirp(lowest, highest, duration, law).phase(np.array([duration]))[0])
    cycles /= 2.0 * np.pi
    if round(cycles) < 1:
        raise ValueError(
            f"{duration:.4g} s are half a cycle or less: raise lowest, or sweep longer"
        )
    return Chirp(lowest, highest, duration * round(cycles) / cycles, law)
