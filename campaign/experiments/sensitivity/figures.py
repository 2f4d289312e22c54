"""Figures of the sensitivity study: thresholds, and error over each parameter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from campaign.estimate import Origin
from campaign.estimation.threshold import Threshold
from campaign.experiments.sensitivity.results import ResponseVerdict
from campaign.experiments.shared.common import method_label
from campaign.experiments.shared.pointing_error import ends
from campaign.result import Axis, Curve, Figure, Mark, Panel, Value
from campaign.units import in_words


def thresholds_figure(
    judged: Sequence[ResponseVerdict],
    limit: Threshold,
    compensation: str,
    told: Mapping[str, Value] | None,
) -> Iterator[Figure]:
    """How much each parameter may change, the most important first.

    told: conditions of the findings, but for the parameter; None where they are not compared.
    """
    ordered = sorted(judged, key=lambda one: one.rank.value)
    if not any(math.isfinite(one.threshold.value) for one in ordered):
        return
    curves: list[Curve] = []
    for place, one in enumerate(ordered):
        found, x = one.threshold, np.array([float(place)])
        if not math.isfinite(found.value):
            continue
        low, high = ends([found])
        curves.append(
            Curve(
                x,
                np.array([found.value]),
                "",
                "measured",
                "points",
                low=low,
                high=high,
                quantity="" if told is None else "sensitivity_threshold",
                conditions={**(told or {}), "parameter": one.parameter},
            )
        )
    places = tuple((float(k), _place(one)) for k, one in enumerate(ordered))
    parameter = Axis("Parameter", limits=(-0.5, len(ordered) - 0.5), places=places)
    beyond = (
        " An arrow goes up where it was not reached, from the change up to which that is sure."
        if any(one.threshold.kind == "at least" for one in ordered)
        else ""
    )
    change = Axis("Change that is too much", "", "percent", limits=(0.0, math.nan))
    yield Figure(
        key="thresholds",
        title=f"How well each parameter has to be known, {method_label(compensation)}",
        caption="The smallest change, up or down, at which the error passes "
        f"{_milliradians(limit.value)}, with its 95 % interval where there is one; the most "
        f"important parameter first.{beyond}",
        alt="A dot for each parameter at the change at which the error passes the threshold, with "
        "its interval, or at the largest change tried where it does not.",
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
        low, high = ends(response.errors)
        change, dots = response.change, response.dots
        curves = [Curve(change, response.error, "mean", "measured", "line", low=low, high=high)]
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
        "parameter, with a dot for every trial and a line at the threshold.",
        panels=tuple(panels),
        thesis=("5.14",),
        across=2,
    )


def _place(one: ResponseVerdict) -> str:
    """A parameter below an axis, with what is not to be taken from its dot."""
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
    """The threshold, and where the error passes it, with its interval."""
    yield Mark(_milliradians(limit.value), y=limit.value)
    found = one.threshold
    if not one.passed or found.origin is Origin.NOT_DETERMINED:
        return
    response = one.response
    # The threshold is a size: it is passed on the side where the error is at the limit there.
    there = np.interp((-found.value, found.value), response.change, response.error)
    sign = -1.0 if abs(there[0] - limit.value) < abs(there[1] - limit.value) else 1.0
    yield Mark("", x=sign * found.value, y=limit.value, point=True, series="fit")
    low, high = found.combined
    if low is not None and high is not None:
        yield Mark("passes here (95 %)", x=sign * low, until=sign * high, series="fit")


def _milliradians(angle: float) -> str:
    return in_words(angle, "rad", "mrad")
