"""What an analysis found: tables, figures and findings, as data.

Experiments make these; the report draws them. Values are SI with their unit beside them; `display`
is the unit a reader is shown, and the report converts. Nothing here knows HTML or matplotlib.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from campaign.estimate import Estimate, Origin

Array = NDArray[np.float64]
Value = float | int | str | bool | None
Cell = Value | Estimate
"""What stands in a cell of a table: an estimate where it is a number that was found."""
Style = Literal["line", "points", "line+points", "band", "thin"]


@dataclass(frozen=True)
class Finding:
    """One number an analysis found, under which conditions: what the scoreboard matches.

    Attributes:
        quantity: what it is, e.g. `stabilization_error` (a published table names the same word).
        value: SI, in `unit`; NaN when the analysis could not find it.
        conditions: e.g. {"compensation": "lugre", "frequency": 0.24, "acceleration": 0.314159};
            numbers SI. Every condition a published cell states must be met here.
        recomputed: derived from other published cells rather than from a recording.
        lower_bound: the true value is at least this; it answers only a claim of "at least".
        estimate: the same number with its interval, or with the reason why it has none; None for
            an analysis that does not say.
    """

    quantity: str
    value: float
    unit: str
    conditions: Mapping[str, Value]
    recomputed: bool = False
    lower_bound: bool = False
    estimate: Estimate | None = None

    @classmethod
    def of(
        cls, estimate: Estimate, conditions: Mapping[str, Value], *, recomputed: bool = False
    ) -> Self:
        """What an estimate says, under its conditions; a bound of "at least" is told as one."""
        return cls(
            estimate.name,
            estimate.value,
            estimate.unit,
            conditions,
            recomputed=recomputed,
            lower_bound=estimate.kind == "at least",
            estimate=estimate,
        )

    @property
    def known(self) -> Estimate:
        """The number with its interval or a reason, whatever the analysis said of it."""
        if self.estimate is not None:
            return replace(self.estimate, name=self.quantity)
        kind: Literal["at least", "number"] = "at least" if self.lower_bound else "number"
        if not math.isfinite(self.value):
            return Estimate(
                self.quantity,
                math.nan,
                self.unit,
                reason="the analysis did not find it",
                origin=Origin.NOT_DETERMINED,
                kind=kind,
            )
        return Estimate(
            self.quantity,
            self.value,
            self.unit,
            reason="the analysis gives no interval",
            kind=kind,
        )


def bare(cell: Cell) -> Value:
    """The value in a cell, without its interval; None for an estimate that is not determined."""
    if isinstance(cell, Estimate):
        return None if math.isnan(cell.value) else cell.value
    return cell


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Its numbers are estimates, or it is `exact`, or `reason` says why they have no interval.

    Attributes:
        unit: of its values (SI).
        display: unit of the page, "" for the same.
        exact: what it holds was set, or counted: it has no interval because it is not uncertain.
        reason: why the numbers of this column have no interval.
    """

    name: str
    label: str
    unit: str = ""
    display: str = ""
    exact: bool = False
    reason: str = ""


@dataclass(frozen=True)
class Table:
    """A table in the report, and a CSV file beside it.

    Attributes:
        key: unique within its test, e.g. `stabilization-error`; lower case, digits and hyphens.
        rows: one mapping per row, column name to value or to estimate.
        thesis: numbers of the published tables it stands for, e.g. ("5.2", "5.8"); may be empty.
    """

    key: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Mapping[str, Cell], ...]
    thesis: tuple[str, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class Axis:
    """An axis: label without unit, `unit` of the data (SI), `display` unit on the page."""

    label: str
    unit: str = ""
    display: str = ""
    scale: Literal["linear", "log"] = "linear"
    limits: tuple[float, float] | None = None  # in `unit`


@dataclass(frozen=True)
class Curve:
    """One curve of a panel.

    Attributes:
        x, y: shape (n,), in the units of the panel's axes.
        series: what it stands for; the same series has the same colour and dash everywhere
            (`none`, `static`, `lugre`, `observer`, `measured`, `fit`, `reference`, or any text).
        y_low: for `band`: the lower edge, shape (n,); `y` is then the upper one.
        low, high: 95 % interval of `y`, shape (n,), NaN where there is none: bars on points, a band
            behind a line.
    """

    x: Array
    y: Array
    label: str = ""
    series: str = ""
    style: Style = "line"
    y_low: Array | None = None
    low: Array | None = None
    high: Array | None = None

    @classmethod
    def of(
        cls,
        x: Array,
        found: Sequence[Estimate],
        label: str = "",
        series: str = "",
        style: Style = "points",
    ) -> Self:
        """Estimates over `x`, shape (n,), with their intervals (systematic parts included)."""
        ends = [each.combined if each.has_interval else (None, None) for each in found]
        low, high = (
            np.array([np.nan if end[side] is None else end[side] for end in ends], dtype=float)
            for side in (0, 1)
        )
        y = np.array([each.value for each in found], dtype=float)
        return cls(x, y, label, series, style, low=low, high=high)


@dataclass(frozen=True)
class Mark:
    """A labelled position in a panel: a vertical and/or horizontal line, in axis units."""

    label: str
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True)
class Panel:
    """One set of axes."""

    x: Axis
    y: Axis
    curves: Sequence[Curve]
    title: str = ""
    marks: Sequence[Mark] = ()


@dataclass(frozen=True)
class Figure:
    """A figure in the report.

    Attributes:
        key: unique within its test, lower case, digits and hyphens.
        caption: what to see in it, in a sentence or two.
        alt: what the figure shows, for who cannot see it.
        thesis: numbers of the published figures it stands for, e.g. ("5.4",).
        across: panels side by side; further ones go below.
    """

    key: str
    title: str
    caption: str
    alt: str
    panels: tuple[Panel, ...]
    thesis: tuple[str, ...] = ()
    across: int = 1


@dataclass(frozen=True)
class Result:
    """What one test's analysis found.

    `notes` are sentences for the report: caveats, assumptions, what failed and why.
    """

    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
