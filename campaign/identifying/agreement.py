"""Whether methods that found the same number from other parts of the motion agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from campaign.estimate import Estimate
from campaign.identifying.identification import Section
from campaign.identifying.tables import told, words

SAME = {"coulomb_torque": "coulomb", "viscous_friction": "viscous"}
"""Names of one method for what others call so."""
COMPARED = ("coulomb", "viscous", "inertia")
WORTH_TELLING = 0.1
"""of the larger of two values by which they are apart at least."""


def disagreements(sections: Sequence[Section]) -> Iterator[str]:
    """Of numbers whose intervals exclude each other, a sentence; the widest gap of each alone."""
    found: dict[str, list[tuple[str, Estimate, str]]] = {}
    for section in sections:
        for each in section.parameters:
            name = each.estimate.name
            for own, common in SAME.items():
                name = name.replace(own, common) if name.startswith(own) else name
            if name.split("_")[0] in COMPARED and each.estimate.has_interval:
                found.setdefault(name, []).append(
                    (section.method.name, each.estimate, each.display)
                )
    for name, several in found.items():
        pairs = [(_gap(one[1], other[1]), one, other) for one, other in combinations(several, 2)]
        gap, one, other = max(pairs, key=lambda pair: pair[0], default=(0.0, None, None))
        if gap <= 0 or one is None or other is None:
            continue
        yield (
            f"Methods disagree about {words(name)}: {one[0]} finds {told(one[1], one[2])}, "
            f"{other[0]} {told(other[1], other[2])}. At least one model lacks something of this "
            "rig (look at what is left over), or the motion confuses place with direction: slide "
            "over the same travel in both."
        )


def _gap(one: Estimate, other: Estimate) -> float:
    """Between two intervals; 0 where they meet, or the values are hardly apart."""
    (a, b), (c, d) = one.combined, other.combined
    if None in (a, b, c, d):
        return 0.0
    apart = abs(one.value - other.value)
    if apart < WORTH_TELLING * max(abs(one.value), abs(other.value)):
        return 0.0
    return max(float(c) - float(b), float(a) - float(d), 0.0)  # type: ignore[arg-type]
