"""Numbers, units and names as text."""

from __future__ import annotations

import csv
import difflib
import io
import math
import re
from collections.abc import Iterable, Sequence

from campaign.axis_kind import in_axis_terms

MOST_DIGITS = 9
"""Maximum number of digits of a number with an interval."""
MOST_DECIMALS = 7
"""Maximum number of decimals of such a number below 0.01; beyond it, an exponent is used."""
NARROW, SHORT = 1e-5, 5
"""Relative half-width below which tables omit an interval, and the digits of the number then: the
interval is narrower than the last digit."""
_ROUNDING = 1e-12  # relative half-width below which it is a rounding error
_LEAST = 1e-290  # smallest half-width that can be written


def number(value: float | None, digits: int = 4, decimals: int = 0) -> str:
    """Text of a number: `digits` significant digits, an exponent only if necessary.

    Digits before the point are never rounded. A number that is exact with fewer digits keeps at
    least `decimals` decimals.
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
    """Text of a number with its interval: `3.87 ± 0.12`; asymmetric: `3.87 (3.80 to 4.10)`.

    Half-widths have two significant digits. The number ends at the same digit, before or after the
    point (401000 ± 12000), with at most `MOST_DIGITS` digits. Very large or small numbers have a
    common exponent: `(4.01 ± 0.12) × 10⁹`; also small ones with more than `MOST_DECIMALS` decimals.
    A one-sided interval shows its side; an interval within the rounding error is `± 0`.
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
    # Position of the last shown digit; rounded first, since 0.0996 is shown as 0.10.
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
    """Text of a number, rounded to 10**place, in units of 10**power."""
    rounded = round(value, -place) / 10.0**power if place > 0 else value / 10.0**power
    text = f"{rounded:.{max(0, power - place)}f}"
    return minus(text if float(text) else text.removeprefix("-"))


def csv_text(headers: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """CSV text with every digit of a float, `true` or `false`, and an empty cell for None."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(headers)
    writer.writerows([_exact(value) for value in row] for row in rows)
    return text.getvalue()


def _exact(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(float(value)) if isinstance(value, float) else str(value)


def percent(value: float | None) -> str:
    """Text of a deviation in %: signed; 2 decimals below 1 %, 1 below 100 %, else none."""
    if value is None or not math.isfinite(value):
        return "–"
    if abs(value) < 0.005:
        return "0.00 %"
    decimals = 2 if abs(value) < 1 else 1 if abs(value) < 100 else 0
    return minus(f"{value:+.{decimals}f} %")


_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def minus(text: str) -> str:
    """Replace hyphens by the typographic minus sign."""
    return text.replace("-", "−")


def pretty_unit(unit: str) -> str:
    """Displayed form of a unit: `deg/s²`, `N·m`, `%`."""
    shown = unit.replace("percent", "%").replace("^2", "²").replace("^3", "³").replace("ohm", "Ω")
    shown = re.sub(r"\bu(?=(rad|m|s|N|J|A|V)\b)", "µ", shown)
    return re.sub(r"(?<=\w) (?=\w)", "·", shown).replace("deg", "°" if unit == "deg" else "deg")


def in_rows(numbers: Iterable[int]) -> str:
    """Text of sorted whole numbers, with ranges: `1 to 4, 6, 8 and 9`."""
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


def capitalized(text: str) -> str:
    """The text with a capital first letter; all other letters are unchanged."""
    return text[:1].upper() + text[1:]


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
"""Displayed names of quantities that differ from their names in files."""


def shortened(lines: Sequence[str], most: int, others: str = "more") -> list[str]:
    """The first `most` lines, then `and N more` if there are others."""
    rest = len(lines) - most
    return [*lines[:most], *([f"and {rest} {others}"] if rest > 0 else [])]


def quantity_words(quantity: str) -> str:
    """`coulomb_torque` as `Coulomb friction Tc`, `breakaway_torque` as `breakaway torque`."""
    return in_axis_terms(QUANTITIES.get(quantity, quantity.replace("_", " ")))


_SAID_BY_THE_FIELD = ("friction", "compensation")


def path_words(path: str) -> str:
    """A dotted path as words: `bench.gear.preload.torque` is `gear preload torque`.

    The tables `friction` and `compensation` are omitted: friction of the load is
    `load coulomb torque`.
    """
    parts = path.split(".")
    if parts[0] == "bench" and len(parts) > 1:
        parts = parts[1:]
        if parts[0] in _SAID_BY_THE_FIELD and len(parts) > 2:
            parts = parts[1:]
    return in_axis_terms(" ".join(" ".join(parts).replace("_", " ").split()))


def nearest(word: object, names: Iterable[str]) -> str:
    """Hint for a message if `word` resembles one of `names`; else empty."""
    known = {name.lower(): name for name in names}
    close = difflib.get_close_matches(str(word).lower(), known, n=1, cutoff=0.6)
    return f"; did you mean {known[close[0]]!r}?" if close else ""


def words(name: str) -> str:
    """`coulomb positive`."""
    return name.replace("_", " ")


def clock(seconds: float) -> str:
    """`0:42`, `12:05`, `3:07:30`."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}" if hours else f"{minute}:{second:02}"
