"""The parameters of the joint fit as one vector, and back.

Order: shared parameters, factors of the torque errors common to all records, own parameters of each
record. Stiffness and inertia are logarithms, so that they and their intervals remain positive.
Damping may be zero and is linear: a negative value is possible and visible. All are of order one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.presliding_dynamics.plant import Appendage, Bristles, Plant
from campaign.estimation.presliding_dynamics.record import Assumptions, Record

LOGARITHMIC = ("bristle_stiffness", "inertia", "appendage_frequency", "appendage_inertia")
FARTHEST = 7.0
"""Largest change of a logarithmic parameter from its start: a factor of 1000."""
BOUNDS = {
    "damping": (-2.0, 50.0),
    "yielding": (-2.0, 2.0),
    "rate_delay": (-20.0, 20.0),
    "angle_delay": (-20.0, 20.0),
}
"""Bounds of other parameters: damping over critical damping; largest torque over slip torque of the
bristles (above 1 the load breaks away); delay of a channel in samples."""
LARGEST_OFFSET = 1.0
"""Prior standard deviation of a load torque besides the drive, over the largest torque."""


@dataclass(frozen=True)
class Parameters:
    """Layout and scale of the vector.

    Attributes:
        names: of the shared ones; `damping` is the sum of sigma1 and sigma2, which the records
            determine well.
        first: plant for the scales.
        step: shortest sampling step, the scale of delays (s).
        torque: scale of yielding (N m), the largest torque of all records.
        factors: number of factors of torque errors, common to all records.
        own: number of parameters of each record: offset of the torque; for a record that does not
            begin at rest also its initial bristle torque and rate.
    """

    names: tuple[str, ...]
    first: Plant
    assumed: Assumptions
    step: float
    torque: float
    factors: int
    own: tuple[int, ...]

    @classmethod
    def of(cls, records: Sequence[Record], first: Plant, assumed: Assumptions) -> Parameters:
        """Parameters that are free with these records and assumptions."""
        names = ["bristle_stiffness", "damping", "yielding", "inertia", "viscous_friction"]
        names += ["rate_delay"] if any(r.rate is not None for r in records) else []
        names += ["angle_delay"] if any(r.angle is not None for r in records) else []
        if assumed.appendage is not None and assumed.appendage_free:
            names += ["appendage_frequency", "appendage_inertia", "appendage_damping_ratio"]
        return cls(
            tuple(names),
            first,
            assumed,
            min(record.step for record in records),
            max(record.amplitude for record in records),
            records[0].doubts.shape[1],
            tuple(1 if record.at_rest else 3 for record in records),
        )

    @property
    def size(self) -> int:
        """Size of the whole vector."""
        return self.common + sum(self.own)

    @property
    def common(self) -> int:
        """Number of parameters before those of the records."""
        return len(self.names) + self.factors

    @property
    def doubted(self) -> slice:
        """Position of the factors of torque errors."""
        return slice(len(self.names), self.common)

    def of_record(self, number: int) -> slice:
        """Position of the parameters of a record."""
        begin = self.common + sum(self.own[:number])
        return slice(begin, begin + self.own[number])

    def start(self) -> Array:
        """Vector of the first plant."""
        first, bristles, part = self.first, self.first.bristles[0], self.first.appendage
        values = {
            "bristle_stiffness": np.log(bristles.stiffness),
            "damping": (bristles.damping + first.viscous) / self.damping_scale,
            "yielding": bristles.compliance * self.torque,
            "inertia": np.log(first.inertia),
            "viscous_friction": first.viscous / self.damping_scale,
        }
        if part is not None:
            values["appendage_frequency"] = np.log(part.frequency)
            values["appendage_inertia"] = np.log(part.inertia)
            values["appendage_damping_ratio"] = part.damping_ratio
        vector = np.zeros(self.size)
        vector[: len(self.names)] = [values.get(name, 0.0) for name in self.names]
        return vector

    @property
    def damping_scale(self) -> float:
        """Critical damping of the first plant (N m s/rad)."""
        return 2.0 * float(np.sqrt(self.first.stiffness * self.first.inertia))

    def bounds(self) -> tuple[Array, Array]:
        """Wide bounds of the vector in a search; a value at a bound is not a result."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        start = self.start()
        for index, name in enumerate(self.names):
            if name in LOGARITHMIC:
                low[index], high[index] = start[index] - FARTHEST, start[index] + FARTHEST
            elif name in BOUNDS:
                low[index], high[index] = BOUNDS[name]
        return low, high

    def plant(self, vector: Array) -> Plant:
        """Plant of the shared parameters."""
        values = dict(zip(self.names, map(float, vector), strict=False))
        viscous = values["viscous_friction"] * self.damping_scale
        bristles = Bristles(
            float(np.exp(values["bristle_stiffness"])),
            values["damping"] * self.damping_scale - viscous,
            values["yielding"] / self.torque,
        )
        part: Appendage | None = self.assumed.appendage
        if part is not None and "appendage_frequency" in values:
            part = Appendage(
                float(np.exp(values["appendage_inertia"])),
                float(np.exp(values["appendage_frequency"])),
                values["appendage_damping_ratio"],
            )
        return Plant(float(np.exp(values["inertia"])), (bristles,), viscous, part)

    def delay(self, vector: Array, channel: str) -> float:
        """Delay of a channel after the torque (s); 0 if no record of the fit has this channel."""
        name = f"{channel}_delay"
        if name not in self.names:
            return 0.0
        return float(vector[self.names.index(name)]) * self.step

    def in_units(self, name: str, value: float) -> tuple[float, float]:
        """Value (SI) of a parameter from its value in the vector, and derivative by the latter."""
        if name in LOGARITHMIC:
            return float(np.exp(value)), float(np.exp(value))
        scale = {
            "damping": self.damping_scale,
            "viscous_friction": self.damping_scale,
            "yielding": 1.0 / self.torque,
            "rate_delay": self.step,
            "angle_delay": self.step,
        }.get(name, 1.0)
        return scale * value, scale
