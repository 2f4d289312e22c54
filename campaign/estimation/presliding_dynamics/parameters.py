"""The parameters of the joint fit as one vector, and back.

What is asked for stands first, then what the torque of all records may be off by, then what is each
record's own.
Stiffness and inertia are logarithms, so that they stay positive and their intervals suit them.
Damping, which may turn out to be nothing, is linear: it may leave its bound, and the fit then says
so. Everything is scaled to be of order one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimation.presliding_dynamics.plant import Appendage, Bristles, Plant
from campaign.estimation.presliding_dynamics.record import Assumptions, Record

LONGEST_DELAY = 20.0
"""Samples that a channel may lag behind, either way."""
LOGARITHMIC = ("bristle_stiffness", "inertia", "appendage_frequency", "appendage_inertia")
FARTHEST = 7.0
"""Logarithm by which a parameter may end away from its start: a factor of 1000."""
MOST_YIELDING = 2.0
"""Largest torque over that at which the bristles would slip; above 1 the load breaks away."""
LARGEST_OFFSET = 1.0
"""Scatter of what loads an axis besides its drive, over the largest torque: all that is said of it
beforehand."""


@dataclass(frozen=True)
class Parameters:
    """Layout and scale of the vector: shared parameters, then those of each record.

    Attributes:
        names: of the shared ones: `bristle_stiffness`, then `bristle_damping`, or `damping` (with
            the viscous one) where both are free, then `yielding`.
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
        # Where viscous friction is free, too, what is known well is the sum of both dampings.
        whole = "damping" if assumed.viscous_free else "bristle_damping"
        names = ["bristle_stiffness", whole, "yielding"]
        if assumed.inertia is None:
            names.append("inertia")
        if assumed.viscous_free:
            names.append("viscous_friction")
        if assumed.delay is None:
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

    def index(self, name: str) -> int | None:
        """Where a shared parameter stands; None: it is not free."""
        return self.names.index(name) if name in self.names else None

    def of_record(self, number: int) -> slice:
        """Where the parameters of a record stand."""
        begin = self.common + sum(self.own[:number])
        return slice(begin, begin + self.own[number])

    def start(self) -> Array:
        """The vector of the first plant."""
        vector = np.zeros(self.size)
        bristles = self.first.bristles[0]
        vector[0] = np.log(bristles.stiffness)
        whole = bristles.damping + (self.first.viscous if self.names[1] == "damping" else 0.0)
        vector[1] = whole / self.damping_scale
        vector[2] = bristles.compliance * self.torque
        part = self.first.appendage
        for name, value in (
            ("inertia", np.log(self.first.inertia)),
            ("viscous_friction", self.first.viscous / self.damping_scale),
            ("appendage_frequency", np.log(part.frequency) if part else 0.0),
            ("appendage_inertia", np.log(part.inertia) if part else 0.0),
            ("appendage_damping_ratio", part.damping_ratio if part else 0.0),
        ):
            index = self.index(name)
            if index is not None:
                vector[index] = value
        return vector

    @property
    def damping_scale(self) -> float:
        """Critical damping of the first plant (N m s/rad)."""
        return 2.0 * float(np.sqrt(self.first.stiffness * self.first.inertia))

    def bounds(self) -> tuple[Array, Array]:
        """Between which the vector is looked for: wide, and no end of them is an answer."""
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        low[1], high[1] = -2.0, 50.0
        low[2], high[2] = -MOST_YIELDING, MOST_YIELDING
        start = self.start()
        for name in LOGARITHMIC:
            index = self.index(name)
            if index is not None:
                low[index], high[index] = start[index] - FARTHEST, start[index] + FARTHEST
        for name in ("rate_delay", "angle_delay"):
            index = self.index(name)
            if index is not None:
                low[index], high[index] = -LONGEST_DELAY, LONGEST_DELAY
        return low, high

    def plant(self, vector: Array) -> Plant:
        """What the shared parameters say."""
        told = dict(zip(self.names, map(float, vector), strict=False))
        assumed = self.assumed
        free = told.get("viscous_friction")
        viscous = assumed.viscous if free is None else free * self.damping_scale
        damping = float(vector[1]) * self.damping_scale
        bristles = Bristles(
            float(np.exp(told["bristle_stiffness"])),
            damping if free is None else damping - viscous,
            told["yielding"] / self.torque,
            assumed.coulomb_share,
            assumed.stribeck_velocity,
            assumed.stribeck_exponent,
        )
        part: Appendage | None = assumed.appendage
        if part is not None and "appendage_frequency" in told:
            part = replace(
                part,
                frequency=float(np.exp(told["appendage_frequency"])),
                inertia=float(np.exp(told["appendage_inertia"])),
                damping_ratio=told["appendage_damping_ratio"],
            )
        inertia = float(np.exp(told["inertia"])) if "inertia" in told else assumed.inertia
        return Plant(
            self.first.inertia if inertia is None else inertia,
            (bristles,),
            viscous,
            part,
        )

    def delay(self, vector: Array, channel: str) -> float:
        """Of a channel behind the torque (s)."""
        index = self.index(f"{channel}_delay")
        return (self.assumed.delay or 0.0) if index is None else float(vector[index]) * self.step

    def in_units(self, vector: Array, name: str) -> tuple[float, float]:
        """A parameter's value (SI), and what a change by 1 in the vector is worth there."""
        index = self.names.index(name)
        value = float(vector[index])
        if name in LOGARITHMIC:
            return float(np.exp(value)), float(np.exp(value))
        scale = {
            "bristle_damping": self.damping_scale,
            "damping": self.damping_scale,
            "viscous_friction": self.damping_scale,
            "yielding": 1.0 / self.torque,
            "rate_delay": self.step,
            "angle_delay": self.step,
        }.get(name, 1.0)
        return scale * value, scale
