"""Published values beside the curves of a figure.

A curve has a quantity and conditions. A published cell with the same quantity and conditions is a
hollow mark at the cell's x. If a document prints the parameters of a curve instead, the resulting
curve is drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, product

import numpy as np

from campaign.published.values import Cell, Published, PublishedTable
from campaign.result import Array, Curve, Figure, Panel, Value, is_number, meets

DRAWN = ("equal", "near")
"""Relations of a cell that is a value ..."""
BOUNDS = ("at least", "at most")
"""... and of one that is a bound, with an arrow; a rank has no place on an axis."""
FINE = 300
"""Number of points of a published curve."""
DOUBTFUL = "inconsistent or not reproducible"


@dataclass(frozen=True)
class PublishedMarks:
    """Published values of one curve, in the units of its panel's axes (SI).

    Attributes:
        x, y: shape (n,).
        tables: headings of their tables.
        joined: whether they are a curve computed from published parameters.
        doubtful: whether the document contradicts itself, or they are not reproducible.
        bound: `at least` or `at most` for bounds, else "".
    """

    x: Array
    y: Array
    tables: tuple[str, ...]
    joined: bool = False
    doubtful: bool = False
    bound: str = ""


Place = tuple[int, int]
"""Index of a panel in its figure, and of a curve in that panel."""
Marks = Mapping[Place, Sequence[PublishedMarks]]


@dataclass(frozen=True)
class PublishedBeside:
    """Published tables beside a test's figures.

    Attributes:
        tables: tables that the test reproduces, of the document that its protocol names.
        known: default conditions of every curve that does not state them.
    """

    tables: Sequence[PublishedTable] = ()
    known: Mapping[str, Value] = field(default_factory=dict)

    @classmethod
    def of(
        cls, published: Published, reproduces: Iterable[str], known: Mapping[str, Value]
    ) -> PublishedBeside:
        """Select the tables that a test reproduces; unknown names are ignored."""
        return cls([published[name] for name in reproduces if name in published], known)

    def marks(self, figure: Figure) -> Marks:
        """Published values of each curve of a figure; curves without any are missing."""
        by_curve = {
            (place, number): tuple(self._of_curve(curve, panel))
            for place, panel in enumerate(figure.panels)
            for number, curve in enumerate(panel.curves)
        }
        return {place: marks for place, marks in by_curve.items() if marks}

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
        points = [
            (x, y, table.heading)
            for table in self.tables
            for cell in table.cells
            if cell.quantity == curve.quantity and bool(cell.status) is doubtful
            if (x := _along(curve, cell)) is not None and self._agree(curve, cell, relations)
            if (y := cell.in_unit(panel.y.unit)) is not None
        ]
        if points:
            xs, ys, headings = zip(*points, strict=True)
            tables = tuple(dict.fromkeys(headings))
            bound = relations[0] if relations[0] in BOUNDS else ""
            yield PublishedMarks(np.array(xs), np.array(ys), tables, doubtful=doubtful, bound=bound)

    def _curves(self, curve: Curve, doubtful: bool) -> Iterator[PublishedMarks]:
        """Curve of each table with exactly one value per parameter under the curve's conditions."""
        x = _range(curve.x)
        for table in self.tables:
            cells = [
                cell
                for cell in table.cells
                if cell.quantity in curve.parameters and self._agree(curve, cell)
            ]
            values = {c.quantity: c.in_unit(curve.parameters[c.quantity]) for c in cells}
            known = {name: value for name, value in values.items() if value is not None}
            complete = len(known) == len(cells) == len(curve.parameters) > 0
            if complete and any(cell.status for cell in cells) is doubtful and curve.law:
                y = np.asarray(curve.law(x, known), dtype=float)
                yield PublishedMarks(x, y, (table.heading,), joined=True, doubtful=doubtful)

    def _agree(self, curve: Curve, cell: Cell, relations: Sequence[str] = DRAWN) -> bool:
        """Whether the curve states all conditions of a cell, except the one along x."""
        wanted = {name: value for name, value in cell.conditions.items() if name != curve.along}
        stated = {**self.known, **curve.conditions}
        return cell.relation in relations and meets(stated, wanted)


def _along(curve: Curve, cell: Cell) -> float | None:
    """Position of a cell along x; without a condition along x, that of the curve's only point."""
    if not curve.along:
        return float(curve.x[0]) if len(curve.x) == 1 else None
    x = cell.conditions.get(curve.along)
    return float(x) if is_number(x) else None


def _range(x: Array) -> Array:
    """`FINE` values over the range of a curve, at equal ratios if all are positive.

    Empty for fewer than two different values.
    """
    finite = np.asarray(x, dtype=float)[np.isfinite(x)]
    if not finite.size or finite.min() == finite.max():
        return np.empty(0)
    low, high = float(finite.min()), float(finite.max())
    return np.geomspace(low, high, FINE) if low > 0 else np.linspace(low, high, FINE)


def published_text(marks: Marks) -> str:
    """Sentence for each kind of sign with its tables; "" without marks."""
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
    """Headings in short, such as `Tables 5.2, 5.4; Figure 5.14`, in their order."""
    parts = []
    for word, group in groupby(headings, key=lambda heading: heading.split(" ")[0]):
        numbers = [heading.split(" ", 1)[1] for heading in group]
        parts.append(f"{word}{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}")
    return "; ".join(parts)
