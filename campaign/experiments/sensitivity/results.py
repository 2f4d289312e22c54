"""Thresholds and ranks of parameters: table and figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from campaign.estimate import Estimate, Origin
from campaign.estimation.threshold import Threshold, crossing, passing
from campaign.experiments.shared.common import method_label
from campaign.experiments.shared.friction_models import PARAMETER_LABELS
from campaign.reason import Cause
from campaign.result import (
    Array,
    Axis,
    Cell,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Table,
    Value,
)
from campaign.units import in_words

RANK = Cause("rank", "a place in an order, not a size")
OPEN_RANK = Cause(
    "open rank",
    "a place in an order, not a size; by the intervals of the thresholds it may change places with "
    "{others}",
)
SYMBOLS = {
    name: label.rpartition(" ")[2]
    for name, label in PARAMETER_LABELS.items()
    if name != "stribeck_exponent"
}
"""Symbols of the parameters that a test varies by default."""


@dataclass(frozen=True)
class Response:
    """Error over the change of one parameter; changes increase, 0 among them.

    Attributes:
        change: shape (n,), relative.
        errors: rad, one for each change, over its repetitions.
        dots: every trial's (change, error), shape (m, 2).
    """

    change: Array
    errors: tuple[Estimate, ...]
    dots: Array

    @cached_property
    def error(self) -> Array:
        """Values of the errors (rad), shape (n,)."""
        return np.array([error.value for error in self.errors])

    @property
    def unchanged(self) -> Estimate:
        """The error with the model as it is."""
        return self.errors[int(np.argmin(np.abs(self.change)))]


@dataclass(frozen=True)
class ResponseVerdict:
    """Threshold and rank of one parameter.

    Attributes:
        threshold: smallest relative change at which the error passes, or a bound of it.
        rank: 1 the most important.
    """

    parameter: str
    response: Response
    threshold: Estimate
    rank: Estimate

    @property
    def symbol(self) -> str:
        return SYMBOLS.get(self.parameter, self.parameter)

    @property
    def passed(self) -> bool:
        """Whether the threshold was passed by a change that was tried."""
        return self.threshold.kind == "number" and bool(np.isfinite(self.threshold.value))


def ranking(responses: Mapping[str, Response], threshold: float) -> dict[str, int]:
    """Rank of each parameter, 1 the most important: by the threshold, then by the largest error."""

    def order(parameter: str) -> tuple[float, float]:
        response = responses[parameter]
        passed = crossing(response.change, response.error, threshold)
        largest = float(np.max(response.error))
        return (np.inf if passed is None else passed), -largest

    return {name: rank for rank, name in enumerate(sorted(responses, key=order), start=1)}


def judge(responses: Mapping[str, Response], limit: Threshold) -> tuple[ResponseVerdict, ...]:
    """Threshold and rank of each parameter, in the order of `responses`."""
    thresholds = {
        name: passing("sensitivity_threshold", response.change, response.errors, limit)
        for name, response in responses.items()
    }
    ranks = ranking(responses, limit.value)
    return tuple(
        ResponseVerdict(name, response, thresholds[name], _rank(name, ranks, thresholds))
        for name, response in responses.items()
    )


def _rank(name: str, ranks: Mapping[str, int], thresholds: Mapping[str, Estimate]) -> Estimate:
    """Rank without interval; its reason names parameters that may change places with it."""
    near = [
        SYMBOLS.get(other, other)
        for other, estimate in thresholds.items()
        if other != name and _may_be_alike(estimate, thresholds[name])
    ]
    reason = OPEN_RANK(others=", ".join(near)) if near else RANK()
    rank = float(ranks[name])
    return Estimate.without_interval("sensitivity_rank", rank, "", reason, kind="count")


def _may_be_alike(one: Estimate, other: Estimate) -> bool:
    """Whether the ranges of two thresholds overlap, which leaves their order open."""
    first, second = _range(one), _range(other)
    return first[0] <= second[1] and second[0] <= first[1]


def _range(threshold: Estimate) -> tuple[float, float]:
    if threshold.kind == "at least":
        return threshold.value, np.inf
    low, high = threshold.combined
    value = threshold.value if np.isfinite(threshold.value) else 0.0
    return (value if low is None else low), (
        np.inf if high is None and low is not None else value if high is None else high
    )


def sensitivity_findings(
    judged: Sequence[ResponseVerdict], told: Mapping[str, Value]
) -> Iterator[Finding]:
    """Threshold and rank of each parameter; a threshold that no change passes is a lower bound."""
    for one in judged:
        where = {**told, "parameter": one.parameter}
        yield Finding.of(one.threshold, where)
        yield Finding.of(one.rank, where)


def _row(one: ResponseVerdict) -> dict[str, Cell]:
    response = one.response
    bound = "not determined" if np.isnan(one.threshold.value) else f"{one.threshold.value:.0%}"
    return {
        "parameter": one.parameter,
        "symbol": one.symbol,
        "threshold": one.threshold,
        "rank": one.rank,
        "unchanged": response.unchanged,
        "lowest_change": float(response.change[0]),
        "lowest_change_error": response.errors[0],
        "highest_change": float(response.change[-1]),
        "highest_change_error": response.errors[-1],
        "said": "" if one.passed else f"none below {bound}",
    }


def sensitivity_table(judged: Sequence[ResponseVerdict], limit: Threshold, remark: str) -> Table:
    """A row for each parameter, the most important first; remark: on the error."""
    return Table(
        key="sensitivity",
        title=f"Change of each parameter at which the error exceeds "
        f"{in_words(limit.value, 'rad', 'mrad')}",
        columns=(
            Column("symbol", "Parameter"),
            Column("parameter", "Name"),
            Column("threshold", "Change", "", "percent"),
            Column("said", "Within the changes tried"),
            Column("rank", "Rank"),
            Column("unchanged", "Error, unchanged", "rad", "mrad"),
            Column("lowest_change", "Largest decrease", "", "percent", exact=True),
            Column("lowest_change_error", "Error there", "rad", "mrad"),
            Column("highest_change", "Largest increase", "", "percent", exact=True),
            Column("highest_change_error", "Error there", "rad", "mrad"),
        ),
        rows=tuple(_row(one) for one in sorted(judged, key=lambda one: one.rank.value)),
        thesis=("figure 5.14",),
        note="The smaller of decrease and increase counts, interpolated between the changes tried. "
        "Parameters that never pass are ranked by their largest error; the change that stands "
        f"there is a bound. The error is that of the position, 1σ.{remark}",
    )


def thresholds_figure(
    judged: Sequence[ResponseVerdict],
    limit: Threshold,
    compensation: str,
    told: Mapping[str, Value] | None,
) -> Iterator[Figure]:
    """Figure of the smallest inadmissible change of each parameter, the most important first.

    told: conditions of the findings without the parameter; None if they are not compared.
    """
    ordered = sorted(judged, key=lambda one: one.rank.value)
    if not any(math.isfinite(one.threshold.value) for one in ordered):
        return
    quantity = "" if told is None else "sensitivity_threshold"
    curves = [
        Curve.of(
            [place], [one.threshold], "", "measured",
            quantity=quantity, conditions={**(told or {}), "parameter": one.parameter},
        )
        for place, one in enumerate(ordered)
        if math.isfinite(one.threshold.value)
    ]  # fmt: skip
    places = tuple((float(k), _place(one)) for k, one in enumerate(ordered))
    parameter = Axis("Parameter", limits=(-0.5, len(ordered) - 0.5), places=places)
    beyond = (
        " An arrow goes up where it was not reached, from the change up to which that is sure."
        if any(one.threshold.kind == "at least" for one in ordered)
        else ""
    )
    change = Axis("Smallest inadmissible change", "", "percent", limits=(0.0, math.nan))
    yield Figure(
        key="thresholds",
        title=f"Admissible error of each parameter, {method_label(compensation)}",
        caption="The smallest change, up or down, at which the error passes "
        f"{_milliradians(limit.value)}, with its 95 % interval where there is one; the most "
        f"important parameter first.{beyond}",
        alt="A dot for each parameter at the change at which the error passes the threshold, with "
        "its interval; else at the largest change tried.",
        panels=(Panel(parameter, change, curves),),
    )


def sensitivity_figure(
    judged: Sequence[ResponseVerdict], limit: Threshold, compensation: str
) -> Figure:
    """Figure 5.14: a panel for each parameter, all of one scale."""
    top = 1.08 * max(float(np.nanmax(one.response.dots[:, 1], initial=0.0)) for one in judged)
    scale = (0.0, max(top, 1.1 * limit.value))
    error = Axis("Stabilization error (1σ)", "rad", "mrad", limits=scale)
    panels = []
    for one in judged:
        response = one.response
        change, dots = response.change, response.dots
        curves = [Curve.of(change, response.errors, "mean", "measured", "line")]
        if len(dots) > len(change):
            curves.append(Curve(dots[:, 0], dots[:, 1], "each trial", "measured", "points"))
        axis = Axis(f"Change of {one.symbol}", "", "percent")
        title = f"{one.symbol}: {_said(one)}, rank {one.rank.value:.0f}"
        panels.append(Panel(axis, error, curves, title, list(_marks(one, limit))))
    return Figure(
        key="sensitivity",
        title=f"Error over the change of each parameter, {method_label(compensation)}",
        caption="Each panel changes one parameter of the compensation's model and leaves the "
        "others and the true friction alone. The steeper the valley, the better the parameter has "
        f"to be known; the horizontal line is the threshold of {_milliradians(limit.value)}, the "
        "shaded change the 95 % interval of where it is passed, the band that of the mean. All "
        "panels have one scale.",
        alt="Stabilization error over the relative change of each model parameter, one panel per "
        "parameter: a dot for each trial, a line at the threshold.",
        panels=tuple(panels),
        thesis=("5.14",),
        across=2,
    )


def _place(one: ResponseVerdict) -> str:
    """Axis label of a parameter, with a remark on a threshold without a number."""
    if one.threshold.kind == "at least":
        return f"{one.symbol}\nnot reached"
    return one.symbol if math.isfinite(one.threshold.value) else f"{one.symbol}\nnot determined"


def _said(one: ResponseVerdict) -> str:
    if one.passed:
        return f"passes at {100 * one.threshold.value:.0f} %"
    if one.threshold.kind == "at least":
        return f"not reached by {100 * one.threshold.value:.0f} %"
    return "not determined"


def _marks(one: ResponseVerdict, limit: Threshold) -> Iterator[Mark]:
    """Marks of the threshold, and of the change at which the error passes it, with interval."""
    yield Mark(_milliradians(limit.value), y=limit.value)
    threshold = one.threshold
    if not one.passed or threshold.origin is Origin.NOT_DETERMINED:
        return
    response = one.response
    # The threshold has no sign: take the side on which the error is closer to the limit.
    errors = np.interp((-threshold.value, threshold.value), response.change, response.error)
    sign = -1.0 if abs(errors[0] - limit.value) < abs(errors[1] - limit.value) else 1.0
    yield Mark("", x=sign * threshold.value, y=limit.value, point=True, series="fit")
    low, high = threshold.combined
    if low is not None and high is not None:
        yield Mark("passes here (95 %)", x=sign * low, until=sign * high, series="fit")


def _milliradians(angle: float) -> str:
    return in_words(angle, "rad", "mrad")
