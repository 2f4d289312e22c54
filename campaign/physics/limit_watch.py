"""Limit checks of measured samples, for simulation, host and C.

Angle, drive torque and motor current are checked at every sample. The rate is not: the difference
of encoder samples shows one count as `resolution * sample_rate`, which can exceed any limit while
the axis creeps. The check applies to its mean over the last n samples,

    n = T * sample_rate, rounded down, at least 1      T = min(rate_time, 0.01 * angle / rate)

with `rate_time`, `angle` and `rate` of the bench's limits. Samples before the trial count as zero,
because the bench was at rest. Lost samples count as zero too, because nothing is known of them.

**Additional travel.** While no mean exceeds the limit, the axis moves by at most `rate * T` in any
n samples, by definition of the mean. Consider a runaway: no sample before sample k exceeds the
limit, and all samples from k on exceed it in one direction. The mean of n such samples exceeds the
limit, so the trial ends at sample k + n - 1 at the latest. At the sample before the last, the last
n samples sum to at most `n * rate`. Those before k subtract less than `rate` each if the axis came
from the other direction. So from k on the axis moves by less than `2 n * rate` samples. This is
`2 * rate * T`, or 2 % of the angle limit: T is half the value that a motion from rest would allow.
The last sample adds the same travel as in a check of single samples; no check can limit the jump
of a single sample.

The mean is computed without drift and in one order, independent of the division into blocks. It is
bit-identical to `firmware/campaign_limits.c`: the sum of the window that began at a whole multiple
of n, plus the samples of the window before it that are still among the last n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.axis_kind import BOTH_ROTARY, Sides, axis_terms, in_axis_terms
from campaign.physics.bench import LimitsOptions
from campaign.units import in_words

SHARE = 0.01
"""Share of the angle limit; at the rate limit it gives the longest averaging time of the rate. The
additional travel is less than twice this share."""
ROUNDING = 1e-9
"""Relative; rounding of the sum must not fail a mean at the limit."""


@dataclass(frozen=True)
class WatchedLimit:
    """A limit monitored during motion, and its channel.

    Units are those of a rotary axis.
    """

    limit: str
    channel: str
    unit: str
    display: str


WATCHED = (
    WatchedLimit("angle", "relative_angle", "rad", "deg"),
    WatchedLimit("rate", "relative_rate", "rad/s", "deg/s"),
    WatchedLimit("torque", "drive_torque", "N m", "N m"),
    WatchedLimit("current", "motor_current", "A", "A"),
)
"""If several limits are exceeded at one sample, the violation names the first in this order."""


@dataclass(frozen=True)
class Violation:
    """The first measured value beyond a limit, in SI.

    Attributes:
        sample: number of the sample in the trial, from 0.
        index: its index in the block.
        value: value of the sample, or the mean that ends with it.
        text: message with value, time and limit.
    """

    sample: int
    index: int
    limit: str
    channel: str
    value: float
    bound: float
    text: str


def judged_samples(limits: LimitsOptions, sample_rate: float) -> int:
    """Number of samples in the mean of the rate; `sample_rate` in Hz."""
    longest = min(limits.rate_time, SHARE * limits.angle / limits.rate)
    return max(1, math.floor(longest * sample_rate + ROUNDING))


class LimitWatch:
    """Monitor of one trial, block by block.

    Attributes:
        unwatched: limits whose channel is not recorded.
    """

    def __init__(
        self,
        limits: LimitsOptions,
        sample_rate: float,
        channels: Sequence[str],
        sides: Sides = BOTH_ROTARY,
    ) -> None:
        """Start the monitor of one trial.

        Args:
            sample_rate: of the recording (Hz).
            channels: names, in the order of the blocks.
            sides: kind of axis, for the text of a violation.
        """
        self._sides = sides
        rows = {name: row for row, name in enumerate(channels)}
        self._watched = [
            (each, rows[each.channel], float(getattr(limits, each.limit)))
            for each in WATCHED
            if each.channel in rows
        ]
        self.unwatched = tuple(each.limit for each in WATCHED if each.channel not in rows)
        self._seen = 0
        self._count = judged_samples(limits, sample_rate)
        self._sample_rate = sample_rate
        # The last complete window, and the samples of the present one.
        self._rates = np.zeros(self._count)

    def look(self, time: Array, block: Array) -> Violation | None:
        """First sample of the next `block` (channels, n) at `time` (n,) that exceeds a limit.

        Do not call it again after a violation. An undefined value exceeds no limit.
        """
        first, violation = len(time), None
        for watched, row, bound in self._watched:
            values, beyond = block[row], bound
            if watched.limit == "rate":
                values, beyond = self._sums(values, bound)
            if _within(values[:first], beyond):
                continue
            broken = np.abs(values[:first]) > beyond
            if broken.any():
                first = int(np.argmax(broken))
                value = float(values[first])
                if watched.limit == "rate":
                    value /= self._count
                violation = self._violation(watched, first, value, bound, float(time[first]))
        self._seen += len(time)
        return violation

    def skip(self, count: int) -> None:
        """Account for `count` lost samples."""
        self._remember(np.concatenate([self._rates, np.zeros(count)]), count)
        self._seen += count

    def _sums(self, rates: Array, bound: float) -> tuple[Array, float]:
        """Sums of the last n rates at each sample, and the bound of their magnitude.

        Empty if no rate exceeds `bound`: then no mean does.
        """
        count, since = self._count, self._seen % self._count
        beyond = bound * count * (1.0 + ROUNDING)
        joined = np.concatenate([self._rates, rates])
        if _within(joined, bound):
            self._remember(joined, len(rates))
            return rates[:0], beyond
        joined = np.where(np.isnan(joined), 0.0, joined)
        self._remember(joined, len(rates))
        windows = np.zeros((-(-len(joined) // count), count))
        windows.ravel()[: len(joined)] = joined
        with np.errstate(over="ignore", invalid="ignore"):
            gained = np.cumsum(windows, axis=1)
            left = np.cumsum(np.column_stack([gained[:-1, -1], -windows[:-1]]), axis=1)[:, 1:]
            sums = (left + gained[1:]).ravel()[since : since + len(rates)]
        return sums, beyond

    def _remember(self, joined: Array, more: int) -> None:
        """Keep the part of `joined` that the next block needs, after `more` new samples."""
        kept = self._count + (self._seen + more) % self._count
        self._rates = joined[len(joined) - kept :].copy()

    def _violation(
        self, watched: WatchedLimit, index: int, value: float, bound: float, time: float
    ) -> Violation:
        with axis_terms(self._sides):
            text = self._text(watched, value, bound, time)
        sample = self._seen + index
        return Violation(sample, index, watched.limit, watched.channel, value, bound, text)

    def _text(self, watched: WatchedLimit, value: float, bound: float, time: float) -> str:
        shown, limit = (in_words(x, watched.unit, watched.display, ".6g") for x in (value, bound))
        mean = ""
        if watched.limit == "rate" and self._count > 1:
            mean = f" (mean of {self._count / self._sample_rate * 1e3:.4g} ms)"
        return (
            f"{watched.channel} reached {shown}{mean} at {time:.4g} s; "
            f"the {in_axis_terms(watched.limit)} limit is {limit}"
        )


def _within(values: Array, bound: float) -> bool:
    """Whether no magnitude exceeds `bound` and no value is undefined; faster than by `abs`."""
    low, high = np.min(values, initial=0.0), np.max(values, initial=0.0)
    return bool(-bound <= low and high <= bound)
