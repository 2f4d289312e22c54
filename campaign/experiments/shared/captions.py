"""Parts of captions: numbers with units, lists, trials."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from campaign.axis_kind import axis_unit
from campaign.estimate import Estimate, Origin
from campaign.experiments.interface import TrialData
from campaign.text import pretty_unit
from campaign.units import convert


def amount(value: float, unit: str, display: str = "", digits: int = 3) -> str:
    """A number that was found, for a caption, `1.50 N·m`, from SI to the unit that is shown.

    Units here and below are those of a rotary axis; told is what stands for them (`axis_kind`).
    """
    if not math.isfinite(value):
        return "an unknown size"
    unit, display = axis_unit(unit), axis_unit(display)
    shown = convert(value, unit, display or unit)
    large = abs(float(f"{shown:.{digits}g}")) >= 10.0**digits  # 999.7 is 1000
    text = f"{shown:.0f}" if large else f"{shown:#.{digits}g}".rstrip(".")
    return _with_unit(text, display or unit)


def setting(value: float, unit: str, display: str = "") -> str:
    """A number that was set, for a caption, `1.5 N·m`: no digits that nobody has set."""
    unit, display = axis_unit(unit), axis_unit(display)
    return _with_unit(f"{convert(value, unit, display or unit):.4g}", display or unit)


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {pretty_unit(unit)}".rstrip().replace("-", "−", 1)


def surely_above(found: Estimate, level: float, spare: float = 0.0) -> bool:
    """Whether a number is above a level: its whole interval, and by more than `spare`.

    A number without an interval, as of a simulation without scatter, is by more than `spare` alone;
    one that is not determined never is.
    """
    if found.origin is Origin.NOT_DETERMINED or not found.value - level > spare:
        return False
    low = found.combined[0] if found.has_interval else found.value
    return low is not None and low > level


def listed(words: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def sentence(text: str) -> str:
    """With a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def trials_of(items: Iterable[TrialData]) -> tuple[int, ...]:
    """Numbers of the trials that a figure shows, each once, ascending."""
    return tuple(sorted({item.trial.number for item in items}))
