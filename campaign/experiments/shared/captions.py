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
    """A result for a caption, `1.50 N·m`, from SI to the display unit.

    Units here and below are those of a rotary axis; the text has those of the axis (`axis_kind`).
    """
    if not math.isfinite(value):
        return "an unknown size"
    unit, display = axis_unit(unit), axis_unit(display)
    shown = convert(value, unit, display or unit)
    large = abs(float(f"{shown:.{digits}g}")) >= 10.0**digits  # 999.7 is 1000
    text = f"{shown:.0f}" if large else f"{shown:#.{digits}g}".rstrip(".")
    return _with_unit(text, display or unit)


def setting(value: float, unit: str, display: str = "") -> str:
    """A setting for a caption, `1.5 N·m`: up to four digits, without trailing zeros."""
    unit, display = axis_unit(unit), axis_unit(display)
    return _with_unit(f"{convert(value, unit, display or unit):.4g}", display or unit)


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {pretty_unit(unit)}".rstrip().replace("-", "−", 1)


def duration(seconds: float) -> str:
    """A short time for a caption: `1.5 ms`, `2 s`."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def surely_above(found: Estimate, level: float, spare: float = 0.0) -> bool:
    """Whether a number exceeds a level by more than `spare`, and its whole interval the level.

    For a number without an interval, as of a simulation without scatter, `spare` alone decides.
    False for a number that is not determined.
    """
    if found.origin is Origin.NOT_DETERMINED or not found.value - level > spare:
        return False
    low = found.combined[0] if found.has_interval else found.value
    return low is not None and low > level


def listed(words: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def sentence(text: str) -> str:
    """A text with a capital letter and a full stop; empty for an empty text."""
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def trials_of(items: Iterable[TrialData]) -> tuple[int, ...]:
    """Numbers of the trials that a figure shows, each once, ascending."""
    return tuple(sorted({item.trial.number for item in items}))
