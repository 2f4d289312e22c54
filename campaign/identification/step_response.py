"""What a step response is described by: rise time, settling time, overshoot, what error stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.identification.least_squares import Array

FINAL_SHARE = 0.2
"""Last part of the recording over which the steady state is averaged."""


@dataclass(frozen=True)
class StepCharacteristics:
    """Of one step.

    Attributes:
        rise_time: from 10 % to 90 % of the commanded step (s).
        settling_time: from the start of the step until the response stays within the band (s).
        overshoot: largest excess over the commanded step, as a share of it; 0 for none.
        steady_state_error: commanded step less the mean of the last part, in the response's unit.
    """

    rise_time: float
    settling_time: float
    overshoot: float
    steady_state_error: float


def step_characteristics(
    time: Array, response: Array, start: float, step: float, band: float = 0.02
) -> StepCharacteristics:
    """Characteristics of the answer to a step of height `step` that begins at `start` (s).

    time, response: shape (n,), starting before the step. `band` is a share of the step. A rise that
    was not seen is NaN, and so is a response that did not settle before its last tenth.
    Raises ValueError when less than ten samples follow the step.
    """
    after = time >= start
    if np.count_nonzero(after) < 10:
        raise ValueError("fewer than ten samples follow the step")
    before = response[~after]
    zero = float(np.mean(before)) if before.size else 0.0
    share = (response - zero) / step
    span = float(time[-1]) - start
    final = time >= time[-1] - FINAL_SHARE * span
    rise = reached(time, share, 0.9) - reached(time, share, 0.1)
    outside = np.flatnonzero((np.abs(share - 1.0) > band) & after)
    settled = 0.0
    if outside.size:
        last = int(outside[-1])
        settled = _return(time, share, last, band) - start
    return StepCharacteristics(
        rise_time=rise,
        settling_time=settled if settled <= 0.9 * span else float("nan"),
        overshoot=max(float(np.max(share[after])) - 1.0, 0.0),
        steady_state_error=step * (1.0 - float(np.mean(share[final]))),
    )


def reached(time: Array, share: Array, level: float) -> float:
    """When `share` first reaches `level`, on a straight line between samples; NaN if never."""
    above = np.flatnonzero(share >= level)
    if not above.size or above[0] == 0:
        return float("nan")
    k = int(above[0])
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(time[k - 1] + part * (time[k] - time[k - 1]))


def _return(time: Array, share: Array, last: int, band: float) -> float:
    """When the response crosses into the band after its `last` sample outside; inf if never."""
    if last + 1 >= len(time):
        return float("inf")
    edge = 1.0 + (band if share[last] > 1.0 else -band)
    part = (edge - share[last]) / (share[last + 1] - share[last])
    return float(time[last] + part * (time[last + 1] - time[last]))
