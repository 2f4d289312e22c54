"""Numbers and units as people read them."""

from __future__ import annotations

import math
import re


def number(value: float | None, digits: int = 4, decimals: int = 0) -> str:
    """A number for people: `digits` significant ones, no exponent where none is needed.

    Digits before the point are never rounded away. A number that is exact with fewer keeps at
    least `decimals` after the point.
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return f"{0:.{decimals}f}"
    short = float(f"{value:.{digits}g}") if abs(value) < 10.0**digits else float(round(value))
    if not 1e-5 <= abs(short) < 10.0 ** (digits + 3):
        mantissa, exponent = f"{short:.{digits - 1}e}".split("e")
        return minus(f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPT)}")
    most = max(0, digits - 1 - math.floor(math.log10(abs(short))))
    if math.isclose(short, value, rel_tol=1e-12):
        exact = (n for n in range(most) if float(f"{short:.{n}f}") == short)
        most = max(next(exact, most), min(decimals, most))
    return minus(f"{short:.{most}f}")


def percent(value: float | None) -> str:
    """A deviation for people: signed, two significant digits, at least one decimal below 10 %."""
    if value is None or not math.isfinite(value):
        return "–"
    if abs(value) < 0.005:
        return "0.00 %"
    decimals = 2 if abs(value) < 1 else 1 if abs(value) < 100 else 0
    return minus(f"{value:+.{decimals}f} %")


_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def minus(text: str) -> str:
    """With the minus sign of print."""
    return text.replace("-", "−")


def pretty_unit(unit: str) -> str:
    """A unit as people read it: `deg/s²`, `N·m`, `%`."""
    shown = unit.replace("percent", "%").replace("^2", "²").replace("^3", "³").replace("ohm", "Ω")
    return re.sub(r"(?<=\w) (?=\w)", "·", shown).replace("deg", "°" if unit == "deg" else "deg")
