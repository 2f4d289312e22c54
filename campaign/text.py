"""Numbers, units and names as text."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Sequence

from campaign.axis_kind import in_axis_terms

MOST_DIGITS = 9
"""that a number with an interval is shown with."""
MOST_DECIMALS = 7
"""of such a number below 0.01; one that needs more has an exponent."""
NARROW, SHORT = 1e-5, 5
"""Half-width, as a share of its number, below which tables leave an interval out, and
the digits that the number then has: the interval is narrower than the last of them."""
_ROUNDING = 1e-12  # share of a number below which its half-width is a rounding error
_LEAST = 1e-290  # half-width below which no digit of it could be written


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

    Half-widths have two significant digits and the number ends where they do, before the point as
    behind it (401000 ± 12000), but has no more than `MOST_DIGITS` in all. What is very large or
    very small has one exponent for all: `(4.01 ± 0.12) × 10⁹`; so has what is small and would have
    more than `MOST_DECIMALS`. An interval that is open on one side says which side it has; one that
    is a rounding error of the number is shown as none.
    """
    if value is None or not math.isfinite(value) or (low is None and high is None):
        return number(value)
    if low is None or high is None:
        return f"{number(value)} ({f'≥ {number(low)}' if high is None else f'≤ {number(high)}'})"
    half = 0.5 * (high - low)
    if not math.isfinite(half):
        return number(value)
    if not half > max(_ROUNDING * abs(value), _LEAST):
        return f"{number(value)} ± 0"
    lopsided = abs(high + low - 2 * value) > 0.1 * half
    largest = max(abs(value), half)
    size = math.floor(math.log10(largest))
    # Of the last digit that is shown; rounded first, as 0.0996 is 0.10.
    place = math.floor(math.log10(float(f"{half:.1e}"))) - 1
    if size - place + 1 > MOST_DIGITS:
        middle, *ends = (number(each, MOST_DIGITS) for each in (value, low, high))
        return _with_ends(middle, number(half, 2), ends if lopsided else [])
    many = largest < 1e-2 and place < -MOST_DECIMALS
    power = 0 if 1e-4 <= largest < 1e6 and not many else size
    middle, wide, *ends = (_to(each, place, power) for each in (value, half, low, high))
    shown = _with_ends(middle, wide, ends if lopsided else [])
    if not power:
        return shown
    return f"{shown if lopsided else f'({shown})'} × 10{str(power).translate(_SUPERSCRIPT)}"


def _with_ends(middle: str, wide: str, ends: Sequence[str]) -> str:
    return f"{middle} ({ends[0]} to {ends[1]})" if ends else f"{middle} ± {wide}"


def _to(value: float, place: int, power: int) -> str:
    """A number up to the digit of 10**place, in units of 10**power."""
    rounded = round(value, -place) / 10.0**power if place > 0 else value / 10.0**power
    text = f"{rounded:.{max(0, power - place)}f}"
    return minus(text if float(text) else text.removeprefix("-"))


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
    shown = re.sub(r"\bu(?=(rad|m|s|N|J|A|V)\b)", "µ", shown)
    return re.sub(r"(?<=\w) (?=\w)", "·", shown).replace("deg", "°" if unit == "deg" else "deg")


def in_rows(numbers: Iterable[int]) -> str:
    """Whole numbers in increasing order, those in a row by their ends: `1 to 4, 6, 8 and 9`."""
    rows: list[list[int]] = []
    for each in sorted(set(numbers)):
        if rows and each == rows[-1][-1] + 1:
            rows[-1].append(each)
        else:
            rows.append([each])
    shown = [
        part
        for row in rows
        for part in ([f"{row[0]} to {row[-1]}"] if len(row) > 2 else [str(each) for each in row])
    ]
    return " and ".join((", ".join(shown[:-1]), shown[-1])) if len(shown) > 1 else "".join(shown)


def of_trials(numbers: Iterable[int]) -> str:
    """`Trial 3`, `Trials 1 to 160`; empty for none."""
    numbers = tuple(numbers)
    return f"Trial{'s' if len(set(numbers)) > 1 else ''} {in_rows(numbers)}" if numbers else ""


def count(number: int, one: str, many: str = "") -> str:
    """`1 map`, `3 maps`."""
    return f"{number} {one if number == 1 else many or one + 's'}"


QUANTITIES = {
    "coulomb_torque": "Coulomb friction Tc",
    "static_torque": "static friction Ts",
    "stribeck_velocity": "Stribeck velocity vs",
    "stribeck_exponent": "Stribeck exponent δ",
    "viscous_friction": "viscous friction σ2",
    "bristle_stiffness": "bristle stiffness σ0",
    "bristle_damping": "bristle damping σ1",
    "stabilization_error": "stabilization error (1σ)",
    "stabilization_error_at_gain": "stabilization error (1σ)",
    "error_reduction": "error reduction, times",
    "stick_slip_first_slip": "first slip after",
    "stick_slip_period": "period of stick-slip",
    "stick_slip_peak_torque": "largest torque of the spring",
    "stick_slip_top_rate": "largest rate of the load",
    "model_property": "property",
}
"""What people call a quantity whose name in files is not what they call it."""


def quantity_words(quantity: str) -> str:
    """`coulomb_torque` as `Coulomb friction Tc`, `breakaway_torque` as `breakaway torque`."""
    return in_axis_terms(QUANTITIES.get(quantity, quantity.replace("_", " ")))


_SAID_BY_THE_FIELD = ("friction", "compensation")


def path_words(path: str) -> str:
    """A dotted path as words: `bench.gear.preload.torque` is `gear preload torque`.

    Of a table that only says what kind of thing follows the name is left out: friction of the load
    is `load coulomb torque`.
    """
    parts = path.split(".")
    if parts[0] == "bench" and len(parts) > 1:
        parts = parts[1:]
        if parts[0] in _SAID_BY_THE_FIELD and len(parts) > 2:
            parts = parts[1:]
    return in_axis_terms(" ".join(" ".join(parts).replace("_", " ").split()))


def nearest(word: object, names: Iterable[str]) -> str:
    """What to append to a message when `word` looks like a slip for one of `names`."""
    known = {name.lower(): name for name in names}
    close = difflib.get_close_matches(str(word).lower(), known, n=1, cutoff=0.6)
    return f"; did you mean {known[close[0]]!r}?" if close else ""


def words(name: str) -> str:
    """`coulomb positive`."""
    return name.replace("_", " ")
