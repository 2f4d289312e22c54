"""Published values beside the curves of a figure.

A curve says of which quantity its points are and under which conditions; a published cell that
agrees with all of that is a hollow mark, at the cell's own place along x. Where a document prints
the parameters of a curve instead, the curve that they give is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, product

import numpy as np

from campaign.published.values import Cell, Published, PublishedTable
from campaign.result import Array, Curve, Figure, Panel, Value, same_value
from campaign.units import convert

DRAWN = ("equal", "near")
"""Relations of a cell that is a value ..."""
BOUNDS = ("at least", "at most")
"""... and of one that is a bound, which an arrow goes from; a rank has no place on an axis."""
FINE = 300
"""Points of a published curve."""
DOUBTFUL = "inconsistent or not reproducible"


@dataclass(frozen=True)
class PublishedMarks:
    """Published values of one curve, in the units of its panel's axes (SI).

    Attributes:
        x, y: shape (n,).
        tables: headings of the tables they are from.
        joined: points of a curve that was worked out from published parameters.
        doubtful: the document contradicts itself there, or nobody could reproduce it.
        bound: `at least` or `at most`, where the values are no more than that.
    """

    x: Array
    y: Array
    tables: tuple[str, ...]
    joined: bool = False
    doubtful: bool = False
    bound: str = ""


Place = tuple[int, int]
"""Number of a panel in its figure, and of a curve in that panel."""
Marks = Mapping[Place, Sequence[PublishedMarks]]


@dataclass(frozen=True)
class PublishedBeside:
    """What a test's figures are compared with.

    Attributes:
        tables: those that the test stands for, of the document that its protocol names.
        known: conditions that hold for every curve which does not state them itself.
    """

    tables: Sequence[PublishedTable] = ()
    known: Mapping[str, Value] = field(default_factory=dict)

    @classmethod
    def of(
        cls, published: Published, reproduces: Iterable[str], known: Mapping[str, Value]
    ) -> PublishedBeside:
        """With the tables that a test reproduces; names that the document lacks have none."""
        return cls([published[name] for name in reproduces if name in published], known)

    def marks(self, figure: Figure) -> Marks:
        """What is published of each curve of a figure; curves without anything are missing."""
        found = {
            (place, number): tuple(self._of_curve(curve, panel))
            for place, panel in enumerate(figure.panels)
            for number, curve in enumerate(panel.curves)
        }
        return {place: marks for place, marks in found.items() if marks}

    def _of_curve(self, curve: Curve, panel: Panel) -> Iterator[PublishedMarks]:
        for doubtful in (False, True):
            if curve.quantity:
                for relations in (DRAWN, *((bound,) for bound in BOUNDS)):
                    yield from self._points(curve, panel, doubtful, relations)
            if curve.law is not None:
                yield from self._curves(curve, doubtful)

    def _points(
        self, curve: Curve, panel: Panel, doubtful: bool, relations: Sequence[str]
    ) -> Iterator[PublishedMarks]:
        found = [
            (x, y, table.heading)
            for table in self.tables
            for cell in table.cells
            if cell.quantity == curve.quantity and bool(cell.status) is doubtful
            if (x := _along(curve, cell)) is not None and self._agree(curve, cell, relations)
            if (y := _value(cell, panel.y.unit)) is not None
        ]
        if found:
            xs, ys, headings = zip(*found, strict=True)
            tables = tuple(dict.fromkeys(headings))
            bound = relations[0] if relations[0] in BOUNDS else ""
            yield PublishedMarks(np.array(xs), np.array(ys), tables, doubtful=doubtful, bound=bound)

    def _curves(self, curve: Curve, doubtful: bool) -> Iterator[PublishedMarks]:
        """One for each table that prints every parameter once under the curve's conditions."""
        x = _range(curve.x)
        for table in self.tables:
            cells = [
                cell
                for cell in table.cells
                if cell.quantity in curve.parameters and self._agree(curve, cell)
            ]
            values = {c.quantity: _value(c, curve.parameters[c.quantity]) for c in cells}
            known = {name: value for name, value in values.items() if value is not None}
            complete = len(known) == len(cells) == len(curve.parameters) > 0
            if complete and any(cell.status for cell in cells) is doubtful and curve.law:
                y = np.asarray(curve.law(x, known), dtype=float)
                yield PublishedMarks(x, y, (table.heading,), joined=True, doubtful=doubtful)

    def _agree(self, curve: Curve, cell: Cell, relations: Sequence[str] = DRAWN) -> bool:
        """Whether the curve states each condition of a cell but the one along x."""
        stated = {**self.known, **curve.conditions}
        return cell.relation in relations and all(
            name in stated and same_value(stated[name], value)
            for name, value in cell.conditions.items()
            if name != curve.along
        )


def _along(curve: Curve, cell: Cell) -> float | None:
    """Where a cell stands along x; beside the only point of a curve that nothing runs along."""
    if not curve.along:
        return float(curve.x[0]) if len(curve.x) == 1 else None
    x = cell.conditions.get(curve.along)
    return float(x) if isinstance(x, int | float) and not isinstance(x, bool) else None


def _value(cell: Cell, unit: str) -> float | None:
    """A cell in `unit`; None where that is of another kind."""
    try:
        value = float(convert(cell.value, cell.unit, unit))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _range(x: Array) -> Array:
    """`FINE` places from one end of a curve to the other; at equal ratios where all are positive.

    Empty where it has no two places.
    """
    finite = np.asarray(x, dtype=float)[np.isfinite(x)]
    if not finite.size or finite.min() == finite.max():
        return np.empty(0)
    low, high = float(finite.min()), float(finite.max())
    return np.geomspace(low, high, FINE) if low > 0 else np.linspace(low, high, FINE)


def published_text(marks: Marks) -> str:
    """A sentence for each sort of sign: which tables it stands for; "" without any."""
    every = [each for group in marks.values() for each in group]
    sentences = []
    for joined, bound in product((False, True), ("", *BOUNDS)):
        own = [each for each in every if (each.joined, each.bound) == (joined, bound)]
        doubtful = [each.doubtful for each in own]
        headings = dict.fromkeys(heading for each in own for heading in each.tables)
        if headings:
            sign = "Fine dotted line" if joined else "Hollow"
            arrow = f", with an arrow ({bound})" if bound else ""
            pale, some = ("", "some of it") if joined else (", pale", "pale what")
            why = f"{pale} ({DOUBTFUL})" if all(doubtful) else ""
            besides = f"; {some} is {DOUBTFUL}" if any(doubtful) and not all(doubtful) else ""
            sentences.append(f"{sign}{arrow}{why}: {_listed(list(headings))}{besides}.")
    return " ".join(sentences)


def _listed(headings: Sequence[str]) -> str:
    """`Tables 5.2, 5.4; Figure 5.14`, in their order."""
    parts = []
    for word, group in groupby(headings, key=lambda heading: heading.split(" ")[0]):
        numbers = [heading.split(" ", 1)[1] for heading in group]
        parts.append(f"{word}{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}")
    return "; ".join(parts)
