"""Grammar and values of units.

    unit    = ["1"] factor { separator factor }
    factor  = ( name | "(" unit ")" ) [ power ]
    power   = ("^" | "**") integer | integer | superscripts        as in s^-1, cm2, min-1, m²
    separator = " " | "*" | "·" | "." | "/"

Names joined by hyphens (`N-m`, `oz-in-s^2`) are a product that counts as one name: `V/oz-in` is
`V/(ozf in)`. A power applies to the last of them, as in `kgm²`.

A quotient divides only by the next factor, from left to right: `V/A/s` is `V/(A s)`, and `V/A s`
is `(V/A) s`. Length, depth and powers are bounded, so that parsing any text is fast. The value is a
product of exact fractions.

To detect mistakes, some dimensionless SI units count as dimensions: an angle is no pure number
(`N m` is not `N m/rad`), nor is a cycle (`1 Hz` is not `1 1/s` or `1 rad/s`). Energy is no torque.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from types import MappingProxyType

LONGEST = 60
"""Maximum number of characters of a unit."""
DEEPEST = 3
"""Maximum depth of nested parentheses."""
LARGEST_POWER = 6
SMALLEST = Fraction(1, 10**40)
"""Smallest unit in SI units; the largest is its reciprocal."""

PI = Fraction("3.1415926535897932384626433832795028841971693993751")
"""To 50 digits, so that a product with it is exact to the last bit of a double."""


@dataclass(frozen=True)
class Unit:
    """A unit as a multiple of a product of base units.

    Attributes:
        factor: its value in SI units.
        dimensions: base unit and its power, sorted, none zero: (("kg", 1), ("m", 2)).
    """

    factor: Fraction
    dimensions: tuple[tuple[str, int], ...] = ()

    def __mul__(self, other: Unit) -> Unit:
        powers = dict(self.dimensions)
        for base, power in other.dimensions:
            powers[base] = powers.get(base, 0) + power
        return Unit(_bounded(self.factor * other.factor), _sorted(powers))

    def __pow__(self, power: int) -> Unit:
        powers = {base: own * power for base, own in self.dimensions}
        return Unit(_bounded(self.factor**power), _sorted(powers))


def _bounded(factor: Fraction) -> Fraction:
    """`factor`; raises ValueError for extreme values, also to stop the growth of nested powers."""
    if not SMALLEST < factor < 1 / SMALLEST:
        raise ValueError("it is out of any scale")
    return factor


def _sorted(powers: Mapping[str, int]) -> tuple[tuple[str, int], ...]:
    return tuple(sorted((base, power) for base, power in powers.items() if power))


ONE = Unit(Fraction(1))

PREFIXES = MappingProxyType(
    {
        "n": Fraction(1, 10**9),
        "u": Fraction(1, 10**6),
        "m": Fraction(1, 1000),
        "c": Fraction(1, 100),
        "k": Fraction(1000),
        "M": Fraction(10**6),
        "G": Fraction(10**9),
    }
)

POUND = Fraction("0.45359237")  # kg, international yard and pound agreement of 1959
GRAVITY = Fraction("9.80665")  # m/s^2, standard; for pound-force and kilogram-force

# Name: value in SI, base units, prefixes in data sheets, other spellings.
_TABLE: tuple[tuple[str, Fraction | int, Mapping[str, int], str, tuple[str, ...]], ...] = (
    ("rad", 1, {"rad": 1}, "mun", ("radian", "radians")),
    ("deg", PI / 180, {"rad": 1}, "m", ("°", "degree", "degrees")),
    ("arcmin", PI / 10800, {"rad": 1}, "", ("'", "′")),
    ("arcsec", PI / 648000, {"rad": 1}, "m", ('"', "″")),
    ("rev", 2 * PI, {"rad": 1}, "k", ("r", "revolution", "revolutions", "turn")),
    ("rpm", PI / 30, {"rad": 1, "s": -1}, "k", ()),
    ("s", 1, {"s": 1}, "mun", ("sec", "second", "seconds")),
    ("min", 60, {"s": 1}, "", ("minute", "minutes")),
    ("hour", 3600, {"s": 1}, "", ("h", "hours")),
    ("Hz", 1, {"cycle": 1, "s": -1}, "umkMG", ("hertz",)),
    ("m", 1, {"m": 1}, "numck", ("meter", "meters", "metre", "metres")),
    ("in", Fraction("0.0254"), {"m": 1}, "", ("inch",)),
    ("ft", Fraction("0.3048"), {"m": 1}, "", ("foot", "feet")),
    ("g", Fraction(1, 1000), {"kg": 1}, "umk", ("gram", "grams")),
    ("ozm", POUND / 16, {"kg": 1}, "", ()),
    ("lbm", POUND, {"kg": 1}, "", ()),
    ("N", 1, {"kg": 1, "m": 1, "s": -2}, "umckM", ("newton", "newtons")),
    ("kgf", GRAVITY, {"kg": 1, "m": 1, "s": -2}, "", ("kp",)),
    ("gf", GRAVITY / 1000, {"kg": 1, "m": 1, "s": -2}, "", ()),
    ("ozf", POUND / 16 * GRAVITY, {"kg": 1, "m": 1, "s": -2}, "", ()),
    ("lbf", POUND * GRAVITY, {"kg": 1, "m": 1, "s": -2}, "", ()),
    ("A", 1, {"A": 1}, "umk", ("ampere", "amperes", "amp", "amps")),
    ("V", 1, {"kg": 1, "m": 2, "s": -3, "A": -1}, "umk", ("volt", "volts")),
    ("ohm", 1, {"kg": 1, "m": 2, "s": -3, "A": -2}, "umkM", ("Ω", "Ohm", "ohms", "Ohms")),
    ("H", 1, {"kg": 1, "m": 2, "s": -2, "A": -2}, "num", ("henry",)),
    ("F", 1, {"kg": -1, "m": -2, "s": 4, "A": 2}, "num", ("farad",)),
    ("Pa", 1, {"kg": 1, "m": -1, "s": -2}, "kMG", ("pascal",)),
    ("J", 1, {"J": 1}, "umkM", ("joule", "joules")),
    ("W", 1, {"J": 1, "s": -1}, "umkM", ("watt", "watts")),
    ("K", 1, {"K": 1}, "m", ("kelvin",)),
    ("degC", 1, {"degC": 1}, "", ("°C",)),  # a temperature; no factor converts it to K
    ("dB", 1, {"dB": 1}, "", ()),  # a level; no factor converts it to a ratio
    ("count", 1, {"count": 1}, "", ("counts",)),
    ("percent", Fraction(1, 100), {}, "", ("%",)),
    ("ppm", Fraction(1, 10**6), {}, "", ()),
)

# Joined names in data sheets; a power applies to the last unit, as in `kgm²`.
_JOINED = MappingProxyType(
    {
        **{f"{p}Nm": (f"{p}N", "m") for p in ("", "u", "m", "c", "k", "M")},
        **{f"{p}Nms": (f"{p}N", "m", "s") for p in ("", "u", "m")},
        "Ncm": ("N", "cm"),
        "Nmm": ("N", "mm"),
        "kgm": ("kg", "m"),
        "kgcm": ("kg", "cm"),
        "gcm": ("g", "cm"),
        "Vs": ("V", "s"),
        "mVs": ("mV", "s"),
    }
)

_RMS = "an rms value; say its peak (for a sine, rms times 1.4142) in {}"
_FORCE = "a force or a mass; write {0}f for the force, {0}m for the mass, or {0}-in for the torque"
_REASONS = MappingProxyType(
    {
        **dict.fromkeys(("Arms", "A_rms", "Aeff"), _RMS.format("A")),
        **dict.fromkeys(("Vrms", "V_rms", "Veff"), _RMS.format("V")),
        "oz": _FORCE.format("oz"),
        "lb": _FORCE.format("lb"),
        "lbs": _FORCE.format("lb"),
        "mil": "a length or an angle; write in, mrad or deg",
        "R": "a resistance or a revolution; write ohm or rev",
        "cps": "cycles or counts per second; write Hz or count/s",
    }
)

_CHARACTERS = str.maketrans(
    {"\u00b5": "u", "\u03bc": "u", "\u2126": "Ω", "·": "*", "⋅": "*", ".": "*"}
)
"""Micro sign and Greek mu, ohm sign (not Omega), and product signs."""
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_TOKEN = re.compile(
    r"""\s*(?:
        (?P<name>[A-Za-zΩ°%]+(?:[-_][A-Za-zΩ°]+)*|['"′″])
      | (?P<power>(?:\^|\*\*)\s*[-+]?[0-9]+|[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)
      | (?P<bare>-?[0-9]+)
      | (?P<sign>[*/()])
    )""",
    re.X,
)


@cache
def names() -> Mapping[str, Unit]:
    """Units by name, including prefixes."""
    units: dict[str, Unit] = {}
    for name, factor, bases, prefixes, others in _TABLE:
        unit = Unit(Fraction(factor), _sorted(bases))
        units |= dict.fromkeys((name, *others), unit)
        for prefix in prefixes:
            scaled = Unit(PREFIXES[prefix] * unit.factor, unit.dimensions)
            symbols = (name, *(other for other in others if other in ("Ω", "Ohm", "r")))
            units |= {prefix + symbol: scaled for symbol in symbols}
    return MappingProxyType(units)


def listed() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Each unit of the table: name, allowed prefixes, other spellings."""
    for name, _, _, prefixes, others in _TABLE:
        yield name, prefixes, others


def parse_unit(text: str) -> Unit:
    """Parse the unit `text`. Raises ValueError that names the invalid part.

    An empty text is the unit of pure numbers.
    """
    if len(text) > LONGEST:
        raise ValueError(f"a unit has at most {LONGEST} characters")
    return _parse(text)


@lru_cache(maxsize=1024)
def _parse(text: str) -> Unit:
    tokens = _tokens(text)
    if not tokens:
        return ONE
    unit, end = _product(tokens, 0, 0)
    if end != len(tokens):
        raise ValueError("a ')' too many")
    return unit


def _tokens(text: str) -> list[tuple[str, str]]:
    text = text.strip().translate(_CHARACTERS)
    tokens: list[tuple[str, str]] = []
    place = 0
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            raise ValueError(f"{text[place:].lstrip()[:1]!r} stands in no unit")
        kind = str(match.lastgroup)
        if kind == "bare":
            kind = _bare(match, text, tokens)
        tokens.append((kind, match[match.lastgroup or 0]))
        place = match.end()
    return tokens


def _bare(match: re.Match[str], text: str, tokens: list[tuple[str, str]]) -> str:
    """Kind of a bare number: a power directly after a name (`cm2`), or the 1 of `1/s`."""
    joined = match.start() == match.start("bare")
    if joined and tokens and (tokens[-1][0] == "name" or tokens[-1][1] == ")"):
        return "power"
    if match["bare"] == "1" and text[match.end() :].lstrip().startswith("/"):
        return "one"
    raise ValueError(f"a unit has no number in it but powers; {match['bare']!r} is none")


def _product(tokens: list[tuple[str, str]], place: int, depth: int) -> tuple[Unit, int]:
    """The product from index `place`, and the index of its end: end of tokens, or a `)`."""
    result, place = _factor(tokens, place, depth)
    while place < len(tokens) and tokens[place][1] != ")":
        divided = tokens[place][1] == "/"
        if divided or tokens[place][1] == "*":
            place += 1
        unit, place = _factor(tokens, place, depth)
        result *= unit**-1 if divided else unit
    return result, place


def _factor(tokens: list[tuple[str, str]], place: int, depth: int) -> tuple[Unit, int]:
    if place >= len(tokens):
        raise ValueError("a name is missing at its end")
    kind, text = tokens[place]
    place += 1
    before = ONE
    if kind == "one":
        unit = ONE
    elif kind == "name":
        before, unit = _named(text)
    elif text == "(":
        if depth >= DEEPEST:
            raise ValueError(f"parentheses are more than {DEEPEST} deep")
        unit, place = _product(tokens, place, depth + 1)
        if place >= len(tokens):
            raise ValueError("a ')' is missing")
        place += 1
    else:
        raise ValueError(f"a name is missing before {text!r}")
    if place < len(tokens) and tokens[place][0] == "power":
        unit **= _power(tokens[place][1])
        place += 1
    return before * unit, place


def _power(text: str) -> int:
    digits = text.translate(_SUPERSCRIPTS).lstrip("^* \t\n\r\f\v")
    if len(digits) > 3 or not 0 < abs(int(digits)) <= LARGEST_POWER:
        raise ValueError(f"powers are from 1 to {LARGEST_POWER}, or the negative of that")
    return int(digits)


def _named(name: str) -> tuple[Unit, Unit]:
    """Product of all units before the last one of a joined name, and the last unit."""
    known = names()
    if name in known:
        return ONE, known[name]
    if name in _JOINED:
        *first, last = (known[part] for part in _JOINED[name])
        before = ONE
        for unit in first:
            before *= unit
        return before, last
    if "-" in name:
        return _hyphened(name.split("-"))
    if name in _REASONS:
        raise ValueError(f"{name!r} may be {_REASONS[name]}")
    raise UnknownNameError(name, tuple(_near(name)))


def _hyphened(parts: list[str]) -> tuple[Unit, Unit]:
    """As `_named`. Next to a length, ounces and pounds are forces: `oz-in`, `ft-lb`."""
    before, last = ONE, ONE
    for place, part in enumerate(parts):
        beside = {*parts[max(place - 1, 0) : place], *parts[place + 1 : place + 2]}
        force = part in ("oz", "lb", "lbs") and beside & {"in", "ft"}
        joined, unit = _named(f"{part[:2]}f" if force else part)
        before, last = before * last * joined, unit
    return before, last


class UnknownNameError(ValueError):
    """Unknown unit name; `near`: units with a similar spelling."""

    def __init__(self, name: str, near: tuple[str, ...]) -> None:
        super().__init__(f"there is no {name!r}")
        self.name = name
        self.near = near


_PREFIX_SLIPS = ("Kk", "Uu", "Cc", "gG")
"""Prefix with another case that denotes no other magnitude."""


def _near(name: str) -> Iterator[str]:
    """Units that differ from `name` only in case, but not in the case of a significant prefix.

    `NM` is not `nm`, and `MA` is not `mA`.
    """
    for other in (*names(), *_JOINED):
        parts = _JOINED.get(other, (other,))
        if other.casefold() == name.casefold() and len("".join(parts)) == len(name):
            place, same = 0, True
            for part in parts:
                slip = name[place] + part[0]
                same &= part not in _prefixed() or slip[0] == slip[1] or slip in _PREFIX_SLIPS
                place += len(part)
            if same:
                yield " ".join(parts)


@cache
def _prefixed() -> frozenset[str]:
    """Names that begin with a prefix."""
    spelled = {name for name, *_, others in _TABLE for name in (name, *others)}
    return frozenset(names().keys() - spelled)


def respelled(text: str, names_left: int = 4) -> Iterator[str]:
    """Valid units with the spelling of `text` except for the case of up to `names_left` names."""
    try:
        parse_unit(text)
    except UnknownNameError as error:
        name = re.compile(rf"(?<![A-Za-z_]){re.escape(error.name)}(?![A-Za-z_])")
        for near in error.near if names_left else ():
            yield from respelled(name.sub(near, text, count=1), names_left - 1)
    except ValueError:
        return
    else:
        yield text
