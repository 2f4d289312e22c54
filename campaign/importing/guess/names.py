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
"""Words by quantity; an earlier quantity outweighs a later one."""

_WORDS = {
    kind: frozenset(listed.split()) for kind, listed in (_QUANTITIES | _LISTED["changed"]).items()
}
_KNOWN = frozenset().union(*_WORDS.values())

_MOVING = _WORDS["rate"] | _WORDS["angle"] | _WORDS["current"]
"""Words of quantities that exist at the motor and at the load."""
_SHORT = frozenset("xyzml")
"""Axis or gear side at the end of a quantity: `velz`, `omegam`."""
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
"""Unit by its lower-case word at the end of a name."""
_LETTERS = {"N": "N", "A": "A", "a": "A", "s": "s", "m": "m", "C": "degC"}
"""Letters that may be a unit; but `q_m` is a measured q, `current_a` may be phase a."""
_OF_LETTERS = {"t": "torque", "m": "torque", "f": "torque", "v": "rate", "p": "angle", "s": "angle"}
"""Letters that are a quantity if words qualify them: `T_motor`, `v_soll`."""
_WHOLE = re.compile(r"m?Nm|mA|kN|deg[CK]|(?:m|u)?rad|[un]s|ms|rpm|RPM")
"""Units that must not be split at their capital letters."""
_PIECE = re.compile(r"[A-Z]{2,}(?=[xyz](?![a-zß-ÿ]))|[A-ZÀ-Þ]?[a-zß-ÿ]+|[A-ZÀ-Þ]+(?![a-zß-ÿ])|\d+")
_SYMBOLS = str.maketrans({"θ": "theta", "ω": "omega", "τ": "tau", "φ": "phi", "μ": "mu"})
_STARRED = re.compile(r"(?<=[^\W_])\*(?=$|[\s_.:/\[(])")
"""The mark of a target in drive software: `iq*`."""
_UNIT_BEHIND = re.compile(
    r"(?P<name>.*?)\s*(?:[\[(<](?P<unit>[^\[\]()<>]*)[\])>]|\sin\s+(?P<of>\S+)"
    r"|(?<=[^/\s])\s*/\s*(?P<per>[^/\s]+))"
)
_FORCE = parse_unit("N").dimensions
_LOADED = _WORDS["load"] | _WORDS["neutral"]
_CHANGES = frozenset().union(*(_WORDS[k] for k in ("target", "motor", "load", "sensed", "neutral")))
"""Words that may follow a letter for it to be a quantity."""
BY_UNIT = "its unit, and nothing else"


def usable_unit(text: str) -> str:
    """A unit in the spelling of the program's grammar; "" if it is not a unit."""
    spelled = UNIT_WORDS.get(text.strip().lower(), text.strip())
    try:
        parse_unit(spelled)
    except ValueError:
        return ""
    return "rpm" if spelled == "1/min" else spelled


def kind_of_unit(unit: str) -> str:
    """The quantity of a unit; "" if the unit indicates none."""
    return _KINDS.get(parse_unit(unit).dimensions, "") if unit else ""


def named(name: str, stated: str = "", place: str = "", before: str = "") -> ColumnGuess:
    """The guess from a name without the prefix `before`; a stated unit resolves single letters."""
    text = unicodedata.normalize("NFKC", name.removeprefix(before)).strip(" \"'#%")
    behind = _UNIT_BEHIND.fullmatch(text)
    unit = usable_unit(next(filter(None, behind.groups()[1:]), "")) if behind else ""
    sure = len(unit) > 1 or not (behind and behind["per"])  # `x/s` may be a path
    pieces = _pieces(behind["name"] if behind and unit else text)
    if not unit:
        pieces, unit, sure = _unit_apart(pieces)
    words = _words(pieces)
    tag = tuple(w for w in words if (len(w) < 3 if w.isdigit() else w not in _KNOWN))
    letters = [word for word in words if not word.isdigit()]
    usable = usable_unit(stated)
    kind, why = _kind(letters, kind_of_unit(usable or unit))
    if re.fullmatch(r"T_?\d{1,2}", text) and not stated:
        kind, why = "warmth", "a T with a number"
    role, doubts, sided = _role(kind, letters, usable or unit)
    if stated and not usable:
        doubts += (f"{stated!r}, as the file has it, is no unit that is known here",)
    guess = ColumnGuess(name, place, role, why, doubts=doubts, tag=tag, sided=sided)
    if usable:
        return replace(guess, unit=usable, basis=Basis.STATED, unit_why="the file states it")
    if not unit or kind_of_unit(unit) != kind:
        return guess
    basis = Basis.STATED if sure else Basis.LIKELY
    return replace(guess, unit=unit, basis=basis, unit_why="its name ends with it")


def common_path(names: Sequence[str]) -> str:
    """The uninformative common prefix of all names, such as a group of a file: `run1.`."""
    path = re.split(r"[^./]*$", names[0])[0] if len(names) > 1 else ""
    common = all(name.startswith(path) for name in names)
    return path if common and _KNOWN.isdisjoint(_words(_pieces(path))) else ""


def _pieces(text: str) -> list[str]:
    """The parts of a name, in the case of the file."""
    chunks = re.findall(r"[0-9A-Za-zÀ-ÿ]+", _STARRED.sub("_target", text).translate(_SYMBOLS))
    split = [[each] if _WHOLE.fullmatch(each) else _PIECE.findall(each) for each in chunks]
    return [piece for each in split for piece in each]


def _words(pieces: Sequence[str]) -> list[str]:
    """The words of pieces: compounds are split, separated symbols such as `i_q` are joined."""
    result: list[str] = []
    for piece in pieces:
        words = _taken_apart(piece.lower())
        last, word = "".join(result[-1:]), words[0]
        if len(words) > 1:
            result += words
        elif (
            last
            and last + word in _KNOWN
            and (min(len(last), len(word)) == 1 or len(last + word) > 5)
        ):
            result[-1] = last + word
        else:
            # After a motion quantity, `mx` is motor and axis; elsewhere it is a moment.
            result += word if last in _MOVING and word in ("mx", "my", "mz") else words
    return result


@cache
def _taken_apart(word: str) -> tuple[str, ...]:
    """The known words of a compound (`motorstrom`, `iqref`); else the word itself.

    Target marks come first, so that a target is never taken for a measurement.
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
    """Known words of at least three letters that cover the whole word, longest first; or none."""
    for end in range(len(word), 2, -1):
        # German joins words with s or n.
        for rest in (word[end:], word[end:].removeprefix("s"), word[end:].removeprefix("n")):
            if word[:end] in _KNOWN and (not rest or _cover(rest)):
                return (word[:end], *_cover(rest))
    return ()


def _unit_apart(pieces: list[str]) -> tuple[list[str], str, bool]:
    """Pieces without the unit at the end, that unit, and whether it is unambiguous.

    Numbers and words like `raw` may follow the unit.
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
    """The quantity of words, and the words it depends on; a unit outweighs a single letter."""
    matches = (
        (len(word) < 2, place, word)
        for place, kind in enumerate(_QUANTITIES)
        for word in said
        if word in _WORDS[kind]
    )
    letter, place, why = min(matches, default=(True, 0, ""))
    kind = [*_QUANTITIES][place]
    phrase = " ".join(said)
    if not letter:
        return kind, why
    if kind in (UNKNOWN, TIME) and not _WORDS["place"].isdisjoint(said):
        return "warmth", phrase
    if said and said[0] in _OF_LETTERS and said[1:] and _CHANGES.issuperset(said[1:]):
        return _OF_LETTERS[said[0]], phrase
    if by_unit and by_unit != kind and why != "u":
        if by_unit not in ("angle", TIME, "current") or all(
            len(w) < 3 or w in _KNOWN for w in said
        ):
            return by_unit, f"{phrase}, in its unit" if phrase else BY_UNIT
        return UNKNOWN, ""  # some length, duration or current
    marks = [w for w in said if w in _WORDS["target"] and len(w) > 1 and w != "set"]
    if not why and marks:
        return "target", marks[0]
    if not why and {"normal", "load"} <= set(said):
        return "torque", phrase
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
"""Rows of quantity, qualifier and channel; the first match applies, "" matches any."""
_OF_A_SIDE = {row[-1] for row in _CHANNELS[-6:]} | {channels.DRIVE_TORQUE}

_TURNS = frozenset(("rpm", "drehzahl"))
"""Words of a rate in turns: it is likely the motor's, without further evidence."""


def _role(kind: str, said: Sequence[str], unit: str) -> tuple[str, tuple[str, ...], bool]:
    """The channel of the vocabulary, doubts to check, and whether the gear side is known."""
    if kind in (TIME, INDEX, UNKNOWN):
        return kind, (), True
    said = said[kind == "rate" and said[:1] == ["d"] :]  # a leading d is a derivative, no target
    changes = {change for change, words in _WORDS.items() if not words.isdisjoint(said)} | {""}
    sided = not changes.isdisjoint(("motor", "load"))
    if unit == "rpm" or not _TURNS.isdisjoint(said):
        changes.add("motor")
    if unit and parse_unit(unit).dimensions == _FORCE and _LOADED.issuperset(said):
        changes.add("normal")  # `Nominal load [N]`
    role = next(r[2] for r in _CHANNELS if r[0] in ("", kind) and r[1] in changes)
    doubts = ("an estimate, and not what a sensor showed",) if "estimate" in changes else ()
    return role, doubts, sided or role not in _OF_A_SIDE
