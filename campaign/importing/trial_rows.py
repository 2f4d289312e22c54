"""Rows of a table by trial: from a trial column, or from times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from campaign.importing.defects.clock import SHORTEST, restarts
from campaign.importing.interface import Array
from campaign.text import count

NEEDED = f"a recording needs {SHORTEST}"


@dataclass(frozen=True)
class Stretch:
    """Rows of a table that are one trial, its distinguishing conditions, and its remarks."""

    first: int
    rows: int
    conditions: dict[str, float]
    remarks: tuple[str, ...] = ()


def by_value(values: Array, first: int, name: str, wanted: float | None = None) -> list[Stretch]:
    """A trial for each stretch in which a column is constant; raises ValueError for none.

    Stretches that are too short for a trial are omitted, with a remark in the first trial.

    Args:
        values: of the column, shape (n,); `first` is the row of the first value.
        wanted: only stretches of this value.
    """
    known = np.isfinite(values)
    same = (values[1:] == values[:-1]) | ~(known[1:] | known[:-1])
    edges = np.flatnonzero(~same) + 1
    bounds = [0, *edges.tolist(), len(values)]
    stretches = [(a, b) for a, b in pairwise(bounds) if known[a]]
    if wanted is not None:
        stretches = [(a, b) for a, b in stretches if values[a] == wanted]
        if not stretches:
            raise ValueError(f"column {name!r} is never {wanted:g}")
    empty = int(len(values) - known.sum())
    blank = f"column {name!r} has no value in {count(empty, 'row')}" if empty else ""
    if not stretches:
        raise ValueError(blank)
    long, remarks = _long(stretches, f"column {name!r}", blank)
    if blank:
        remarks.append(f"{blank}, which {'is' if empty == 1 else 'are'} in no trial")
    word = "".join(c if c.isalnum() else "_" for c in name.lower()).strip("_") or "value"
    trials = [Stretch(first + a, b - a, {word: float(values[a])}) for a, b in long]
    return _numbered(trials, remarks)


def by_restart(times: Array, first: int) -> list[Stretch]:
    """A trial for each stretch of increasing time (s), shape (n,). ValueError without a restart."""
    bounds = [0, *restarts(times), len(times)]
    if len(bounds) < 3:
        raise ValueError("its time begins once")
    long, remarks = _long(list(pairwise(bounds)), "time")
    return _numbered([Stretch(first + a, b - a, {}) for a, b in long], remarks)


def _long(
    found: Sequence[tuple[int, int]], what: str, blank: str = ""
) -> tuple[list[tuple[int, int]], list[str]]:
    """The stretches that are long enough for a trial, and a remark on the others.

    Raises ValueError if there are none; its message includes `blank`, rows without a value.
    """
    long = [(a, b) for a, b in found if b - a >= SHORTEST]
    short = len(found) - len(long)
    if not long:
        lengths = [b - a for a, b in found]
        raise ValueError(
            f"{what} makes {count(len(found), 'stretch', 'stretches')}, the shortest of "
            f"{count(min(lengths), 'row')} and the longest of {count(max(lengths), 'row')}; "
            f"{NEEDED}{f'. {blank[0].upper()}{blank[1:]}' if blank else ''}"
        )
    are = "is no trial" if short == 1 else "are no trials"
    stretches = count(short, "stretch", "stretches")
    remark = f"{stretches} of {what} with fewer than {SHORTEST} rows {are}"
    return long, [remark] if short else []


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
        values: of the column, shape (n,); `first` is the row of the first value.
        ends_of: maps the first rows of trials to the rows after their ends, shape (k,) each.
        stop: row after the last; trials that end later are omitted.

    Raises ValueError if there are none, if two trials overlap, or if they are too short.
    """
    known = np.flatnonzero(np.isfinite(values))  # a lost value is no fall
    above = values[known] > level
    rises = known[1:][~above[:-1] & above[1:]] + first
    ends = ends_of(rises) if len(rises) else rises
    pairs = [(int(a), int(b)) for a, b in zip(rises, ends, strict=True) if b <= stop]
    if not pairs:
        raise ValueError(
            f"column {name!r} never rises through {level:g} long enough before the end"
        )
    for (_, end), (begin, _) in pairwise(pairs):
        if begin < end:
            raise ValueError(
                f"column {name!r} rises through {level:g} again in row {begin + 1}, "
                f"{count(end - begin, 'row')} before the end of a trial; take a shorter "
                "'duration', or another 'level'"
            )
    if (fewest := min(b - a for a, b in pairs)) < SHORTEST:
        raise ValueError(f"its 'duration' holds {count(fewest, 'row')}, and {NEEDED}")
    return _numbered([Stretch(a, b - a, {}) for a, b in pairs])


def _numbered(stretches: list[Stretch], remarks: Sequence[str] = ()) -> list[Stretch]:
    """The stretches, with the remarks on the first.

    If two have the same conditions, a number from 1 is added to the conditions of each.
    """
    first, *others = stretches
    result = [replace(first, remarks=tuple(remarks)), *others]
    if len({tuple(each.conditions.items()) for each in result}) == len(result):
        return result
    key = "stretch" if "part" in first.conditions else "part"
    return [
        replace(each, conditions={**each.conditions, key: number})
        for number, each in enumerate(result, 1)
    ]
