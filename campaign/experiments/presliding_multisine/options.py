"""Options of a presliding multisine, and of the model of small motions."""

from __future__ import annotations

from pydantic import Field

from campaign.options import Options
from campaign.units import Frequency, RotationalDamping, Torque


class PreslidingMultisineOptions(Options):
    """Options of a presliding-multisine test."""

    amplitudes: tuple[Torque, ...] = Field(default=(0.5, 1.0, 2.0), min_length=1, max_length=100)
    """Largest torques of the multisine; all of them far below breakaway."""
    lowest: Frequency = Field(default=0.5, gt=0)
    """Lowest line; the others are its odd multiples, and its period is that of the torque."""
    highest: Frequency = Field(default=60.0, gt=0)
    """Highest line, well above the resonance of the load on its bristles."""
    periods: int = Field(default=10, ge=2, le=10_000)
    """Periods of the torque in a trial."""
    realisations: int = Field(default=1, ge=1, le=100)
    """Trials of each amplitude, each with phases of its own."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Which phases; with the same seed they are the same."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio that the measured damping is held against (Eq. 4.12)."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording; at least 8 times the highest line."""


class PreslidingOptions(Options):
    """Options of the model `presliding`."""

    viscous_friction: RotationalDamping | None = Field(default=None, ge=0)
    """sigma2 at the load, to be taken off the damping of small motions; absent: the bench's."""
    damping_ratio: float = Field(default=0.8, gt=0, le=2.0)
    """Assumed damping ratio that the measured damping is held against (Eq. 4.12)."""
