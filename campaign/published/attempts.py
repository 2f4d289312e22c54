"""Published cells without a value: tried in vain, or not tried.

A trial that failed must not let its cells leave the board, or a method that diverges would make it
look better. Nor does it cost the cells of other places in the sweep.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from campaign.published.provenance import SweepPoint
from campaign.result import Value, same_value

COMPENSATION = "compensation"


def in_vain(places: Sequence[SweepPoint], conditions: Mapping[str, Value]) -> bool:
    """Whether trials were executed for a cell with these conditions, and some that it needs failed.

    What the plan tells: a number of the sweep or of the options that is not the cell's excludes a
    trial. A word does where the test has trials of the cell's own word; else it may stand for what
    several trials say together, as *nominal* or *sum* do. A failed trial of another word counts:
    what is compared with *no compensation* needs that, too.
    """
    near = [place for place in places if not _other_number(place, conditions)]
    told = _words(near)
    tried = any(
        all(
            words[name] == conditions[name]
            for name in words.keys() & conditions.keys()
            if conditions[name] in told[name] or name == COMPENSATION
        )
        for words in (_words_of(place) for place in near)
    )
    return tried and any(place.failed for place in near)


def _other_number(place: SweepPoint, conditions: Mapping[str, Value]) -> bool:
    numbers = {k: v for k, v in {**place.numbers, **place.point}.items() if _is_number(v)}
    return any(
        _is_number(conditions[name]) and not same_value(numbers[name], conditions[name])
        for name in numbers.keys() & conditions.keys()
    )


def _words_of(place: SweepPoint) -> dict[str, str]:
    swept = {name: value for name, value in place.point.items() if isinstance(value, str)}
    return {COMPENSATION: place.compensation, **swept}


def _words(places: Sequence[SweepPoint]) -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for place in places:
        for name, word in _words_of(place).items():
            found.setdefault(name, set()).add(word)
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
