"""Results of an analysis as data: tables, figures, findings.

Experiments create them; the report draws them. Values are SI with their unit; the report converts
them to the unit `display`. This module is independent of HTML and matplotlib.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, Self, TypeGuard

import numpy as np
from numpy.typing import NDArray
from pydantic import InstanceOf

from campaign.estimate import Estimate
from campaign.parameter import NOTHING_IDENTIFIED, IdentifiedRig
from campaign.reason import NONE, Cause, Reason

Array = Annotated[NDArray[np.float64], InstanceOf()]
NOT_FOUND = Cause("not found by analysis", "the analysis did not find it")
NO_INTERVAL = Cause("no interval given", "the analysis gives no interval")

Value = float | int | str | bool | None
Cell = Value | Estimate
"""Content of a table cell: an estimate if it is an estimated number."""
Style = Literal["line", "points", "line+points", "band", "thin", "loop"]

TOLERANCE = 1e-3
"""Relative tolerance for equal numbers of a condition, relative to the larger."""
ROUNDING = 1e-9
"""Relative tolerance between a sweep point and the same number in a finding's conditions."""
NOTHING = 1e-9
"""Absolute tolerance for equal numbers of a condition (SI): 1e-17 rad equals 0."""


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a number; True and False are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def same_value(one: Value, other: Value) -> bool:
    """Whether two values of a condition are equal: numbers within `TOLERANCE`, words exactly."""
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=TOLERANCE, abs_tol=NOTHING)
    return str(one) == str(other)


def meets(stated: Mapping[str, Value], wanted: Mapping[str, Value]) -> bool:
    """Whether the stated conditions include each of the wanted ones, with the same value."""
    return all(name in stated and same_value(stated[name], value) for name, value in wanted.items())


def allow(conditions: Mapping[str, Value], point: Mapping[str, Any]) -> bool:
    """Whether no condition excludes a trial at this point of its matrix.

    Numbers may differ by rounding. Conditions have only the name of a swept table, so that any
    table may match.
    """
    shared = point.keys() & conditions.keys()
    return all(_is_swept(point[name], conditions[name]) for name in shared)


def _is_swept(swept: Any, stated: Value) -> bool:
    if is_number(swept) and is_number(stated):
        return math.isclose(swept, stated, rel_tol=ROUNDING)
    return isinstance(swept, dict) or swept == stated


@dataclass(frozen=True)
class Finding:
    """One number of an analysis, with its conditions; matched to published cells by them.

    Attributes:
        quantity: e.g. `stabilization_error` (a published table uses the same name).
        value: SI, in `unit`; NaN if the analysis could not determine it.
        conditions: e.g. {"compensation": "lugre", "frequency": 0.24, "acceleration": 0.314159};
            numbers SI. They must meet every condition of a published cell.
        recomputed: derived from other published cells rather than from a recording.
        lower_bound: the true value is at least this; comparable only to a claim of "at least".
        estimate: the same number with its interval, or the reason for no interval; None if the
            analysis gives none.
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
        """Finding from an estimate and its conditions; "at least" becomes a lower bound."""
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
        """Estimate with an interval or a reason, also if the analysis gives none."""
        if self.estimate is not None:
            return replace(self.estimate, name=self.quantity)
        kind = "at least" if self.lower_bound else "number"
        found = math.isfinite(self.value)
        value, reason = (self.value, NO_INTERVAL()) if found else (math.nan, NOT_FOUND())
        return Estimate.without_interval(self.quantity, value, self.unit, reason, kind=kind)


def bare(cell: Cell) -> Value:
    """Value of a cell without interval; None for an estimate that is not determined."""
    if isinstance(cell, Estimate):
        return None if math.isnan(cell.value) else cell.value
    return cell


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Its numbers are estimates, or it is `exact`, or `reason` states why they have no interval.

    Attributes:
        unit: SI unit of its values.
        display: unit of the page, "" for the same.
        exact: its values were set or counted: they have no uncertainty, so no interval.
        reason: why the numbers of this column have no interval.
        quantity: quantity of the finding in each cell, if any; the row's columns give its
            conditions by name. The page then shows published values beside it.
        decimals: minimum number of decimals on the page, for numbers printed with so many.
        file_only: whether only the CSV file has the column, e.g. a standard error.
    """

    name: str
    label: str
    unit: str = ""
    display: str = ""
    exact: bool = False
    reason: Reason = NONE
    quantity: str = ""
    decimals: int = 0
    file_only: bool = False

    @property
    def shown_unit(self) -> str:
        """Unit of the page."""
        return self.display or self.unit


@dataclass(frozen=True)
class Table:
    """A table in the report, and a CSV file beside it.

    Attributes:
        key: unique within its test, e.g. `stabilization-error`; lower case, digits and hyphens.
        rows: one mapping per row, column name to value or to estimate.
        thesis: numbers of the corresponding published tables, e.g. ("5.2", "5.8"); may be empty.
    """

    key: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Mapping[str, Cell], ...]
    thesis: tuple[str, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class Axis:
    """An axis: label without unit, `unit` of the data (SI), `display` unit on the page.

    Attributes:
        limits: in `unit`; an infinite end or NaN follows from the data.
        places: (position in `unit`, name) of tick labels that replace numbers.
    """

    label: str
    unit: str = ""
    display: str = ""
    scale: Literal["linear", "log"] = "linear"
    limits: tuple[float, float] | None = None
    places: tuple[tuple[float, str], ...] = ()

    @property
    def shown_unit(self) -> str:
        """Unit of the page."""
        return self.display or self.unit


@dataclass(frozen=True)
class Curve:
    """One curve of a panel; a `loop` is a line with arrows in its direction.

    Attributes:
        x, y: shape (n,), in the units of the panel's axes.
        series: meaning of the curve; the same series has the same color and dash everywhere
            (`none`, `static`, `lugre`, `observer`, `measured`, `fit`, `reference`, or any text).
        y_low: for `band`: the lower edge, shape (n,); `y` is then the upper one.
        low, high: 95 % interval of `y`, shape (n,), NaN for none: bars on points, a band behind a
            line. At an infinite end `y` is a bound, drawn with an arrow in that direction.
        quantity: quantity of the finding in each `y`, if any; its published values are drawn
            beside the curve, as hollow marks.
        along: name of the finding's condition along x.
        conditions: the finding's other conditions (SI).
        law: fitted `y` as a function of x (n,) and of parameters by name; a published parameter set
            is drawn as a separate curve. A function at module level, so that it can be pickled.
        parameters: units (SI) of the law's parameters, by quantity.
        aside: offset to the right (in the unit of `x`) at which the curve and its published values
            are drawn, to separate it from another curve; `x` itself is unchanged.
    """

    x: Array
    y: Array
    label: str = ""
    series: str = ""
    style: Style = "line"
    y_low: Array | None = None
    low: Array | None = None
    high: Array | None = None
    quantity: str = ""
    along: str = ""
    conditions: Mapping[str, Value] = field(default_factory=dict)
    law: Callable[[Array, Mapping[str, float]], Array] | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    aside: float = 0.0

    @classmethod
    def of(
        cls,
        x: Array | Sequence[float],
        found: Sequence[Estimate],
        label: str = "",
        series: str = "",
        style: Style = "points",
        **more: Any,
    ) -> Self:
        """Curve of estimates over `x`, shape (n,), with intervals (systematic parts included).

        Bounds have arrows. more: further attributes.
        """
        low, high = np.array([ends_of(each) for each in found], dtype=float).reshape(-1, 2).T
        y = np.array([each.value for each in found], dtype=float)
        return cls(np.asarray(x, float), y, label, series, style, low=low, high=high, **more)


def ends_of(estimate: Estimate) -> tuple[float, float]:
    """Low and high for a curve, systematic parts included: NaN for none, infinite for a bound."""
    low, high = (math.nan if end is None else end for end in estimate.combined)
    if estimate.kind == "at least":
        return low, math.inf
    return (-math.inf, high) if estimate.kind == "at most" else (low, high)


@dataclass(frozen=True)
class Mark:
    """A labelled position in a panel, in axis units: a line across it, a point, or an interval.

    Attributes:
        x, y: position of a vertical or a horizontal line; both for a point (`point`).
        point: a dot at (x, y) with the label beside it instead of lines.
        until: end of a shaded interval that begins at `x` or `y`, whichever is given.
        series: series whose color it has; "" for a neutral color.
    """

    label: str
    x: float | None = None
    y: float | None = None
    point: bool = False
    until: float | None = None
    series: str = ""


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
        caption: content of the figure in one or two sentences.
        alt: text alternative for readers who cannot see it.
        thesis: numbers of the corresponding published figures, e.g. ("5.4",).
        across: number of panels side by side; further panels are below.
        trials: numbers of the shown trials; empty for all measurements of its test.
        one_scale: whether panels with the same y axis share their limits, for comparison.
    """

    key: str
    title: str
    caption: str
    alt: str
    panels: tuple[Panel, ...]
    thesis: tuple[str, ...] = ()
    across: int = 1
    trials: tuple[int, ...] = ()
    one_scale: bool = False


@dataclass(frozen=True)
class RecordingDoubt:
    """A defect of a trial's recording.

    Attributes:
        number, label: of the trial.
        fatal: whether the analysis excludes the recording.
    """

    number: int
    label: str
    reason: Reason
    fatal: bool


@dataclass(frozen=True)
class Result:
    """Result of the analysis of one test.

    Attributes:
        notes: sentences for the report: caveats, assumptions, failures and their causes.
        key_numbers: main results, the most important first; `findings`, or medians of draws.
        telling: key of the most informative figure; "" for the first.
        doubts: defective recordings, added by the caller of the analysis; `notes` state the same.
        identified: identified parameters of the rig and their basis; may be empty.
    """

    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    key_numbers: tuple[Finding, ...] = ()
    telling: str = ""
    doubts: tuple[RecordingDoubt, ...] = ()
    identified: IdentifiedRig = NOTHING_IDENTIFIED

    @property
    def is_empty(self) -> bool:
        """Whether it contains only notes."""
        return not (self.figures or self.findings or any(each.rows for each in self.tables))

    @property
    def left_out(self) -> tuple[RecordingDoubt, ...]:
        """Defects of the excluded recordings."""
        return tuple(each for each in self.doubts if each.fatal)
