"""Limit checks of measured samples, for simulation, host and C.

Angle, drive torque and motor current are judged at every sample. The rate is not: a rate that is
made by differencing an encoder shows one count of it as `resolution * sample_rate`, which may be
beyond any limit while the axis creeps. It is judged by its mean over the last n samples,

    n = T * sample_rate, rounded down, at least 1      T = min(rate_time, 0.01 * angle / rate)

with `rate_time`, `angle` and `rate` of the bench's limits. Samples before the trial count as zero:
the bench was at rest. The same holds for samples that were lost: of them nothing is known.

**How far the axis can go further for it.** As long as no mean is beyond the limit, the axis moves
by at most `rate * T` in any n samples: that is what a mean is. Let no sample have been beyond the
limit until sample k, and all from k on, in one direction: a runaway. n samples beyond the limit
have a mean beyond it, so the trial ends at sample k + n - 1 at the latest. Until the sample before
the one that ends it, the last n samples add up to at most `n * rate`; of those, the ones before k
take away less than `rate` each, if the axis came from the other direction. So from k on it moved by
less than `2 n * rate` samples, which is `2 * rate * T`, or 2 % of the angle limit: T is half of
what a motion from rest would allow. The sample that ends the trial is the same as it would be if
each were judged alone; what a single sample jumps by, no judgement of samples can hold back.

The mean is computed without drift and in one order, whichever way the samples were cut into
blocks, and bit by bit as `firmware/campaign_limits.c` does: the sum of the window that began at a
whole multiple of n, and of the window before it what has not gone yet.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from campaign.axis_kind import BOTH_ROTARY, Sides, axis_terms, in_axis_terms
from campaign.physics.bench import LimitsOptions
from campaign.units import in_words

Array = NDArray[np.float64]

SHARE = 0.01
"""Of the angle limit, at the rate limit: the longest time over which a rate is judged. Twice that
is how far the axis can go further."""
ROUNDING = 1e-9
"""Relative; a mean right at the limit must not fail by how it was summed."""


@dataclass(frozen=True)
class WatchedLimit:
    """A limit that is watched in motion, and the channel that it is watched in.

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
"""In this order: of several limits that break at one sample, the first is named."""


@dataclass(frozen=True)
class Violation:
    """The first measured value beyond a limit, in SI.

    Attributes:
        sample: number of the sample in the trial, from 0.
        index: its place in the block that was looked at.
        value: the sample's, or the mean that ends with it.
        text: what, when and which limit, for people.
    """

    sample: int
    index: int
    limit: str
    channel: str
    value: float
    bound: float
    text: str


def judged_samples(limits: LimitsOptions, sample_rate: float) -> int:
    """Over how many samples the rate is averaged; `sample_rate` in Hz."""
    longest = min(limits.rate_time, SHARE * limits.angle / limits.rate)
    return max(1, math.floor(longest * sample_rate + ROUNDING))


class LimitWatch:
    """Watches one trial, block by block.

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
        """A watch over one trial.

        Args:
            sample_rate: of the recording (Hz).
            channels: names, in the order of the blocks.
            sides: how the bench moves, for the words of a violation.
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
        # The window before the one that is being filled, and what there is of that.
        self._rates = np.zeros(self._count)

    def look(self, time: Array, block: Array) -> Violation | None:
        """The first sample of the next `block` (channels, n) at `time` (n,) that breaks a limit.

        To be asked no more once one has. An undefined value breaks none.
        """
        first, found = len(time), None
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
                found = self._violation(watched, first, value, bound, float(time[first]))
        self._seen += len(time)
        return found

    def skip(self, count: int) -> None:
        """The next `count` samples were lost."""
        self._remember(np.concatenate([self._rates, np.zeros(count)]), count)
        self._seen += count

    def _sums(self, rates: Array, bound: float) -> tuple[Array, float]:
        """Of the last n rates, at each of them; and what their magnitude must not pass.

        None where no rate is beyond `bound`: then no mean is.
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
        """Keep of `joined` what the next block needs, once `more` samples have been seen."""
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
    """Whether all are at most `bound` either way, none undefined; faster than by magnitudes."""
    low, high = np.min(values, initial=0.0), np.max(values, initial=0.0)
    return bool(-bound <= low and high <= bound)
