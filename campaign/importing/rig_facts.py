"""What of a bench makes one channel of another: see `made`."""

from __future__ import annotations

from campaign.importing.made import RigFacts
from campaign.physics.bench import Bench


def rig_facts(bench: Bench) -> RigFacts:
    """The facts of a bench, as far as it has them."""
    return RigFacts(
        axis=bench.sides.load,
        motor=bench.sides.motor,
        ratio=bench.ratio or 1.0,
        torque_per_current=bench.torque_per_current,
    )
