"""Numbers of the axis from a response that friction distorts.

A best linear approximation belongs to its excitation (Pintelon and Schoukens, "System
Identification: A Frequency Domain Approach" (2012), 3.4): its inertia is that of the response, not
that of the axis. The difference is a bias that no scatter shows. The level of distortion does not
bound it, because friction that acts like a spring or a damper distorts little. The change of the
numbers with the excitation shows it: as its rms rises, friction's share falls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from campaign.estimate import Estimate
from campaign.estimation.frequency.distortion import total
from campaign.estimation.frequency.drive import TwoMass
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import shifted_by
from campaign.experiments.responses.sources import Source
from campaign.reason import Cause

BENT = 0.03
"""Odd distortion over the output above which one amplitude determines no number of the axis."""
SLOWEST = 0.5
"""Least exponent by which friction's share falls with the rms: between 0, of bristles that do not
slip, and 1, of Coulomb friction."""
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
"""Relative standard uncertainty by friction over the odd distortion, for distortion below `BENT`:
from simulated rigs with slipping bristles. A rule of thumb: no theory bounds one by the other."""
LEAST = 0.25
"""Share of that part, or of that at `BENT`, that remains if a second amplitude shows less: the two
may agree by chance."""
NUMBERS = (*BY_RULE, "damping", "resonance_damping", "antiresonance_damping")
"""Numbers of a drive that friction shifts. No level of distortion shows its part in a damping."""


@dataclass(frozen=True)
class Weaker:
    """Drive from a response to less excitation.

    Attributes:
        ratio: rms of the stronger excitation over this one's, above 1.
    """

    drive: TwoMass
    ratio: float


def odd_distortion(source: Source) -> float:
    """Odd distortion over the output; zero if it does not exceed the noise."""
    levels = [total(each.distortion, "odd") for each in source.best.values() if each.distortion]
    sizes = [level.value for level in levels if level.kind == "number"]
    return max((value for value in sizes if math.isfinite(value)), default=0.0)


def of_axis(drive: TwoMass, odd: float, weaker: Sequence[Weaker]) -> TwoMass:
    """Drive with numbers of the axis in place of the response's.

    Args:
        odd: odd distortion over the output that exceeds the noise, or zero.
        weaker: drives from responses to less excitation; empty with one amplitude.
    """
    if not odd:
        return drive
    changed = {}
    for name in NUMBERS:
        one = drive.estimates[name]
        if one.has_interval:
            parts = list(_extrapolated(one, name, weaker))
            least = LEAST * BY_RULE.get(name, 0.0) * min(odd, BENT) * abs(one.value)
            changed[name] = with_part(one, max(*parts, least)) if parts else by_rule(one, odd)
    return replace(drive, estimates={**drive.estimates, **changed})


def by_rule(one: Estimate, odd: float) -> Estimate:
    """Number of the axis from one amplitude with this odd distortion; undetermined if it is large.

    `one`: named as the number of a drive.
    """
    if not odd or not one.has_interval:
        return one
    if odd > BENT or one.name not in BY_RULE:
        return Estimate.without_interval(one.name, math.nan, one.unit, UNKNOWN())
    return with_part(one, BY_RULE[one.name] * odd * abs(one.value))


def with_part(one: Estimate, part: float) -> Estimate:
    """Estimate with friction's part (1 sigma)."""
    return admitted(shifted_by(one, FRICTION, part))


def _extrapolated(one: Estimate, name: str, weaker: Sequence[Weaker]) -> Iterator[float]:
    """Friction's possible remaining part (1 sigma) in a number, by each weaker excitation.

    A share that falls as rms**-p is (weaker - stronger) / (ratio**p - 1) at the stronger one. The
    uncertainty of the difference is that of both numbers.
    """
    for each in weaker:
        other = each.drive.estimates[name]
        if not other.has_interval or one.standard_error is None or other.standard_error is None:
            continue
        apart = math.hypot(other.value - one.value, one.standard_error, other.standard_error)
        yield apart / (each.ratio**SLOWEST - 1.0) / math.sqrt(3.0)
