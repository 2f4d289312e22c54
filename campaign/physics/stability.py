"""Stability of the sliding rate loop with a compensation.

It is the loop of `open_loop`, closed. It excludes dry friction (constant in sliding; if stuck, it
holds the load), and includes viscous friction.
"""

from __future__ import annotations

import numpy as np

from campaign.physics.complete import CompleteBench
from campaign.physics.loop_margins import STANDING, in_time
from campaign.physics.open_loop import open_loop


def growth_rate(bench: CompleteBench, compensation: str) -> float:
    """Real part (1/s) of the fastest growing mode of the rate loop; negative if it is stable."""
    loop = open_loop(bench, compensation, "rate", "sliding")
    poles = in_time(np.linalg.eigvals(loop.closed), loop.period)
    return float(np.max(poles[np.abs(poles) > STANDING].real))
