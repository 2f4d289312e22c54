"""What a column's name says: its role in the vocabulary of channels, and a unit at its end.

Names are taken apart into words. A word may say the quantity, that it is a target, which side of
the gear it is of, or that it is no channel at all; the last outweighs the others.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from campaign.channels import (
    BASE_RATE,
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    JOINT_TORQUE,
    MOTOR_ANGLE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    NORMAL_LOAD,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    TEMPERATURE,
)
from campaign.importing.guess.stated import stated_unit
from campaign.importing.guess.words import CHANGES, WORDS, taken_apart
from campaign.unit_grammar import parse_unit

TIME, INDEX, UNKNOWN = "time", "index", "unknown"

_BELONGS = frozenset(
    ("cmd", "command", "target", "desired", "ref", "reference", "goal", "motor", "base", "hull")
)

_KNOWN = {
    # CANopen drive profile; Siemens drives; the public set of a positioning system.
    "0x6064": RELATIVE_ANGLE,
    "0x606c": RELATIVE_RATE,
    "0x6077": DRIVE_TORQUE,
    "0x6078": MOTOR_CURRENT,
    "0x607a": REFERENCE,
    "0x60ff": COMMAND,
    "0x6071": COMMAND,
    "r0080": DRIVE_TORQUE,
    "r0031": DRIVE_TORQUE,
    "r0061": MOTOR_RATE,
    "r0063": MOTOR_RATE,
    "r0068": MOTOR_CURRENT,
    "qm": RELATIVE_ANGLE,
    "qg": REFERENCE,
    "vir": DRIVE_TORQUE,
    "x-axis": TIME,
}
"""Names that are what they are by a convention of their own."""

SUFFIXES = {
    "deg": "deg",
    "rad": "rad",
    "mrad": "mrad",
    "rpm": "rpm",
    "nm": "N m",
    "mnm": "mN m",
    "mm": "mm",
    "degps": "deg/s",
    "dps": "deg/s",
    "radps": "rad/s",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "degc": "degC",
    "ma": "mA",
}
"""Words at the end of a name that are its unit; single letters are none: `q_m` is measured."""
_PER_SECOND = {"deg": "deg/s", "rad": "rad/s", "mrad": "mrad/s", "mm": "mm/s"}


@dataclass(frozen=True)
class Named:
    """What a name says.

    Attributes:
        role: of the vocabulary, or `time`, `index`, `unknown`.
        why: which word says so; "" where none does.
        unit: at the end of the name; "" where there is none.
        group: which of several axes it is of, as numbered in its name; "" where there is one.
        side: whether the name says on which side of the gear it was measured.
    """

    role: str
    why: str = ""
    unit: str = ""
    group: str = ""
    side: bool = False


def words(name: str) -> list[str]:
    """A name in pieces, lower case: `state.tau_J[0]` is state, tau, j, 0."""
    text = unicodedata.normalize("NFKC", name).replace("θ", "theta").replace("ω", "omega")
    text = text.replace("τ", "tau").replace("φ", "phi")
    text = re.sub(r"(?<=[a-zà-ÿ])(?=[A-Z])", " ", text)
    text = re.sub(r"(?<=[A-Za-zÀ-ÿ])(?=\d)|(?<=\d)(?=[A-Za-zÀ-ÿ])", " ", text)
    pieces = re.findall(r"[a-zà-ÿ]+|\d+", text.lower())
    return [part for piece in pieces for part in taken_apart(piece)]


def named(name: str, unit: str = "") -> Named:
    """What a name says; `unit`, as its file states it, tells names apart that are one letter."""
    plain = unicodedata.normalize("NFKC", name).strip(" \"'").lower()
    *path, last = [words(part) for part in re.split(r"[./]", name) if words(part)] or [[]]
    group = _group([piece for part in (*path, last) for piece in part])
    if plain in _KNOWN:
        return Named(_KNOWN[plain], f"{plain} is so by convention", "", group)
    said = [piece for piece in last if not piece.isdigit()]
    if not said:
        return Named(UNKNOWN, "", "", group)
    kind, why = _kind(said)
    by_unit = _kind_of_unit(unit)
    if by_unit and ((kind == UNKNOWN and not why) or (kind == TIME and by_unit != TIME)):
        # A name that says nothing, or a `T` in degrees: the unit says more.
        kind, why = by_unit, f"its unit {unit}, and nothing else"
    # `cmd.tau`, `motor.speed`: what a part belongs to changes its meaning, and never gives it one.
    said = [*(piece for part in path for piece in part if piece in _BELONGS), *said]
    suffix = _unit_at_end(said, kind)
    if kind in (TIME, INDEX, UNKNOWN):
        return Named(kind, why, suffix, group)
    role, side = _role(kind, said)
    return Named(role, why, suffix, group, side)


def _group(pieces: list[str]) -> str:
    """The number of the axis: the last that is one digit or two."""
    numbers = [piece for piece in pieces if piece.isdigit() and len(piece) <= 2]
    return numbers[-1] if numbers else ""


_DIMENSIONS = {
    parse_unit(unit).dimensions: kind
    for unit, kind in (
        ("rad", "angle"),
        ("m", "angle"),
        ("rad/s", "rate"),
        ("m/s", "rate"),
        ("N m", "torque"),
        ("N", "torque"),
        ("A", "current"),
        ("degC", "warmth"),
        ("s", TIME),
    )
}


def _kind_of_unit(unit: str) -> str:
    """The quantity that a stated unit is of; "" for those that say nothing here."""
    _, usable = stated_unit(unit)
    return _DIMENSIONS.get(parse_unit(usable).dimensions, "") if usable else ""


def _has(said: list[str], change: str) -> bool:
    return not CHANGES[change].isdisjoint(said)


def _kind(said: list[str]) -> tuple[str, str]:
    """The quantity that the words say, and the word that says it."""
    if said[0] in ("m", "t") and len(said) > 1:
        # One letter for torque or temperature: what stands beside it decides.
        if said[0] == "t" and _has(said, "place"):
            return "warmth", " ".join(said)
        sided = _has(said[1:], "motor") or _has(said[1:], "load")
        if (sided and said[1:] != ["m"]) or (said[0] == "m" and _has(said, "target")):
            return "torque", " ".join(said)
    if said[-1] == "dot" and not WORDS["angle"].isdisjoint(said):
        return "rate", " ".join(said)
    kinds = [k for k, listed in WORDS.items() if not listed.isdisjoint(said)]
    if "load" in said and not kinds:
        if _has(said, "normal"):
            return "normal", "normal load"
        return ("torque", "load cell") if _has(said, "sensor") else (UNKNOWN, "")
    if not kinds:
        return ("rate", "gyro") if _has(said, "gyro") else (UNKNOWN, "")
    kind = kinds[0]
    word = next(each for each in said if each in WORDS[kind])
    if kind == "neither" or kind in ("index", "time"):
        return {"neither": UNKNOWN, "index": INDEX, "time": TIME}[kind], word
    if kind == "current" and "phase" in said:
        return UNKNOWN, "phase current"
    return kind, word


def _role(kind: str, said: list[str]) -> tuple[str, bool]:
    """The channel, and whether the name says its side of the gear."""
    target, motor, load = (_has(said, each) for each in ("target", "motor", "load"))
    if kind in ("warmth", "normal"):
        return (TEMPERATURE if kind == "warmth" else NORMAL_LOAD), True
    if kind == "angle":
        if target:
            return REFERENCE, False
        return (MOTOR_ANGLE, True) if motor and not load else (RELATIVE_ANGLE, load)
    if target:
        return COMMAND, False
    if kind == "current":
        return MOTOR_CURRENT, True
    if kind == "rate":
        if _has(said, "gyro"):
            return GYRO_RATE, True
        if _has(said, "hull"):
            return BASE_RATE, True
        rotor = motor or "drehzahl" in said or "rpm" in said
        return (MOTOR_RATE, True) if rotor and not load else (RELATIVE_RATE, load)
    if _has(said, "normal") or "fn" in said:
        return NORMAL_LOAD, True
    sensed = (
        _has(said, "sensor") or not {"friction", "ft", "fr"}.isdisjoint(said) or "j" in said[1:]
    )
    return (JOINT_TORQUE, True) if sensed else (DRIVE_TORQUE, False)


def _unit_at_end(said: list[str], kind: str) -> str:
    """The unit that the last words are; only one that the quantity can have."""
    if len(said) < 2:
        return ""
    last = said[-1]
    per_second = said[-2] in _PER_SECOND and last in ("s", "sec") and len(said) > 2
    if per_second and kind == "rate":
        return _PER_SECOND[said[-2]]
    fits = {
        "time": ("ms", "us", "ns"),
        "angle": ("deg", "rad", "mrad", "mm"),
        "rate": ("rpm", "degps", "dps", "radps"),
        "torque": ("nm", "mnm"),
        "current": ("ma",),
        "warmth": ("degc",),
    }.get(kind, ())
    return SUFFIXES[last] if last in fits else ""
