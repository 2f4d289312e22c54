"""Cells of a text file: numbers in either notation, units, names with units."""

from __future__ import annotations

import re
import unicodedata

from campaign.unit_grammar import parse_unit

_EXPONENT = r"(?:[eEdD][+-]?\d+)?"
NUMBER = {
    ".": re.compile(rf"[+-]?(?:\d+(?:\.\d*)?|\.\d+){_EXPONENT}"),
    ",": re.compile(rf"[+-]?(?:\d{{1,3}}(?:\.\d{{3}})+(?:,\d*)?|\d+(?:,\d*)?|,\d+){_EXPONENT}"),
}
"""A number by its decimal sign; with a comma, points may group thousands."""
_NO_NUMBER = (
    "nan +nan -nan -nan(ind) na n/a #n/a null none inf +inf -inf - -- --- "
    "1.#qnan -1.#qnan 1.#ind -1.#ind 1.#inf -1.#inf"
)
LOST = frozenset({"", *_NO_NUMBER.split()})
"""Cells of a numeric column without a number, in lower case; infinity is no measurement."""
NO_UNIT = frozenset({"", "-", "–", "1", "none", "(none)", "[-]", "(-)", "unitless", "n/a"})
UNIT_WORDS = {
    word: unit
    for unit, words in {
        "V": "volt volts",
        "A": "ampere amperes amp amps",
        "s": "second seconds",
        "N": "newton",
        "rpm": "u/min umdr/min tr/min t/min giri/min",
        "1/min": "min-1",
        "percent": "%",
        "count": "inc ticks cnt cnts",
        "count/s": "cnt/s",
    }.items()
    for word in words.split()
}
"""Unit in the program's grammar by its lower-case spelling in instruments."""
_BRACKETED = re.compile(r"(?P<name>.*?\S)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")


def plain(text: str) -> str:
    """Text without byte order mark and outer blanks, with one form of µ and composed letters."""
    return unicodedata.normalize("NFC", text).replace("\u00b5", "\u03bc").strip("\ufeff \t\r\n\xa0")


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a finite number with that decimal sign, `.` or `,`."""
    return NUMBER[decimal].fullmatch(cell) is not None


def is_lost(cell: str) -> bool:
    """Whether a cell states that it has no number."""
    return cell.lower() in LOST


def value_of(cell: str, decimal: str) -> float:
    """The number in a cell, NaN for a lost value; ValueError for other text."""
    if is_lost(cell):
        return float("nan")
    if not is_number(cell, decimal):
        raise ValueError(cell)
    if decimal == ",":
        cell = cell.replace(".", "").replace(",", ".")
    value = float(cell.replace("d", "e").replace("D", "e"))
    if value in (float("inf"), -float("inf")):
        raise ValueError(cell)  # larger than any float
    return value


def is_unit(cell: str) -> bool:
    """Whether a cell may be in a row of units; an empty cell may."""
    bare = without_brackets(cell)
    if bare.lower() in NO_UNIT or bare.lower() in UNIT_WORDS or bare == "‰":
        return True
    try:
        parse_unit(bare)
    except ValueError:
        return False
    return True


def without_brackets(cell: str) -> str:
    """A unit without its outer brackets."""
    cell = cell.strip()
    pair = cell[:1] + cell[-1:]
    return cell[1:-1].strip() if pair in ("()", "[]", "<>") and len(cell) > 1 else cell


def name_and_unit(heading: str) -> tuple[str, str]:
    """Split `speed [rpm]` into `speed` and `rpm`; without a unit in brackets, all is the name."""
    match = _BRACKETED.fullmatch(heading.strip())
    if match is None:
        return heading.strip(), ""
    unit = (match["square"] if match["square"] is not None else match["round"]).strip()
    if not unit or unit.lower() in NO_UNIT:
        return (heading.strip(), "") if unit.isdigit() else (match["name"], "")
    return (match["name"], unit) if is_unit(unit) else (heading.strip(), "")
