"""Role and unit from a column's name."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from campaign import channels
from campaign.importing.cells import UNIT_WORDS
from campaign.importing.guess.columns import INDEX, TIME, UNKNOWN, Basis, ColumnGuess
from campaign.unit_grammar import parse_unit

_LISTED = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
_QUANTITIES = _LISTED["quantities"]
"""An earlier quantity outweighs a later one."""

_WORDS = {
    kind: frozenset(listed.split()) for kind, listed in (_QUANTITIES | _LISTED["changed"]).items()
}
_KNOWN = frozenset().union(*_WORDS.values())

_MOVING = _WORDS["rate"] | _WORDS["angle"] | _WORDS["current"]
"""Words of what a motor and its load have each of their own."""
_SHORT = frozenset("xyzml")
"""An axis, or a side of the gear, behind a quantity: `velz`, `omegam`."""
_MARKS = sorted((word for word in _WORDS["target"] if len(word) > 2), key=len, reverse=True)
_KINDS = {
    parse_unit(unit).dimensions: kind
    for unit, kind in (
        *(("rad", "angle"), ("m", "angle"), ("count", "angle")),
        *(("rad/s", "rate"), ("m/s", "rate"), ("count/s", "rate")),
        *(("N m", "torque"), ("N", "torque"), ("A", "current"), ("degC", "warmth"), ("s", TIME)),
    )
}
_SPELLED = {word: unit for unit, listed in _LISTED["units"].items() for word in listed.split()}
"""Words at the end of a name that are a unit, in lower case."""
_LETTERS = {"N": "N", "A": "A", "a": "A", "s": "s", "m": "m", "C": "degC"}
"""Letters that may be a unit; `q_m` is measured, and `current_a` of phase a as well."""
_OF_LETTERS = {"t": "torque", "m": "torque", "f": "torque", "v": "rate", "p": "angle", "s": "angle"}
"""Letters that are a quantity where a word says of what: `T_motor`, `v_soll`."""
_WHOLE = re.compile(r"m?Nm|mA|kN|deg[CK]|(?:m|u)?rad|[un]s|ms|rpm|RPM")
"""What would fall apart at its capital letters."""
_PIECE = re.compile(r"[A-Z]{2,}(?=[xyz](?![a-zß-ÿ]))|[A-ZÀ-Þ]?[a-zß-ÿ]+|[A-ZÀ-Þ]+(?![a-zß-ÿ])|\d+")
_SYMBOLS = str.maketrans({"θ": "theta", "ω": "omega", "τ": "tau", "φ": "phi", "μ": "mu"})
_STARRED = re.compile(r"(?<=[^\W_])\*(?=$|[\s_.:/\[(])")
"""Drives mark targets so: `iq*`."""
_UNIT_BEHIND = re.compile(
    r"(?P<name>.*?)\s*(?:[\[(<](?P<unit>[^\[\]()<>]*)[\])>]|\sin\s+(?P<of>\S+)"
    r"|(?<=[^/\s])\s*/\s*(?P<per>[^/\s]+))"
)
_FORCE = parse_unit("N").dimensions
_LOADED = _WORDS["load"] | _WORDS["neutral"]
_CHANGES = frozenset().union(*(_WORDS[k] for k in ("target", "motor", "load", "sensed", "neutral")))
"""What a word behind a letter may say for the letter to be a quantity."""
BY_UNIT = "its unit, and nothing else"


def usable_unit(text: str) -> str:
    """A unit in the spelling of the program's grammar; "" where it is none."""
    spelled = UNIT_WORDS.get(text.strip().lower(), text.strip())
    try:
        parse_unit(spelled)
    except ValueError:
        return ""
    return "rpm" if spelled == "1/min" else spelled


def kind_of_unit(unit: str) -> str:
    """The quantity that a unit is of; "" for those that say nothing here."""
    return _KINDS.get(parse_unit(unit).dimensions, "") if unit else ""


def named(name: str, stated: str = "", place: str = "", before: str = "") -> ColumnGuess:
    """What a name says behind `before`; a unit that the file states tells single letters apart."""
    text = unicodedata.normalize("NFKC", name.removeprefix(before)).strip(" \"'#%")
    behind = _UNIT_BEHIND.fullmatch(text)
    unit = usable_unit(next(filter(None, behind.groups()[1:]), "")) if behind else ""
    sure = len(unit) > 1 or not (behind and behind["per"])  # `x/s` may be a path
    pieces = _pieces(behind["name"] if behind and unit else text)
    if not unit:
        pieces, unit, sure = _unit_apart(pieces)
    words = _words(pieces)
    tag = tuple(w for w in words if (len(w) < 3 if w.isdigit() else w not in _KNOWN))
    said = [word for word in words if not word.isdigit()]
    usable = usable_unit(stated)
    kind, why = _kind(said, kind_of_unit(usable or unit))
    if re.fullmatch(r"T_?\d{1,2}", text) and not stated:
        kind, why = "warmth", "a T with a number"
    role, doubts, sided = _role(kind, said, usable or unit)
    if stated and not usable:
        doubts += (f"{stated!r}, as the file has it, is no unit that is known here",)
    found = ColumnGuess(name, place, role, why, doubts=doubts, tag=tag, sided=sided)
    if usable:
        return replace(found, unit=usable, basis=Basis.STATED, unit_why="the file states it")
    if not unit or kind_of_unit(unit) != kind:
        return found
    basis = Basis.STATED if sure else Basis.LIKELY
    return replace(found, unit=unit, basis=basis, unit_why="its name ends with it")


def common_path(names: Sequence[str]) -> str:
    """What stands before all names and says nothing, as a group of a file does: `run1.`."""
    path = re.split(r"[^./]*$", names[0])[0] if len(names) > 1 else ""
    common = all(name.startswith(path) for name in names)
    return path if common and _KNOWN.isdisjoint(_words(_pieces(path))) else ""


def _pieces(text: str) -> list[str]:
    """Of a name, in the letters of the file."""
    chunks = re.findall(r"[0-9A-Za-zÀ-ÿ]+", _STARRED.sub("_target", text).translate(_SYMBOLS))
    apart = [[each] if _WHOLE.fullmatch(each) else _PIECE.findall(each) for each in chunks]
    return [piece for each in apart for piece in each]


def _words(pieces: Sequence[str]) -> list[str]:
    """The words of pieces: compounds as several, and as one what is written apart: `i_q`."""
    found: list[str] = []
    for piece in pieces:
        words = _taken_apart(piece.lower())
        last, word = "".join(found[-1:]), words[0]
        if len(words) > 1:
            found += words
        elif (
            last
            and last + word in _KNOWN
            and (min(len(last), len(word)) == 1 or len(last + word) > 5)
        ):
            found[-1] = last + word
        else:
            # Behind what moves the motor's, along an axis; elsewhere `mx` is a moment.
            found += word if last in _MOVING and word in ("mx", "my", "mz") else words
    return found


@cache
def _taken_apart(word: str) -> tuple[str, ...]:
    """A compound as the known words that make it up (`motorstrom`, `iqref`); else as it is.

    A target must not pass for a measurement: its mark is looked for first.
    """
    if word in _KNOWN or len(word) < 2:
        return (word,)
    for mark in _MARKS:
        for rest in (word.removesuffix(mark), word.removeprefix(mark)):
            if rest in _MOVING | _WORDS["torque"] | _SHORT:
                return rest, mark
    if word[-1] in _SHORT and (before := _taken_apart(word[:-1]))[-1] in _KNOWN:
        return (*before, word[-1])
    return _cover(word) or (word,)


def _cover(word: str) -> tuple[str, ...]:
    """Words of three letters and more that make up all of it, the longest first; or none."""
    for end in range(len(word), 2, -1):
        # German puts an s or n between words.
        for rest in (word[end:], word[end:].removeprefix("s"), word[end:].removeprefix("n")):
            if word[:end] in _KNOWN and (not rest or _cover(rest)):
                return (word[:end], *_cover(rest))
    return ()


def _unit_apart(pieces: list[str]) -> tuple[list[str], str, bool]:
    """Pieces without the unit at the end, that unit, and whether it can be nothing else.

    Numbers and words like `raw` may stand behind it.
    """
    end = len(pieces)
    while end > 1 and (pieces[end - 1].isdigit() or pieces[end - 1].lower() in _WORDS["neutral"]):
        end -= 1
    low = [piece.lower() for piece in pieces]
    for first in range(max(1, end - 3), end):
        tail = [_SPELLED.get(word, word) for word in low[first:end] if word != "per"]
        unit = usable_unit("/".join(tail)) or _SPELLED.get("".join(tail), "")
        if len(unit) > 1 and kind_of_unit(unit):
            if low[end : end + 1] == ["2"]:
                return [*pieces, "acceleration"], "", False
            return pieces[:first] + pieces[end:], unit.replace("·", " "), True
    *rest, letter = pieces or [""]
    unit = _LETTERS.get(letter, "")
    kind, why = _kind(_words(rest), "")
    if unit and kind_of_unit(unit) == kind and len(rest[-1]) >= (6 if unit == "m" else 3):
        return rest, unit, letter == "s"
    if letter == "N" and len(why) < 2 and not all(map(str.isupper, pieces)):
        return rest, unit, False  # `tether_N`
    return pieces, "", False


def _kind(said: Sequence[str], by_unit: str) -> tuple[str, str]:
    """The quantity that words say, and which of them do; a unit outweighs a single letter."""
    found = (
        (len(word) < 2, place, word)
        for place, kind in enumerate(_QUANTITIES)
        for word in said
        if word in _WORDS[kind]
    )
    letter, place, why = min(found, default=(True, 0, ""))
    kind = [*_QUANTITIES][place]
    told = " ".join(said)
    if not letter:
        return kind, why
    if kind in (UNKNOWN, TIME) and not _WORDS["place"].isdisjoint(said):
        return "warmth", told
    if said and said[0] in _OF_LETTERS and said[1:] and _CHANGES.issuperset(said[1:]):
        return _OF_LETTERS[said[0]], told
    if by_unit and by_unit != kind and why != "u":
        if by_unit not in ("angle", TIME, "current") or all(
            len(w) < 3 or w in _KNOWN for w in said
        ):
            return by_unit, f"{told}, in its unit" if told else BY_UNIT
        return UNKNOWN, ""  # some length, duration or current
    marks = [w for w in said if w in _WORDS["target"] and len(w) > 1 and w != "set"]
    if not why and marks:
        return "target", marks[0]
    if not why and {"normal", "load"} <= set(said):
        return "torque", told
    return kind, why


_CHANNELS = (
    ("warmth", "target", UNKNOWN),
    ("warmth", "", channels.TEMPERATURE),
    ("torque", "normal", channels.NORMAL_LOAD),
    ("angle", "target", channels.REFERENCE),
    ("", "target", channels.COMMAND),
    ("target", "", channels.COMMAND),
    ("current", "", channels.MOTOR_CURRENT),
    ("torque", "estimate", UNKNOWN),
    ("torque", "sensed", channels.JOINT_TORQUE),
    ("torque", "", channels.DRIVE_TORQUE),
    ("rate", "hull", channels.BASE_RATE),
    ("rate", "gyro", channels.GYRO_RATE),
    ("angle", "load", channels.RELATIVE_ANGLE),
    ("rate", "load", channels.RELATIVE_RATE),
    ("angle", "motor", channels.MOTOR_ANGLE),
    ("rate", "motor", channels.MOTOR_RATE),
    ("angle", "", channels.RELATIVE_ANGLE),
    ("rate", "", channels.RELATIVE_RATE),
)
"""The channel of a quantity of which a word says that; the first that fits."""
_OF_A_SIDE = {row[-1] for row in _CHANNELS[-6:]} | {channels.DRIVE_TORQUE}

_TURNS = frozenset(("rpm", "drehzahl"))
"""A rate in turns is likely the motor's, and that is all that says so."""


def _role(kind: str, said: Sequence[str], unit: str) -> tuple[str, tuple[str, ...], bool]:
    """The channel of the vocabulary, what to check, and whether a side of the gear is said."""
    if kind in (TIME, INDEX, UNKNOWN):
        return kind, (), True
    said = said[kind == "rate" and said[:1] == ["d"] :]  # in front it is a derivative, no target
    told = {change for change, words in _WORDS.items() if not words.isdisjoint(said)} | {""}
    sided = not told.isdisjoint(("motor", "load"))
    if unit == "rpm" or not _TURNS.isdisjoint(said):
        told.add("motor")
    if unit and parse_unit(unit).dimensions == _FORCE and _LOADED.issuperset(said):
        told.add("normal")  # `Nominal load [N]`
    role = next(r[2] for r in _CHANNELS if r[0] in ("", kind) and r[1] in told)
    doubts = ("an estimate, and not what a sensor showed",) if "estimate" in told else ()
    return role, doubts, sided or role not in _OF_A_SIDE
