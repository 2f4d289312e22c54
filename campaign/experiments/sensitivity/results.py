"""Thresholds and ranks of parameters: table and figure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.threshold import Threshold, crossing, passing
from campaign.reason import Cause
from campaign.result import (
    Array,
    Cell,
    Column,
    Finding,
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
    "bristle_stiffness": "σ0",
    "bristle_damping": "σ1",
    "viscous_friction": "σ2",
    "static_torque": "Ts",
    "coulomb_torque": "Tc",
    "stribeck_velocity": "vs",
}


@dataclass(frozen=True)
class Response:
    """Error over the change of one parameter; changes increase, 0 among them.

    Attributes:
        change: shape (n,), relative.
        errors: rad, one for each change: over its repetitions.
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
    """What one parameter's response says.

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
    """A place in an order: what has no interval, but neighbours that may stand in its place."""
    near = [
        SYMBOLS.get(other, other)
        for other, estimate in thresholds.items()
        if other != name and _may_be_alike(estimate, thresholds[name])
    ]
    reason = OPEN_RANK(others=", ".join(near)) if near else RANK()
    rank = float(ranks[name])
    return Estimate.without_interval("sensitivity_rank", rank, "", reason, kind="count")


def _may_be_alike(one: Estimate, other: Estimate) -> bool:
    """Whether what is known of two thresholds leaves their order open."""
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
    """Threshold and rank of each parameter; a threshold that nothing passes is a lower bound."""
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


def sensitivity_table(judged: Sequence[ResponseVerdict], limit: Threshold) -> Table:
    """A row for each parameter, the most important first."""
    return Table(
        key="sensitivity",
        title=f"Change of each parameter at which the error passes "
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
        "there is a bound.",
    )
