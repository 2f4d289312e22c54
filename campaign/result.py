"""Results of an analysis as data: tables, figures, findings.

Experiments make these; the report draws them. Values are SI with their unit beside them; `display`
is the unit a reader is shown, and the report converts. Nothing here knows HTML or matplotlib.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import InstanceOf

from campaign.estimate import Estimate, Origin
from campaign.parameter import NOTHING_IDENTIFIED, IdentifiedRig
from campaign.reason import NONE, Cause, Reason

Array = Annotated[NDArray[np.float64], InstanceOf()]
NOT_FOUND = Cause("not found by analysis", "the analysis did not find it")
NO_INTERVAL = Cause("no interval given", "the analysis gives no interval")

Value = float | int | str | bool | None
Cell = Value | Estimate
"""What stands in a cell of a table: an estimate where it is a number that was found."""
Style = Literal["line", "points", "line+points", "band", "thin", "loop"]

TOLERANCE = 1e-3
"""How far two numbers of a condition may lie apart, as a share of the larger."""
NOTHING = 1e-9
"""What of a condition (SI) counts as 0: a position of 1e-17 rad is the position 0."""


def same_value(one: Value, other: Value) -> bool:
    """Whether two values of a condition are the same: numbers within `TOLERANCE`, words exactly."""
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=TOLERANCE, abs_tol=NOTHING)
    return str(one) == str(other)


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
                reason=NOT_FOUND(),
                origin=Origin.NOT_DETERMINED,
                kind=kind,
            )
        return Estimate(
            self.quantity,
            self.value,
            self.unit,
            reason=NO_INTERVAL(),
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
        quantity: which finding each number is, where it is one, under the conditions that its row
            has by their names; published values of it then stand beside it.
        decimals: digits after the point that the page shows at least, of numbers that were printed
            with so many.
        file_only: the page leaves it to the CSV file: a standard error, where it shows intervals.
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
    """An axis: label without unit, `unit` of the data (SI), `display` unit on the page.

    Attributes:
        limits: in `unit`; an end that is not finite follows from what is drawn.
        places: names along the axis in place of numbers, each with where it stands (in `unit`).
    """

    label: str
    unit: str = ""
    display: str = ""
    scale: Literal["linear", "log"] = "linear"
    limits: tuple[float, float] | None = None
    places: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class Curve:
    """One curve of a panel; a `loop` is a line with arrows that show which way it runs.

    Attributes:
        x, y: shape (n,), in the units of the panel's axes.
        series: what it stands for; the same series has the same colour and dash everywhere
            (`none`, `static`, `lugre`, `observer`, `measured`, `fit`, `reference`, or any text).
        y_low: for `band`: the lower edge, shape (n,); `y` is then the upper one.
        low, high: 95 % interval of `y`, shape (n,), NaN where there is none: bars on points, a band
            behind a line. Where an end is infinite, `y` is a bound, and an arrow goes that way.
        quantity: which finding each `y` is, where it is one; published values of it are then drawn
            beside the curve, as hollow marks.
        along: the condition of that finding that runs along x, by its name.
        conditions: the finding's other conditions (SI).
        law: what gives a fitted `y`, a function of x (n,) and of parameters by name; a published
            set of them is then drawn as a curve of its own. A function of a module, so that a
            figure can go from one process to another.
        parameters: units (SI) of the law's parameters, by the quantities that they are.
        aside: how far to the right of `x` (in its unit) the curve is drawn, with what is published
            of it, where it would else lie on another; a drawing alone knows it, `x` stays true.
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
        """Estimates over `x`, shape (n,), with their intervals (systematic parts included).

        Those that are bounds have arrows. more: further attributes.
        """
        low, high = np.array([ends_of(each) for each in found], dtype=float).reshape(-1, 2).T
        y = np.array([each.value for each in found], dtype=float)
        return cls(np.asarray(x, float), y, label, series, style, low=low, high=high, **more)


def ends_of(estimate: Estimate) -> tuple[float, float]:
    """Low and high for a curve, systematic parts included: NaN where there is none.

    The open side of a bound is infinite.
    """
    low, high = (math.nan if end is None else end for end in estimate.combined)
    if estimate.kind == "at least":
        return low, math.inf
    return (-math.inf, high) if estimate.kind == "at most" else (low, high)


@dataclass(frozen=True)
class Mark:
    """A labelled position in a panel, in axis units: a line across it, a point, or a stretch.

    Attributes:
        x, y: where a vertical or a horizontal line lies; both for a point (`point`).
        point: a dot at (x, y) with the label beside it instead of lines.
        until: end of a shaded stretch that begins at the one of `x` and `y` that is given.
        series: whose colour it has; "" is nobody's.
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
        caption: what to see in it, in a sentence or two.
        alt: what the figure shows, for who cannot see it.
        thesis: numbers of the published figures it stands for, e.g. ("5.4",).
        across: panels side by side; further ones go below.
        trials: numbers of the trials that it shows; empty for all measurements of its test.
        one_scale: panels whose y axes are alike share their limits, so that they can be compared.
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
    """What is wrong with the recording of a trial.

    Attributes:
        number, label: of the trial.
        fatal: whether the analysis does without it.
    """

    number: int
    label: str
    reason: Reason
    fatal: bool


@dataclass(frozen=True)
class Result:
    """What one test's analysis found.

    Attributes:
        notes: sentences for the report: caveats, assumptions, what failed and why.
        key_numbers: what was asked for, the most important first; `findings`, or medians of draws.
        telling: key of the figure that tells it best; "" for the first.
        doubts: recordings that something is wrong with; `notes` say the same. Whoever calls an
            analysis adds them.
        identified: parameters of the rig, and what they rest on; empty without any.
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
        """Whether there is nothing but notes."""
        return not (self.figures or self.findings or any(each.rows for each in self.tables))

    @property
    def left_out(self) -> tuple[RecordingDoubt, ...]:
        """Of the trials that it does without."""
        return tuple(each for each in self.doubts if each.fatal)
