"""Clauses of conclusions on friction models, by model and swept value."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from campaign.estimate import Estimate
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    Settings,
    count,
    determined,
    listed,
    setting,
)
from campaign.experiments.shared.friction_models import ConditionGroup, model_label
from campaign.result import Amount, Cell

Rows = Sequence[Mapping[str, Cell]]
ROUNDING = 1e-12
"""Share of the largest number of a column below which one is a rounding error."""
MOST = 4
"""Most models or places of a sweep that a sentence names."""


def each_model(
    rows: Rows,
    places: Sequence[ConditionGroup],
    settings: Settings,
    tell: Callable[[list[Mapping[str, Cell]]], Parts],
) -> Parts:
    """What is to tell of the rows of each model or place, behind its name."""
    items: list[Parts] = []
    for place in places[:MOST]:
        own = [r for r in rows if all(r.get(k) == v for k, v in place.point.items())]
        if own and (told := tell(own)):
            items.append((*_name(place, settings), *told))
    more = len(places) - MOST
    left: tuple[Parts, ...] = ((f"{count(more, 'more place')} in the table",),) if more > 0 else ()
    return listed((*items, *left), "; ", "; ")


def amount_of(row: Mapping[str, Cell], name: str, display: str = "") -> Amount | None:
    """The number of a column; None where there is none."""
    cell = row.get(name)
    return Amount(cell, display) if isinstance(cell, Estimate) else None


def without_rounding(rows: Rows, name: str) -> list[Mapping[str, Cell]]:
    """The rows with 0 in place of what is a rounding error of the column's largest number."""
    found = [cell for row in rows if isinstance(cell := row.get(name), Estimate)]
    largest = max((abs(each.value) for each in found if determined(each)), default=0.0)
    clean = {
        id(each): replace(each, value=0.0)
        for each in found
        if abs(each.value) < ROUNDING * largest and not each.has_interval
    }
    return [{**row, name: clean.get(id(row.get(name)), row.get(name))} for row in rows]


def setting_of(row: Mapping[str, Cell], name: str, unit: str, display: str = "") -> Amount:
    """What a column was set to; 0 where it was not."""
    value = row.get(name)
    return setting(float(value) if isinstance(value, int | float) else 0.0, unit, display)


def at_ends(
    rows: list[Mapping[str, Cell]], along: tuple[str, str, str], name: str, display: str = ""
) -> Parts:
    """`1.2 N m at 0.1 N m/s and 0.9 N m at 50 N m/s`: at both ends of a sweep, never between.

    along: what the rows follow, with its unit and the one it is shown in.
    """
    ends = [rows[0], rows[-1]] if len(rows) > 1 else rows
    told = [
        (amount, " at ", setting_of(r, *along))
        for r in ends
        if (amount := amount_of(r, name, display))
    ]
    return listed(told)


def _name(place: ConditionGroup, settings: Settings) -> Parts:
    """`LuGre model: `; empty for the bench's own friction."""
    point = dict(place.point)
    model = point.pop("model", None)
    words: list[Parts] = [(model_label(str(model)),)] if model is not None else []
    words += [settings.told(path, value) for path, value in point.items()]
    return (*listed(words, last=", "), ": ") if words else ()
