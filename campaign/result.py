"""What an analysis found: tables, figures and findings, as data.

Experiments make these; the report draws them. Values are SI with their unit beside them; `display`
is the unit a reader is shown, and the report converts. Nothing here knows HTML or matplotlib.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Value = float | int | str | bool | None
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
    """

    quantity: str
    value: float
    unit: str
    conditions: Mapping[str, Value]
    recomputed: bool = False
    lower_bound: bool = False


@dataclass(frozen=True)
class Column:
    """A column of a table: `unit` of its values (SI), `display` unit of the page ("" for none)."""

    name: str
    label: str
    unit: str = ""
    display: str = ""


@dataclass(frozen=True)
class Table:
    """A table in the report, and a CSV file beside it.

    Attributes:
        key: unique within its test, e.g. `stabilization-error`; lower case, digits and hyphens.
        rows: one mapping per row, column name to value.
        thesis: numbers of the published tables it stands for, e.g. ("5.2", "5.8"); may be empty.
    """

    key: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Mapping[str, Value], ...]
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
    """

    x: Array
    y: Array
    label: str = ""
    series: str = ""
    style: Style = "line"
    y_low: Array | None = None


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
