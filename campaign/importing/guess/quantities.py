"""The quantity that the words of a name say, and that a unit is of."""

from __future__ import annotations

from campaign.channels import JOINT_TORQUE, NORMAL_LOAD
from campaign.importing.guess.stated import stated_unit
from campaign.importing.guess.words import CHANGES, WORDS
from campaign.unit_grammar import parse_unit

TIME, INDEX, UNKNOWN = "time", "index", "unknown"

FORCES = {
    **dict.fromkeys(("fz", "fn"), NORMAL_LOAD),
    **dict.fromkeys(("fx", "fy", "ft", "fr", "tz", "mz"), JOINT_TORQUE),
    **dict.fromkeys(("tx", "ty", "mx", "my"), UNKNOWN),
}
"""Components of a load cell, as tribometers and force sensors call them: z is normal."""
_PHASES = frozenset(["a", "b", "c", "u", "v", "w", "alpha", "beta", "ph", "phase"])


_DIMENSIONS = {
    parse_unit(unit).dimensions: kind
    for unit, kind in (
        ("rad", "angle"),
        ("m", "angle"),
        ("count", "angle"),
        ("rad/s", "rate"),
        ("m/s", "rate"),
        ("count/s", "rate"),
        ("N m", "torque"),
        ("N", "torque"),
        ("A", "current"),
        ("degC", "warmth"),
        ("s", TIME),
    )
}


def kind_of_unit(unit: str) -> str:
    """The quantity that a unit is of; "" for those that say nothing here."""
    _, usable = stated_unit(unit)
    return _DIMENSIONS.get(parse_unit(usable).dimensions, "") if usable else ""


def has(said: list[str], change: str) -> bool:
    """Whether one of the words says that, a key of `CHANGES`."""
    return not CHANGES[change].isdisjoint(said)


def is_load(said: list[str], unit: str) -> bool:
    """`Nominal load [N]`: what presses; a load in N m is a torque, one in % may be anything."""
    _, usable = stated_unit(unit)
    force = bool(usable) and parse_unit(usable).dimensions == parse_unit("N").dimensions
    return force and (not {"load", "last"}.isdisjoint(said) or has(said, "normal"))


def kind_of(said: list[str]) -> tuple[str, str]:
    """The quantity that the words say, and the word that says it."""
    if not said:
        return UNKNOWN, ""
    telling = [word for word in said if word not in CHANGES["neutral"]]
    if "n" in telling and telling[0] not in ("n", "f"):
        said = [word for word in said if word != "n"]  # a speed is n first, or it is newtons
    special = _by_letters(said)
    if special is not None:
        return special
    kinds = [k for k, listed in WORDS.items() if not listed.isdisjoint(said)]
    simulated = not {"simulation", "sim"}.isdisjoint(said)
    if "time" in kinds and (simulated or (kinds == ["index", "time"] and said[-1] == "time")):
        return TIME, "time"
    if "load" in said and (not kinds or kinds == ["index"]):
        if has(said, "normal"):
            return "normal", "normal load"
        return ("torque", "load cell") if has(said, "sensor") else (UNKNOWN, "")
    if not kinds:
        return _without_quantity(said)
    kind = kinds[0]
    word = next(each for each in said if each in WORDS[kind])
    if kind in ("neither", "index", "time"):
        return {"neither": UNKNOWN, "index": INDEX, "time": TIME}[kind], word
    if kind == "current":
        return _current(said, word)
    if kind == "torque" and has(said, "estimate"):
        return UNKNOWN, "an estimated torque"
    if kind in ("angle", "rate") and said[-1] in ("e", "el", "elec", "electrical"):
        return UNKNOWN, "electrical, not mechanical"
    return kind, word


def _by_letters(said: list[str]) -> tuple[str, str] | None:
    """What is known of names of one or two letters; None where they say nothing special."""
    first, rest = said[0], said[1:]
    if first in ("m", "t") and rest:
        # One letter for torque or temperature: what stands beside it decides.
        if first == "t" and has(said, "place"):
            return "warmth", " ".join(said)
        sided = has(rest, "motor") or has(rest, "load")
        told = first == "m" and (has(said, "target") or not {"ist", "meas"}.isdisjoint(rest))
        if (sided and rest != ["m"]) or told or (first == "t" and rest[0] in ("em", "e")):
            return "torque", " ".join(said)
    if any(word in FORCES for word in said) and not has(said, "motor"):
        return "torque", " ".join(said)
    if first == "f" and rest and (f"f{rest[0]}" in FORCES or has(rest, "friction")):
        return "torque", " ".join(said)
    if said == ["ff"]:
        return "torque", "ff"
    if first in ("p", "s", "v") and rest and (has(rest, "target") or has(rest, "neutral")):
        electrical = first == "v" and not {"d", "q", "in", "bus"}.isdisjoint(rest)
        if not electrical and len(rest) == 1:
            return ("rate" if first == "v" else "angle"), first
    if "ff" in rest:
        return UNKNOWN, "feedforward"
    if first == "v" and not {"d", "q"}.isdisjoint(rest):
        return UNKNOWN, "a voltage, or a target"
    if said[-1] == "dot" and (len(said) > 1):
        return "rate", " ".join(said)
    return None


def _without_quantity(said: list[str]) -> tuple[str, str]:
    """A gyro, a place that has a temperature, a target of something."""
    if has(said, "gyro"):
        return "rate", "gyro"
    if any(word in said for word in FORCES) or (
        len(said) > 1 and said[0] == "f" and said[1] in ("x", "y", "z", "n")
    ):
        return "torque", " ".join(said)
    heat = {"winding", "wicklung", "ambient", "coolant", "stator", "yoke", "tooth", "umgebung"}
    if all(word in CHANGES["place"] or word in CHANGES["motor"] for word in said) and (
        not heat.isdisjoint(said)
    ):
        return "warmth", " ".join(said)
    targets = [word for word in said if word in CHANGES["target"] and len(word) > 1]
    if targets and targets != ["set"]:
        return "target", targets[0]
    return UNKNOWN, ""


def _current(said: list[str], word: str) -> tuple[str, str]:
    """Only the current that makes torque is one of the motor."""
    others = [each for each in said if each != word]
    if word in ("i", "current", "strom", "curr", "cur"):
        if "d" in others:
            return UNKNOWN, "a current along d makes no torque"
        if any(each in _PHASES for each in others):
            return UNKNOWN, "phase current"
    if not {"in", "input", "dc", "leakage"}.isdisjoint(others):
        return UNKNOWN, "what is drawn from the supply"
    return "current", word
