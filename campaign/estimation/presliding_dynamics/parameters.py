"""The parameters of the joint fit as one vector, and back.

What is asked for stands first, then what the torque of all records may be off by, then what is each
record's own.
Stiffness and inertia are logarithms, so that they stay positive and their intervals suit them.
Damping, which may turn out to be nothing, is linear: it may leave its bound, and the fit then says
so. Everything is scaled to be of order one.
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
"""Logarithm by which a parameter may end away from its start: a factor of 1000."""
BOUNDS = {
    "damping": (-2.0, 50.0),
    "yielding": (-2.0, 2.0),
    "rate_delay": (-20.0, 20.0),
    "angle_delay": (-20.0, 20.0),
}
"""Between which others are looked for: over critical damping; largest torque over that at which the
bristles would slip, above 1 of which the load breaks away; samples that a channel lags behind."""
LARGEST_OFFSET = 1.0
"""Scatter of what loads an axis besides its drive, over the largest torque: all that is said of it
beforehand."""


@dataclass(frozen=True)
class Parameters:
    """Layout and scale of the vector: shared parameters, then those of each record.

    Attributes:
        names: of the shared ones; `damping` is the sum of sigma1 and sigma2, which is known well.
        first: the plant that scales are taken from.
        step: sampling step that delays are scaled by (s).
        torque: that yielding is scaled by (N m), the largest of all records.
        factors: how many factors of what the torque may be off by there are, of all records.
        own: how many parameters each record has: offset of the torque; and bristle torque and rate
            at the beginning of one that does not begin at rest.
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
        """Those that the records and what is assumed leave open."""
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
        """Of the whole vector."""
        return self.common + sum(self.own)

    @property
    def common(self) -> int:
        """How many stand before those of the records."""
        return len(self.names) + self.factors

    @property
    def doubted(self) -> slice:
        """Where the factors of what the torque may be off by stand."""
        return slice(len(self.names), self.common)

    def of_record(self, number: int) -> slice:
        """Where the parameters of a record stand."""
        begin = self.common + sum(self.own[:number])
        return slice(begin, begin + self.own[number])

    def start(self) -> Array:
        """The vector of the first plant."""
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
        """Between which the vector is looked for: wide, and no end of them is an answer."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        start = self.start()
        for index, name in enumerate(self.names):
            if name in LOGARITHMIC:
                low[index], high[index] = start[index] - FARTHEST, start[index] + FARTHEST
            elif name in BOUNDS:
                low[index], high[index] = BOUNDS[name]
        return low, high

    def plant(self, vector: Array) -> Plant:
        """What the shared parameters say."""
        told = dict(zip(self.names, map(float, vector), strict=False))
        viscous = told["viscous_friction"] * self.damping_scale
        bristles = Bristles(
            float(np.exp(told["bristle_stiffness"])),
            told["damping"] * self.damping_scale - viscous,
            told["yielding"] / self.torque,
        )
        part: Appendage | None = self.assumed.appendage
        if part is not None and "appendage_frequency" in told:
            part = Appendage(
                float(np.exp(told["appendage_inertia"])),
                float(np.exp(told["appendage_frequency"])),
                told["appendage_damping_ratio"],
            )
        return Plant(float(np.exp(told["inertia"])), (bristles,), viscous, part)

    def delay(self, vector: Array, channel: str) -> float:
        """Of a channel behind the torque (s); 0 of one that no record of the fit has."""
        name = f"{channel}_delay"
        if name not in self.names:
            return 0.0
        return float(vector[self.names.index(name)]) * self.step

    def in_units(self, vector: Array, name: str) -> tuple[float, float]:
        """A parameter's value (SI), and what a change by 1 in the vector is worth there."""
        index = self.names.index(name)
        value = float(vector[index])
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
