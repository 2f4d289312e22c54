"""Agreement of methods that estimate one number from different motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from campaign.estimate import Estimate, Origin
from campaign.identify.identification import Section
from campaign.identify.tables import parameter_text, parameter_unit, parameter_words
from campaign.text import pretty_unit

SAME = {"coulomb_torque": "coulomb", "viscous_friction": "viscous"}
"""Names of one method, with the names that other methods use."""
COMPARED = ("coulomb", "viscous", "inertia")
WORTH_TELLING = 0.1
"""Least difference of two values that is reported, relative to the larger one."""
OVER_TEMPERATURE = "_over_temperature"
"""Ending of a name that marks a model of friction at one temperature, not a mean over several."""


def disagreements(sections: Sequence[Section]) -> Iterator[str]:
    """Sentences on measured numbers with disjoint intervals; for each number, the widest gap.

    Friction at one temperature is not compared with a mean over several.
    """
    estimates: dict[tuple[str, bool], list[tuple[str, Estimate, str]]] = {}
    for section in sections:
        names = {each.estimate.name for each in section.identified.parameters}
        for each in section.identified.parameters:
            name = each.estimate.name
            for own, common in SAME.items():
                name = name.replace(own, common) if name.startswith(own) else name
            measured = each.estimate.origin is Origin.MEASURED and each.estimate.has_interval
            if name.split("_")[0] in COMPARED and measured:
                at_one = f"{name.split('_')[0]}{OVER_TEMPERATURE}" in names
                estimates.setdefault((name, at_one), []).append(
                    (section.model.name, each.estimate, parameter_unit(section, each.estimate))
                )
    for (name, _), several in estimates.items():
        pairs = [(_gap(one[1], other[1]), one, other) for one, other in combinations(several, 2)]
        gap, one, other = max(pairs, key=lambda pair: pair[0], default=(0.0, None, None))
        if gap <= 0 or one is None or other is None:
            continue
        yield (
            f"Methods disagree about {parameter_words(name)}: {one[0]} finds "
            f"{parameter_text(*one[1:])} {pretty_unit(one[2])}, {other[0]} "
            f"{parameter_text(*other[1:])} {pretty_unit(other[2])}. "
            "At least one model lacks something of this rig: look at what is left over. Or the "
            "motion confuses place with direction: slide over the same travel in both."
        )


def _gap(one: Estimate, other: Estimate) -> float:
    """Gap between two intervals; 0 if they overlap or the values differ little."""
    (a, b), (c, d) = one.combined, other.combined
    if None in (a, b, c, d):
        return 0.0
    apart = abs(one.value - other.value)
    if apart < WORTH_TELLING * max(abs(one.value), abs(other.value)):
        return 0.0
    return max(float(c) - float(b), float(a) - float(d), 0.0)  # type: ignore[arg-type]
