"""A column's name in pieces: its words, part by part of a path, and the unit that it ends with.

`/joint_states/position[0]`, `VelRadPerSec`, `Motorstrom in A` and `torque_mNm` each say a quantity,
and some of them a unit, in another way.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from campaign.importing.guess.stated import stated_unit
from campaign.importing.guess.words import CHANGES, KNOWN, WORDS, taken_apart

_SPELLED = {
    "deg": "deg",
    "degs": "deg",
    "degree": "deg",
    "degrees": "deg",
    "rad": "rad",
    "rads": "rad",
    "radians": "rad",
    "mrad": "mrad",
    "urad": "urad",
    "rev": "rev",
    "revs": "rev",
    "turns": "rev",
    "rpm": "rpm",
    "mm": "mm",
    "um": "um",
    "cm": "cm",
    "nm": "N m",
    "mnm": "mN m",
    "ncm": "N cm",
    "nmm": "N mm",
    "knm": "kN m",
    "kn": "kN",
    "degps": "deg/s",
    "dps": "deg/s",
    "radps": "rad/s",
    "mmps": "mm/s",
    "mps": "m/s",
    "milliseconds": "ms",
    "microseconds": "us",
    "nanoseconds": "ns",
    "millis": "ms",
    "micros": "us",
    "nanos": "ns",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "msec": "ms",
    "usec": "us",
    "nsec": "ns",
    "sec": "s",
    "secs": "s",
    "seconds": "s",
    "second": "s",
    "ma": "mA",
    "degc": "degC",
    "celsius": "degC",
    "count": "count",
    "counts": "count",
    "cnt": "count",
    "ticks": "count",
    "inc": "count",
}
"""Words of several letters that are a unit, in lower case."""
_LETTERS = {"N": "N", "A": "A", "s": "s", "m": "m", "C": "degC"}
"""Letters that may be a unit; `q_m` is measured, and `current_a` of phase a as well."""
_PER_SECOND = {
    "deg": "deg/s",
    "rad": "rad/s",
    "mrad": "mrad/s",
    "rev": "rev/s",
    "mm": "mm/s",
    "m": "m/s",
    "um": "um/s",
    "count": "count/s",
    "turns": "rev/s",
}
_THOUSANDTHS = {"milli": "ms", "micro": "us", "nano": "ns"}
_MOVING = WORDS["angle"] | WORDS["rate"] | WORDS["current"]
_LETTER_AND_AXIS = re.compile(r"[mld][xyz]")
"""Behind a quantity that moves: of the motor, the load, or a target. Elsewhere `mx` is a moment."""
_STARRED = re.compile(r"(?<=[^\W_])\*(?=$|[\s_.:/\[(])")
"""As `iq*`: drives mark targets so."""
_WHOLE = re.compile(r"(?:m|c|k)?N(?:c|m)?m|m?A|k?N|deg[CK]|(?:m|u)?rad|[un]s|ms|rpm|RPM")
"""What would fall apart at its capital letters."""
_PIECE = re.compile(r"[A-Z]{2,}(?=[xyz](?![a-zß-ÿ]))|[A-ZÀ-Þ]?[a-zß-ÿ]+|[A-ZÀ-Þ]+(?![a-zß-ÿ])|\d+")
_GREEK = {"θ": "theta", "ω": "omega", "τ": "tau", "φ": "phi", "ϕ": "phi", "µ": "mu", "μ": "mu"}
_BRACKETED = re.compile(r"^(?P<name>.*\S)\s*[\[(<](?P<unit>[^\[\]()<>]*)[\])>]$")
_ALONE = re.compile(r"^[\[(<](?P<unit>[^\[\]()<>]*)[\])>]$")
_IN = re.compile(r"^(?P<name>.*\S)\s+in\s+(?P<unit>\S+)$")
_OVER = re.compile(r"^(?P<name>[^/]*[^/\s])\s*/\s*(?P<unit>[^/\s]+)$")


@dataclass(frozen=True)
class Ending:
    """The unit that a name ends with.

    Attributes:
        unit: as the grammar has it; "" where there is none.
        sure: whether it can be nothing else, where the quantity can have it.
        clear: whether the file writes it as units are written: `tether_N`, and not `f_n`.
        squared: it is one of an acceleration, which is no channel.
    """

    unit: str = ""
    sure: bool = False
    clear: bool = True
    squared: bool = False


@dataclass(frozen=True)
class Pieces:
    """A name taken apart.

    Attributes:
        parts: of a path, each as its words in lower case; the unit is not among them.
        whole: the words of the last part with those of the unit.
    """

    parts: tuple[tuple[str, ...], ...]
    whole: tuple[str, ...]
    ending: Ending


def pieces(name: str) -> Pieces:
    """The words and the unit of a name."""
    text = unicodedata.normalize("NFKC", name).strip(" \"'#%")
    for found in (_BRACKETED.match(text), _IN.match(text), _OVER.match(text)):
        if found is not None and (usable := stated_unit(found["unit"])[1]):
            parts = _parts(found["name"])
            # `x/s` may be a path as well, whose last part is of one letter.
            sure = "/" not in text or found.re is not _OVER or len(found["unit"]) > 1
            last = parts[-1] if parts else ()
            return Pieces(_words(parts), _apart(last), Ending(usable, sure))
    if (alone := _ALONE.match(text)) and (usable := stated_unit(alone["unit"])[1]):
        return Pieces((), (), Ending(usable, True))
    parts = _parts(text)
    if not parts:
        return Pieces((), (), Ending())
    bare, ending = _ending(parts[-1])
    return Pieces(_words([*parts[:-1], bare]), _apart(parts[-1]), ending)


def _parts(text: str) -> list[tuple[str, ...]]:
    """Of a path, as pieces in the letters of the file."""
    for letter, word in _GREEK.items():
        text = text.replace(letter, word)
    text = _STARRED.sub("_target", text)
    found = []
    for part in re.split(r"[./:]", text):
        own: list[str] = []
        for chunk in re.findall(r"[0-9A-Za-zÀ-ÿ]+", part):
            own += [chunk] if _WHOLE.fullmatch(chunk) else _PIECE.findall(chunk)
        if own:
            found.append(tuple(own))
    return found


def _words(parts: list[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    return tuple(_apart(part) for part in parts if part)


def _apart(part: tuple[str, ...]) -> tuple[str, ...]:
    """The words of a part: compounds as several, `set point` as one."""
    found: list[str] = []
    for piece in part:
        low = piece.lower()
        of_axis = _LETTER_AND_AXIS.fullmatch(low)
        said = (_MOVING | WORDS["torque"]) if low[0] == "d" else _MOVING
        for word in low if of_axis and not said.isdisjoint(found) else taken_apart(low):
            if found and len(found[-1] + word) > 5 and found[-1] + word in KNOWN:
                found[-1] += word
            else:
                found.append(word)
    return tuple(found)


def _ending(part: tuple[str, ...]) -> tuple[tuple[str, ...], Ending]:
    """A part without the unit at its end, and that unit; numbers and `raw` may follow it."""
    end = len(part)
    while end > 1 and (part[end - 1].isdigit() or part[end - 1].lower() in CHANGES["neutral"]):
        end -= 1
    low = tuple(piece.lower() for piece in part)
    if end > 1 and low[end - 1] in ("s", "sec", "second") and end < len(part) and low[end] == "2":
        return part, Ending(squared=True)
    for long, last in ((3, ("s", "sec", "second")), (2, ("s", "sec"))):
        if end > long and low[end - 1] in last and (long == 2 or low[end - 2] == "per"):
            over = _PER_SECOND.get(_SPELLED.get(low[end - long], low[end - long]), "")
            if over:
                return (*part[: end - long], *part[end:]), Ending(over, True)
    if end > 2 and low[end - 2] in _THOUSANDTHS and low[end - 1] in ("s", "sec", "seconds"):
        return (*part[: end - 2], *part[end:]), Ending(_THOUSANDTHS[low[end - 2]], True)
    if end > 1 and low[end - 1] in _SPELLED:
        bare = (*part[: end - 1], *part[end:])
        return bare, Ending(_SPELLED[low[end - 1]], True)
    letter, before = part[-1], part[-2] if len(part) > 1 else ""
    written = letter if letter in _LETTERS else letter.upper() if letter in "na" else ""
    # `omega_m` is that of the motor, and `travel_m` a length.
    long = 6 if letter == "m" else 3
    if before and written and (letter.isupper() or len(before) >= long):
        clear = letter.isupper() and not all(piece.isupper() for piece in part)
        # After `time` a letter s is nothing else.
        return part[:-1], Ending(_LETTERS[written], letter == "s" and len(before) > 3, clear)
    return part, Ending()
