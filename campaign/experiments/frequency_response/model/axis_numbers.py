"""Numbers of the axis from a response that friction distorts.

A best linear approximation belongs to its excitation (Pintelon and Schoukens, "System
Identification: A Frequency Domain Approach" (2012), 3.4): its inertia is that of the response, not
that of the axis. The difference is a bias: no scatter shows it, and the level of distortion is
none of its bounds, as friction that acts like a spring or a damper distorts little. What tells it
is how the numbers move with the excitation: as its rms rises, friction's share falls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from campaign.estimate import Estimate
from campaign.estimation.frequency.distortion import total
from campaign.estimation.frequency.drive import TwoMass
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import shifted_by
from campaign.experiments.responses.sources import Source
from campaign.reason import Cause

BENT = 0.03
"""Odd distortion over the output from which on one amplitude tells no number of the axis."""
SLOWEST = 0.5
"""Least power of the rms by which friction's share falls: between that of bristles, which does not
fall before they slip, and 1, that of Coulomb friction."""
FRICTION = "friction, at this excitation"
UNKNOWN = Cause(
    "friction at one amplitude",
    "friction has a part in it, and no second amplitude shows how large: measure at half or twice "
    "of this one",
)
BY_RULE = {
    "motor_inertia": 1.0,
    "load_inertia": 1.0,
    "total_inertia": 1.0,
    "inertia_ratio": 1.0,
    "stiffness": 1.0,
    "resonance": 0.05,
    "antiresonance": 0.05,
}
"""Friction's part (1 sigma, relative) over the odd distortion, where that is below `BENT`: of
simulated rigs with bristles that slip. A rule of thumb: no theory bounds the one by the other."""
LEAST = 0.25
"""of that part, or of that at `BENT`, stays where a second amplitude tells less: the two may agree
by chance."""
NUMBERS = (*BY_RULE, "damping", "resonance_damping", "antiresonance_damping")
"""Numbers of a drive that friction shifts; what it adds to a damping, no level tells."""


@dataclass(frozen=True)
class Weaker:
    """What a response to less excitation tells of the same drive.

    Attributes:
        ratio: of the rms of the stronger excitation to this one's, above 1.
    """

    drive: TwoMass
    ratio: float


def odd_distortion(source: Source) -> float:
    """Over the output, as far as it is told from the noise: zero where it is not."""
    levels = [total(each.distortion, "odd") for each in source.best.values() if each.distortion]
    told = [level.value for level in levels if level.kind == "number"]
    return max((value for value in told if math.isfinite(value)), default=0.0)


def of_axis(drive: TwoMass, odd: float, weaker: Sequence[Weaker]) -> TwoMass:
    """The drive with numbers of the axis in place of the response's.

    Args:
        odd: distortion over the output that is told from the noise; zero where none is.
        weaker: what responses to less excitation tell; none with one amplitude.
    """
    if not odd:
        return drive
    changed: dict[str, Any] = {}
    for name in NUMBERS:
        one = getattr(drive, name)
        if one.has_interval:
            parts = list(_extrapolated(one, name, weaker))
            least = LEAST * BY_RULE.get(name, 0.0) * min(odd, BENT) * abs(one.value)
            changed[name] = with_part(one, max(*parts, least)) if parts else by_rule(one, odd)
    return replace(drive, **changed)


def by_rule(one: Estimate, odd: float) -> Estimate:
    """Of the axis, from one amplitude, with this odd distortion; not determined where it is much.

    `one`: named as the number of a drive.
    """
    if not odd or not one.has_interval:
        return one
    if odd > BENT or one.name not in BY_RULE:
        return Estimate.without_interval(one.name, math.nan, one.unit, UNKNOWN())
    return with_part(one, BY_RULE[one.name] * odd * abs(one.value))


def with_part(one: Estimate, part: float) -> Estimate:
    """With friction's part (1 sigma)."""
    return admitted(shifted_by(one, FRICTION, part))


def _extrapolated(one: Estimate, name: str, weaker: Sequence[Weaker]) -> Iterator[float]:
    """What friction may still have in a number, as each weaker excitation has it (1 sigma).

    A share that falls as rms**-p is (weaker - stronger) / (ratio**p - 1) at the stronger one. The
    difference is known as well as both numbers are.
    """
    for each in weaker:
        other = getattr(each.drive, name)
        if not other.has_interval or one.standard_error is None or other.standard_error is None:
            continue
        apart = math.hypot(other.value - one.value, one.standard_error, other.standard_error)
        yield apart / (each.ratio**SLOWEST - 1.0) / math.sqrt(3.0)
