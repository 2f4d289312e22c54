"""Which rows of a table are which trial, by a column that tells trials apart, or by their times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from campaign.importing.defects.clock import SHORTEST
from campaign.importing.defects.clock import restarts as restarts
from campaign.importing.defects.defect import counted
from campaign.importing.interface import Array

NEEDED = f"a recording needs {SHORTEST}"


class CutError(ValueError):
    """A column that tells no trials apart.

    Attributes:
        key: of `[[test.recording]]`: `where`, `each`, `restarts` or `trigger`.
    """

    def __init__(self, message: str, key: str) -> None:
        self.key = key
        super().__init__(message)


@dataclass(frozen=True)
class Stretch:
    """Rows of a table that are one trial, what tells it from others, and what to remark."""

    first: int
    rows: int
    conditions: dict[str, float]
    remarks: tuple[str, ...] = ()


def by_value(
    values: Array, first: int, name: str, key: str, wanted: float | None = None
) -> list[Stretch]:
    """A trial for each stretch in which a column does not change; raises CutError for none.

    Stretches that are too short for a trial are left out, and the first trial says so.

    Args:
        values: of the column, shape (n,); `first` is the row of the first.
        key: what of the mapping asks for it, for messages.
        wanted: only stretches of this value.
    """
    there = np.isfinite(values)
    same = (values[1:] == values[:-1]) | ~(there[1:] | there[:-1])
    edges = np.flatnonzero(~same) + 1
    bounds = [0, *edges.tolist(), len(values)]
    found = [(a, b) for a, b in pairwise(bounds) if there[a]]
    if wanted is not None:
        found = [(a, b) for a, b in found if values[a] == wanted]
        if not found:
            raise CutError(f"column {name!r} is never {wanted:g}", key)
    empty = int(len(values) - there.sum())
    blank = f"column {name!r} has no value in {counted(empty, 'row')}" if empty else ""
    if not found:
        raise CutError(blank, key)
    long = [(a, b) for a, b in found if b - a >= SHORTEST]
    if not long:
        lengths = [b - a for a, b in found]
        raise CutError(
            f"column {name!r} makes {_stretches(len(found))}, the shortest of "
            f"{counted(min(lengths), 'row')} and the longest of {counted(max(lengths), 'row')}; "
            f"{NEEDED}{f'. {blank[0].upper()}{blank[1:]}' if blank else ''}",
            key,
        )
    remarks = []
    if short := len(found) - len(long):
        remarks.append(
            f"{_stretches(short)} of column {name!r} with fewer than {SHORTEST} rows {_are(short)}"
        )
    if blank:
        remarks.append(f"{blank}, which {'is' if empty == 1 else 'are'} in no trial")
    word = "".join(c if c.isalnum() else "_" for c in name.lower()).strip("_") or "value"
    cut = [Stretch(first + a, b - a, {word: float(values[a])}) for a, b in long]
    cut[0] = replace(cut[0], remarks=tuple(remarks))
    return numbered(cut)


def by_restart(times: Array, first: int) -> list[Stretch]:
    """A trial for each stretch in which time (s), shape (n,), goes on; raises CutError for one.

    Stretches that are too short for a trial are left out, and the first trial says so.
    """
    bounds = [0, *restarts(times), len(times)]
    if len(bounds) < 3:
        raise CutError("its time begins once", "restarts")
    long = [(a, b) for a, b in pairwise(bounds) if b - a >= SHORTEST]
    if not long:
        raise CutError(f"{_stretches(len(bounds) - 1)}, all too short; {NEEDED}", "restarts")
    cut = numbered([Stretch(first + a, b - a, {}) for a, b in long])
    if short := len(bounds) - 1 - len(long):
        what = f"{_stretches(short)} of time with fewer than {SHORTEST} rows {_are(short)}"
        cut[0] = replace(cut[0], remarks=(what,))
    return cut


def _are(count: int) -> str:
    return "is no trial" if count == 1 else "are no trials"


def by_trigger(
    values: Array,
    first: int,
    name: str,
    level: float,
    ends_of: Callable[[np.ndarray], np.ndarray],
    stop: int,
) -> list[Stretch]:
    """A trial from each row in which a column has risen through a level.

    Args:
        values: of the column, shape (n,); `first` is the row of the first.
        ends_of: from the rows in which trials begin to those after their ends, shape (k,) each.
        stop: row after the last; what would end later is left out.

    Raises CutError for none, and where two trials would have rows in common.
    """
    known = np.flatnonzero(np.isfinite(values))  # a lost value is no fall
    above = values[known] > level
    rises = known[1:][~above[:-1] & above[1:]] + first
    ends = ends_of(rises) if len(rises) else rises
    pairs = [(int(a), int(b)) for a, b in zip(rises, ends, strict=True) if b <= stop]
    if not pairs:
        raise CutError(
            f"column {name!r} never rises through {level:g} long enough before the end", "trigger"
        )
    for (_, end), (begin, _) in pairwise(pairs):
        if begin < end:
            raise CutError(
                f"column {name!r} rises through {level:g} again in row {begin + 1}, "
                f"{counted(end - begin, 'row')} before the trial that is running there ends: no "
                "row may be in two trials; take a shorter 'duration', or another 'level'",
                "trigger",
            )
    if (fewest := min(b - a for a, b in pairs)) < SHORTEST:
        raise CutError(f"its 'duration' holds {counted(fewest, 'row')}, and {NEEDED}", "trigger")
    return numbered([Stretch(a, b - a, {}) for a, b in pairs])


def numbered(stretches: Sequence[Stretch]) -> list[Stretch]:
    """The same; where two are told apart by nothing, each also by its number, from 1."""
    alike = Counter(tuple(each.conditions.items()) for each in stretches)
    if max(alike.values(), default=0) < 2:
        return list(stretches)
    key = "part" if all("part" not in each.conditions for each in stretches) else "stretch"
    return [
        replace(each, conditions={**each.conditions, key: number})
        for number, each in enumerate(stretches, 1)
    ]


def _stretches(count: int) -> str:
    return counted(count, "stretch") if count == 1 else f"{count} stretches"
