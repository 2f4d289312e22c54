"""Step response: rise time, settling time, overshoot, remaining error."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from campaign.arrays import Array, Flags
from campaign.estimation.least_squares import straight_line
from campaign.reason import Cause, Reason

FINAL_SHARE = 0.2
"""Share of the recording, at its end, over which the steady state is averaged."""
SIGMAS = 3.0
"""Least distance of 10 % of the step from zero, in standard deviations of the noise."""
CLEAR = 6.0
"""Least distance of a settled response from the edge of its band, in the same unit: of its many
samples, a single one outside would count."""
PEAK = 10.0
"""Least overshoot, in the same unit: a largest sample includes two or three standard deviations."""
SMOOTHED = 1.0 / 3.0
"""Largest width of an average over the rise time: it increases a rise by 4 %."""
LOW, HIGH = 0.1, 0.9
"""Levels of a rise, as shares of the step."""
NO_OVERSHOOT = 0.005
"""Share of the step below which a hidden overshoot is negligible."""
NOT_REACHED = Cause("step not reached", "it was not seen to reach 90 % of the step")
NOT_SETTLED = Cause(
    "not settled", "it was not seen to stay within the band before its recording ended"
)
SCATTERS = "the rate scatters by {noise_percent:.2g} % of the step (1 sigma)"
"""Begin of the texts on characteristics that noise hides."""
HIDDEN_RISE = Cause(
    "rise hidden by noise",
    SCATTERS + ", too much to see 10 % of it within its rise",
)
HIDDEN_SETTLING = Cause(
    "settling hidden by noise",
    SCATTERS + ", and its final mean lies {room_percent:.2g} % within the band's edge",
)
HIDDEN_OVERSHOOT = Cause(
    "overshoot hidden by noise",
    SCATTERS + ", which hides one of less than {hidden_percent:.2g} %",
)


@dataclass(frozen=True)
class StepCharacteristics:
    """Characteristics of one step; a step downwards is mirrored.

    Attributes:
        rise_time: from 10 % to 90 % of the commanded step (s).
        settling_time: from the start of the step until the response stays within the band (s).
        overshoot: largest excess over the commanded step, as a share of it; 0 for none.
        steady_state_error: commanded step less the mean of the last part, in the response's unit;
            positive where the response is too small.
        noise: standard deviation of the response's noise, as a share of the step.
        rise_from: time at which the response reaches 10 % (s, on the recording's time base).
        reasons: why a characteristic is NaN, by its name.
    """

    rise_time: float
    settling_time: float
    overshoot: float
    steady_state_error: float
    noise: float = 0.0
    rise_from: float = math.nan
    reasons: dict[str, Reason] = field(default_factory=dict)


def step_characteristics(
    time: Array, response: Array, start: float, step: float, band: float = 0.02
) -> StepCharacteristics:
    """Characteristics of the response to a step of height `step` that begins at `start` (s).

    time, response: shape (n,), starting before the step. `band` is a share of the step. The rise
    time is NaN without a rise, the settling time if the response does not settle before its last
    tenth. A noisy response is averaged over as few samples as resolve its levels, at most a third
    of its rise; characteristics that noise still hides are NaN. `reasons` states the causes.
    Raises ValueError for less than ten samples after the step.
    """
    known = np.isfinite(response)
    time, response = time[known], response[known]
    after = time >= start
    if np.count_nonzero(after) < 10:
        raise ValueError("fewer than ten samples follow the step")
    before = response[~after]
    zero = float(np.mean(before)) if before.size else 0.0
    share = (response - zero) / step
    span = float(time[-1]) - start
    final = time >= time[-1] - FINAL_SHARE * span
    end = float(np.mean(share[final]))
    views = list(_views(time, share, after, final))
    noise = views[0].noise
    reasons: dict[str, Reason] = {}

    rise = rise_from = math.nan
    clean = [view for view in views if SIGMAS * view.noise <= LOW]
    sharp = (view for view in clean if CLEAR * view.noise <= 0.5 * LOW)
    legible = next(sharp, clean[-1] if clean else None)
    if legible is not None:
        rise, rise_from = legible.rise, legible.rise_from
    if not math.isfinite(rise):
        hidden = HIDDEN_RISE(noise_percent=100 * noise)
        reasons["rise_time"] = NOT_REACHED() if legible is not None else hidden

    settled = math.nan
    room = band - abs(end - 1.0)
    clear = next((view for view in views if CLEAR * view.noise <= room), None)
    if room <= 0.0:
        reasons["settling_time"] = NOT_SETTLED()
    elif clear is None:
        reasons["settling_time"] = HIDDEN_SETTLING(
            noise_percent=100 * noise, room_percent=100 * room
        )
    else:
        settled = _settled(time, clear.share, after, band) - start
        if settled > 0.9 * span:
            settled, reasons["settling_time"] = math.nan, NOT_SETTLED()

    view = clear or views[-1]
    excess = float(np.max(view.share[after])) - 1.0
    hides = PEAK * view.noise
    if excess < hides and hides > NO_OVERSHOOT:
        excess = math.nan
        reasons["overshoot"] = HIDDEN_OVERSHOOT(
            noise_percent=100 * noise, hidden_percent=100 * hides
        )
    return StepCharacteristics(
        rise_time=rise,
        settling_time=settled,
        overshoot=excess if math.isnan(excess) else max(excess, 0.0),
        steady_state_error=abs(step) * (1.0 - end),
        noise=noise,
        rise_from=rise_from,
        reasons=reasons,
    )


@dataclass(frozen=True)
class _View:
    """A response averaged over some samples, its remaining noise, and its rise."""

    share: Array
    noise: float
    rise: float
    rise_from: float


def _views(time: Array, share: Array, after: Flags, final: Flags) -> Iterator[_View]:
    """Response without an average, then over 3, 5, 9, ... samples, up to a share of its rise."""
    step = float(np.median(np.diff(time)))
    count = 1
    while count <= np.count_nonzero(final):
        smooth = _averaged(share, count)
        rise_from, rise = _rise(time, smooth, after)
        if count > 1 and not count * step <= SMOOTHED * rise:
            return
        # Second differences exclude slow oscillation and creep. The standstill also shows noise
        # that is not white, which an average reduces less.
        rough = np.diff(share[final], 2) / math.sqrt(6.0 * count)
        moving = math.sqrt(float(np.mean(rough**2))) if rough.size else 0.0
        # Without averages that include samples of the step.
        resting = smooth[~after][: -(count // 2) or None]
        still = _scatter(resting) if len(resting) >= MOST_LINE else 0.0
        yield _View(smooth, max(moving, still), rise, rise_from)
        count += 2 * math.ceil(0.25 * count)


MOST_LINE = 10
"""Fewest samples of a standstill for an estimate of its scatter."""


def _scatter(samples: Array) -> float:
    """Standard deviation about a line."""
    left = samples - straight_line(samples)
    return math.sqrt(float(left @ left) / (len(samples) - 2))


def _averaged(samples: Array, count: int) -> Array:
    """Moving mean over `count` (odd) samples; over fewer at the ends."""
    if count == 1:
        return samples
    sums = np.concatenate([[0.0], np.cumsum(samples)])
    place = np.arange(len(samples))
    low = np.maximum(place - count // 2, 0)
    high = np.minimum(place + count // 2 + 1, len(samples))
    return np.asarray((sums[high] - sums[low]) / (high - low))


def _rise(time: Array, share: Array, after: Flags) -> tuple[float, float]:
    """Time of the last crossing of 10 % before half the step, and duration from it to 90 %.

    The search begins at half the step, to exclude noise or disturbances before the step. NaN
    without a rise.
    """
    half = np.flatnonzero((share >= 0.5) & after)
    if not half.size:
        return math.nan, math.nan
    middle = int(half[0])
    below = np.flatnonzero(share[:middle] < LOW)
    above = np.flatnonzero(share[middle:] >= HIGH)
    if not below.size or not above.size:
        return math.nan, math.nan
    begin = _crossing(time, share, int(below[-1]) + 1, LOW)
    return begin, _crossing(time, share, middle + int(above[0]), HIGH) - begin


def _crossing(time: Array, share: Array, k: int, level: float) -> float:
    """Time at which `share` crosses `level` between samples k - 1 and k, on a straight line."""
    part = (level - share[k - 1]) / (share[k] - share[k - 1])
    return float(time[k - 1] + part * (time[k] - time[k - 1]))


def _settled(time: Array, share: Array, after: Flags, band: float) -> float:
    """Time of the last crossing into the band; inf if the response ends outside."""
    outside = np.flatnonzero((np.abs(share - 1.0) > band) & after)
    if not outside.size:
        return float(time[after][0])
    last = int(outside[-1])
    if last + 1 >= len(time):
        return math.inf
    return _crossing(time, share, last + 1, 1.0 + (band if share[last] > 1.0 else -band))
