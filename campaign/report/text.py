"""Numbers and units as people read them."""

from __future__ import annotations

import math
import re

MOST_DIGITS = 9
"""that a number with an interval is shown with."""
_ROUNDING = 1e-12  # share of a number below which its half-width is a rounding error


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


def interval(value: float | None, low: float | None, high: float | None) -> str:
    """A number with its interval: `3.87 ± 0.12`, or `3.87 (3.80 to 4.10)` where it is lopsided.

    Half-widths have two significant digits and the number as many decimals, but no more than
    `MOST_DIGITS` in all. An interval that is open on one side says which side it has; one that is a
    rounding error of the number is shown as none.
    """
    if value is None or not math.isfinite(value) or (low is None and high is None):
        return number(value)
    if low is None or high is None:
        return f"{number(value)} ({f'≥ {number(low)}' if high is None else f'≤ {number(high)}'})"
    half = 0.5 * (high - low)
    if not math.isfinite(half):
        return number(value)
    if not half > _ROUNDING * abs(value):
        return f"{number(value)} ± 0"
    lopsided = abs(high + low - 2 * value) > 0.1 * half
    # Rounded first: 0.0996 is 0.10, with two decimals.
    decimals = max(0, 1 - math.floor(math.log10(float(f"{half:.1e}"))))
    largest = max(abs(value), half)
    digits = math.floor(math.log10(largest)) + 1 + decimals
    if 1e-5 <= largest < 1e6 and digits <= MOST_DIGITS:
        shown = [f"{each:.{decimals}f}" for each in (value, half, low, high)]
    else:
        most = min(digits, MOST_DIGITS)
        shown = [number(value, most), number(half, 2), number(low, most), number(high, most)]
    middle, wide, *ends = map(minus, shown)
    return f"{middle} ({ends[0]} to {ends[1]})" if lopsided else f"{middle} ± {wide}"


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
