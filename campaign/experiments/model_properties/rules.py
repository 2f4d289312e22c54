"""Rules for properties of friction models, each with two controls (Table 3.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

MET, PARTLY, BLANK = 1.0, 0.5, 0.0
"""The marks +, o and blank of the thesis' table."""
MARKS = {MET: "+", PARTLY: "o", BLANK: "–"}
DEPENDS = "depends"
"""The mark differs between parameter sets."""
LOSS = 0.05
"""Smallest loss factor of a presliding loop: 0 for a spring, 4/pi for dry sliding."""
CLOSES = 0.01
"""Largest closing error of an inner loop, over the torque of the outer loop."""
REVERSIBLE = 0.5
"""Smallest reversible share of a displacement in presliding."""


@dataclass(frozen=True)
class Rule:
    """A property, and the decision on it by a measured number.

    Attributes:
        name: of the property, as the table's row.
        shows: name of the number that decides.
        threshold: value from which the property is met; from half of it, it is partly met.
        sign: name of a further number; if it is not above zero, the property is partly met.
        text: the rule, for a reader.
        positive, negative: the controls: a model that has the property, and one that lacks it.
    """

    name: str
    shows: str
    threshold: float
    text: str
    positive: str
    negative: str
    sign: str = ""

    def mark(self, numbers: Mapping[str, float]) -> float:
        """The mark by the measured numbers of a model, by name."""
        value = numbers[self.shows]
        if value < 0.5 * self.threshold:
            return BLANK
        whole = value >= self.threshold and not (self.sign and numbers[self.sign] <= 0.0)
        return MET if whole else PARTLY


RULES = (
    Rule(
        "coulomb friction", "coulomb_share", 0.5,
        "torque of sliding extrapolated to zero rate, over Tc: at least 0.5",
        positive="coulomb", negative="viscous friction alone",
    ),
    Rule(
        "viscous friction", "viscous_share", 0.5,
        "slope of the torque of fast sliding over the rate, over σ2: at least 0.5",
        positive="coulomb", negative="dahl",
    ),
    Rule(
        "static friction", "stiction_share", 0.5,
        "breakaway torque of the slowest ramp less that of sliding, over Ts − Tc: at least 0.5",
        positive="stribeck", negative="coulomb",
    ),
    Rule(
        "stribeck effect", "dip_share", 0.5,
        "fall of the torque of sliding with the rate, over Ts − Tc: at least 0.5, and a rise above",
        positive="stribeck", negative="coulomb", sign="rise_share",
    ),
    Rule(
        "friction lag", "lag_share", 0.05,
        "width of the loop around a positive rate, over Ts − Tc: at least 0.05; at a tenth of "
        "the frequency at most half of it",
        positive="lugre", negative="stribeck", sign="lag_vanishes",
    ),
    Rule(
        "breakaway", "breakaway_fall", 0.1,
        "fall of the breakaway torque over three decades of ramp rate, after a long rest, over "
        "Ts − Tc: at least 0.1",
        positive="lugre", negative="dahl",
    ),
    Rule(
        "stick-slip", "rests", 10.0,
        "the load, pulled through a soft spring, rests for about a fifth of a period in ten "
        "successive periods; through a stiff one in none",
        positive="stribeck", negative="coulomb", sign="smooth_when_stiff",
    ),
    Rule(
        "presliding", "reversible_share", REVERSIBLE,
        "share of a displacement of s(0) / 2 σ0 that comes back as the torque goes to zero: at "
        "least 0.5; the loop loses energy, and an inner loop closes to 1 %",
        positive="gms", negative="stribeck", sign="hysteresis_with_memory",
    ),
    Rule(
        "nonlocal memory", "closure", 1.0,
        "1 % over the share by which an inner loop misses the point where it began: at least 1; 0 "
        "where presliding loses no energy, as a spring, or is none",
        positive="gms", negative="dahl",
    ),
    Rule(
        "no drift", "drift_margin", 1.0,
        "0.1 % of Tc / σ0 over the drift in a cycle: at least 1; in cycles 10 to 100, under a "
        "torque of 0.4 Tc with a vibration of 0.2 Tc",
        positive="stribeck", negative="lugre",
    ),
    Rule(
        "dwell time", "dwell_rise", 0.1,
        "rise of the breakaway torque from 0.01 s to 100 s at rest, over Ts − Tc: at least 0.1",
        positive="armstrong", negative="lugre",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class ModelVerdict:
    """Numbers and marks of a model over all parameter sets.

    Attributes:
        numbers: input of the rules, by set and name.
        sizes: numbers of `parameters`, of `state`, and of `switches`; None: not stated.
    """

    model: str
    numbers: Mapping[str, Mapping[str, float]]
    sizes: Mapping[str, int | None]

    def marks(self, rule: Rule) -> list[float]:
        """`MET`, `PARTLY` or `BLANK` of each set, ascending."""
        return sorted(rule.mark(numbers) for numbers in self.numbers.values())

    def sign(self, rule: Rule) -> str:
        """Mark as in the table: of all sets, or `DEPENDS`."""
        marks = self.marks(rule)
        return MARKS[marks[0]] if marks[0] == marks[-1] else DEPENDS
