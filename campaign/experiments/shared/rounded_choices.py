"""Rounded default values of options, each with a reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from campaign.axis_kind import axis_unit
from campaign.experiments.interface import ChosenValue
from campaign.experiments.shared.rig import Rig
from campaign.units import convert, factor

Reasons = Mapping[str, float]
"""Sizes (SI) by reason."""


@dataclass
class Choices:
    """Values chosen for the options of one test; options written in the protocol are kept."""

    options: Any
    told: dict[str, ChosenValue] = field(default_factory=dict)

    def least(self, name: str, unit: str, reasons: Reasons) -> float:
        """The smallest of some sizes, with few digits in `unit`, rounded towards zero."""
        why = min(reasons, key=lambda reason: reasons[reason])
        return float(self.take(name, nice(reasons[why], unit), why))

    def most(self, name: str, unit: str, reasons: Reasons) -> float:
        """The largest of some sizes, with few digits in `unit`, rounded away from zero."""
        why = max(reasons, key=lambda reason: reasons[reason])
        return float(self.take(name, nice(reasons[why], unit, up=True), why))

    def take(self, name: str, value: Any, why: str) -> Any:
        """Value of the option: as written, or `value` with its reason."""
        if name in self.options.model_fields_set:
            return getattr(self.options, name)
        self.told[name] = ChosenValue(value, why)
        return value

    def sample_rate(self, rig: Rig) -> float:
        """Sample rate of the recording (Hz)."""
        return float(self.take("sample_rate", rig.sample_rate, "the controller's own rate"))


def share(limit: str, part: float) -> str:
    """`80 % of the angle limit`."""
    return f"{100 * part:.0f} % of the {limit} limit"


def nice(value: float, unit: str, digits: int = 2, *, up: bool = False) -> float:
    """SI value rounded to few digits in `unit`, towards zero, or away from it (`up`)."""
    si, unit = axis_unit(SI.get(unit, unit)), axis_unit(unit)
    shown = float(convert(value, si, unit))
    if shown == 0.0 or not math.isfinite(shown):
        return value
    step = 10.0 ** (math.floor(math.log10(abs(shown))) - digits + 1)
    count = abs(shown) / step
    whole = math.ceil(count - 1e-9) if up else math.floor(count + 1e-9)
    return float(f"{math.copysign(whole * step, shown):.{digits + 2}g}") * factor(unit, si)


SI = {"deg": "rad", "deg/s": "rad/s", "deg/s^2": "rad/s^2"}
"""Display units used here, of a rotary axis, with their SI units; the others are SI."""
