"""Published cells without a value: trials failed, or were not executed.

The cells of a failed trial must stay on the board, or a method that diverges would improve it. A
failed trial does not affect the cells of other sweep points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from campaign.published.provenance import SweepPoint
from campaign.result import Value, is_number, same_value

COMPENSATION = "compensation"


def in_vain(places: Sequence[SweepPoint], conditions: Mapping[str, Value]) -> bool:
    """Whether trials were executed for a cell with these conditions, and some that it needs failed.

    A number of the sweep or of the options that differs from the cell's excludes a trial. A word
    excludes a trial only if the test has trials with the cell's own word; otherwise the cell may
    combine several trials, as *nominal* or *sum* do. A failed trial with another word counts: a
    comparison with *no compensation* needs that trial, too.
    """
    near = [place for place in places if not _other_number(place, conditions)]
    tested_words = _words(near)
    tried = any(
        all(
            words[name] == conditions[name]
            for name in words.keys() & conditions.keys()
            if conditions[name] in tested_words[name] or name == COMPENSATION
        )
        for words in (_words_of(place) for place in near)
    )
    return tried and any(place.failed for place in near)


def _other_number(place: SweepPoint, conditions: Mapping[str, Value]) -> bool:
    numbers = {k: v for k, v in {**place.numbers, **place.point}.items() if is_number(v)}
    return any(
        is_number(conditions[name]) and not same_value(numbers[name], conditions[name])
        for name in numbers.keys() & conditions.keys()
    )


def _words_of(place: SweepPoint) -> dict[str, str]:
    swept = {name: value for name, value in place.point.items() if isinstance(value, str)}
    return {COMPENSATION: place.compensation, **swept}


def _words(places: Sequence[SweepPoint]) -> dict[str, set[str]]:
    words: dict[str, set[str]] = {}
    for place in places:
        for name, word in _words_of(place).items():
            words.setdefault(name, set()).add(word)
    return words
