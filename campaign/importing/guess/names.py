"""What a column's name says: its role in the vocabulary of channels, and a unit at its end.

Names are taken apart into words. A word may say the quantity, that it is a target, which side of
the gear it is of, or that it is no channel at all; the last outweighs the others.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.importing.guess.pieces import Ending, Pieces, pieces
from campaign.importing.guess.quantities import (
    FORCES,
    INDEX,
    TIME,
    UNKNOWN,
    has,
    is_load,
    kind_of,
    kind_of_unit,
)
from campaign.importing.guess.roles import role_of
from campaign.importing.guess.words import CHANGES, KNOWN, WORDS

_THERMOMETER = re.compile(r"T_?\d{1,2}")
_MOTOR_TORQUE = re.compile(r"T_?[mM]")
_JOINT = frozenset(("joint", "j", "jnt", "axis", "achse", "axe"))
"""Words that say of which axis a column is, and nothing else."""
_ALSO_A_PLACE = frozenset(
    ["set", "tar", "traj", "trajectory", "profile", "action", "limited", "required"]
)
_BELONGS = CHANGES["hull"] | {
    *(word for word in CHANGES["target"] - _ALSO_A_PLACE if len(word) > 2),
    *("motor", "imu", "gyro"),
}
"""What a part of a path adds to its last one; `set 1/position` is rather one of several."""
_NOWHERE = frozenset(
    ["xyz", "tcp", "pose", "wrench", "twist", "orientation", "quaternion", "cartesian"]
)
"""Parts of a path whose channels are of no axis."""

_KNOWN = {
    # CANopen drive profile; Siemens drives; the public set of a positioning system.
    "0x6062": REFERENCE,
    "0x6063": RELATIVE_ANGLE,
    "0x6064": RELATIVE_ANGLE,
    "0x606b": COMMAND,
    "0x606c": RELATIVE_RATE,
    "0x6074": COMMAND,
    "0x6077": DRIVE_TORQUE,
    "0x6078": MOTOR_CURRENT,
    "0x607a": REFERENCE,
    "0x60ff": COMMAND,
    "0x6071": COMMAND,
    "r0060": COMMAND,
    "r0062": COMMAND,
    "r0077": COMMAND,
    "r0079": COMMAND,
    "r0080": DRIVE_TORQUE,
    "r0031": DRIVE_TORQUE,
    "r0061": MOTOR_RATE,
    "r0063": MOTOR_RATE,
    "r0068": MOTOR_CURRENT,
    "r0078": MOTOR_CURRENT,
    "r0482": RELATIVE_ANGLE,
    "qm": RELATIVE_ANGLE,
    "qg": REFERENCE,
    "vir": DRIVE_TORQUE,
    "x-axis": TIME,
}
"""Names that are what they are by a convention of their own."""
_OBJECT = re.compile(r"\b(0x60[0-9a-f]{2}|r\d{4})(?![0-9a-z])")


OF_ANYTHING = "of what it is the target its name does not say"


@dataclass(frozen=True)
class Named:
    """What a name says.

    Attributes:
        role: of the vocabulary, or `time`, `index`, `unknown`.
        why: which word says so; "" where none does.
        unit: at the end of the name; "" where there is none.
        sure: whether that unit can be nothing else.
        tag: words and numbers that say neither; of several axes they are the name.
        side: whether the name says on which side of the gear it was measured.
        spare: it gives way to another column of its role: raw counts, a filtered copy.
        doubt: what a reader should know besides; "" for nothing.
    """

    role: str
    why: str = ""
    unit: str = ""
    sure: bool = False
    tag: tuple[str, ...] = ()
    side: bool = False
    spare: bool = False
    doubt: str = ""


def named(name: str, unit: str = "") -> Named:
    """What a name says; `unit`, as its file states it, tells names apart that are one letter."""
    plain = unicodedata.normalize("NFKC", name).strip(" \"'").lower()
    found = pieces(name)
    tag = _tag(found)
    convention = _OBJECT.search(plain)
    known = convention[1] if convention else plain
    if known in _KNOWN:
        ending = found.ending
        return Named(_KNOWN[known], f"{known} is so by convention", ending.unit, ending.sure, tag)
    said = _said(found)
    if not said and not found.ending.unit:
        return Named(UNKNOWN, tag=tag)
    in_path = [word for part in found.parts[:-1] for word in part]
    if nowhere := next((word for word in (*in_path, *said) if word in _NOWHERE), ""):
        return Named(UNKNOWN, nowhere, tag=tag)
    kind, why, ending, said = _kind_and_unit(said, found, unit)
    doubt = ""
    if _MOTOR_TORQUE.fullmatch(name.strip()) and kind == TIME:
        kind, why = "torque", "a T of the motor"
    elif _THERMOMETER.fullmatch(name.strip()) and not unit:
        kind, why = "warmth", "a T with a number"
    elif kind == UNKNOWN and not why and not unit and tag and _JOINT.issuperset(said):
        kind, why, doubt = "angle", " ".join(said), "its name says which joint, and not what of it"
    elif kind == "rate" and "angular" in said and found.parts[-1] in (("x",), ("y",), ("z",)):
        said = ["gyro", *said]
    # `cmd.tau`, `motor.speed`: what a part belongs to changes its meaning, and never gives it one.
    said = [*(word for word in in_path if word in _BELONGS), *said]
    fitting = ending if kind_of_unit(ending.unit) == kind else Ending()
    if kind in (TIME, INDEX, UNKNOWN):
        return Named(kind, why, fitting.unit, fitting.sure, tag)
    role, side = role_of(kind, said, found.ending.unit or unit)
    if role == UNKNOWN:
        return Named(role, why, tag=tag)
    spare = not {"raw", "filt", "filtered", "filter", "lpf", "smooth", "smoothed"}.isdisjoint(said)
    if has(said, "estimate"):
        doubt = "an estimate of the drive or of an observer, not what a sensor showed"
    elif kind == "target":
        doubt = OF_ANYTHING
    return Named(role, why, fitting.unit, fitting.sure, tag, side, spare, doubt)


def _tag(found: Pieces) -> tuple[str, ...]:
    """What tells axes apart: short numbers, and words that mean nothing here."""
    all_words = [word for part in found.parts for word in part]
    return tuple(
        word
        for word in all_words
        if (len(word) <= 2 if word.isdigit() else word not in KNOWN) and word not in FORCES
    )


def _said(found: Pieces) -> list[str]:
    """The words of the last part that says more than `data` or `x`; numbers are no words."""
    for part in reversed(found.parts):
        words = [word for word in part if not word.isdigit()]
        if any(word not in CHANGES["neutral"] and word not in ("x", "y", "z") for word in words):
            return _derived(words)
    return [word for word in (found.parts[-1] if found.parts else ()) if not word.isdigit()]


def _derived(words: list[str]) -> list[str]:
    """`d theta` is a rate, as `theta dot` is, and `q dot dot` an acceleration."""
    angles = WORDS["angle"] | {"x", "y", "s", "alpha"}
    if len(words) > 1 and words[0] in ("d", "dd") and words[1] in angles:
        return ["omega" if words[0] == "d" else "acceleration", *words[2:]]
    if "dot" in words:
        rest = [word for word in words if word != "dot"]
        return [*rest, "acceleration" if words.count("dot") > 1 else "dot"]
    # `current_position`: the present one.
    if words and words[0] in ("current", "curr", "cur", "present") and len(words) > 1:
        moving = WORDS["angle"] | WORDS["rate"] | WORDS["torque"] | WORDS["warmth"] | WORDS["time"]
        if any(len(word) > 2 and word in moving for word in words[1:]):
            return words[1:]
    return words


def _kind_and_unit(
    said: list[str], found: Pieces, stated: str
) -> tuple[str, str, Ending, list[str]]:
    """The quantity, what says so, the unit at the end where it is one, and the words without it.

    A letter at the end may be a word (`F_n` is a normal force): it is a unit where the rest says a
    quantity that has it.
    """
    ending = found.ending
    if ending.squared:
        return UNKNOWN, "an acceleration", Ending(), said
    kind, why = kind_of(said)
    by_unit = kind_of_unit(stated or ending.unit)
    letter = ending.unit and not ending.sure and not ending.clear
    if letter and not stated and kind not in (by_unit, "target", "normal"):
        whole = [word for word in found.whole if not word.isdigit()]
        whole = _derived(whole)
        of_whole, its_why = kind_of(whole)
        if of_whole != UNKNOWN or kind != UNKNOWN:
            return of_whole, its_why, Ending(), whole
    if kind == UNKNOWN and not why and is_load(said, stated or ending.unit):
        return "normal", "a load in N", ending, said
    if by_unit and kind == TIME and by_unit != TIME:
        # A `T` in degrees, or in N m: the unit says more.
        return by_unit, f"its unit {stated or ending.unit}, and nothing else", ending, said
    if by_unit and kind in (UNKNOWN, "target") and (not why or kind == "target"):
        strange = [w for w in said if len(w) > 2 and w not in KNOWN]
        if by_unit in ("angle", TIME, "current") and strange and kind != "target":
            return UNKNOWN, "", ending, said  # some length, duration or current
        if said == ["z"]:
            return UNKNOWN, "", ending, said
        told = f"its unit {stated or ending.unit}, and nothing else"
        return by_unit, f"{why}, in {stated or ending.unit}" if why else told, ending, said
    return kind, why, ending, said
