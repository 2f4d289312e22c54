"""Where a pulled load sticks and slips, over two swept numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate
from campaign.experiments.shared.friction_models import ConditionGroup, model_label
from campaign.experiments.shared.swept_words import axis_of, name_of, words
from campaign.options import Options
from campaign.result import Curve, Figure, Panel

Measured = Sequence[tuple[ConditionGroup, Mapping[str, Estimate]]]
"""What the pulls of each place show, by name."""
SHORT = 0.1
"""Of a pull, within which the load must first slip: a load that sticks again does so within twice
that time, and a swing."""
HISTORIES = 8
"""So many pulls are drawn over time; of more with two swept numbers a map is drawn."""


def _kind(found: Mapping[str, Estimate], place: ConditionGroup) -> str:
    if math.isnan(found["rests"].value):
        return "not determined"
    if found["rests"].value > 1.0:
        return "stick-slip"
    early = found["first_slip"].value < SHORT * place.trials[0].trial.task.duration
    return "smooth" if early else "pull too short"


def _counts(measured: Measured) -> str:
    """In how many pulls each model sticks and slips."""
    kinds: dict[str, list[str]] = {}
    for place, found in measured:
        model = str(place.point.get("model", ""))
        kinds.setdefault(model and f" ({model_label(model)})", []).append(_kind(found, place))
    told = (f"{own.count('stick-slip')} of {len(own)} pulls{who}" for who, own in kinds.items())
    return f"Stick-slip in {', '.join(told)}."


def map_of(measured: Measured, options: type[Options]) -> Figure | None:
    """Stick-slip over the two swept numbers with most values; None where there are few pulls.

    Rests in several periods tell stick-slip from a swing that dies out.
    """
    swept: dict[str, set[float]] = {}
    for place, _ in measured:
        for path, value in place.point.items():
            if isinstance(value, int | float) and not isinstance(value, bool):
                swept.setdefault(path, set()).add(value)
    across = sorted((p for p in swept if len(swept[p]) > 1), key=lambda p: -len(swept[p]))[:2]
    if len(measured) <= HISTORIES or len(across) < 2:
        return None
    trial = measured[0][0].trials[0].trial
    x_axis, y_axis = (
        replace(
            axis_of(path, trial, options),
            scale="log" if min(swept[path]) > 0.0 else "linear",
            label=name_of(path.split(".")[-1]),
        )
        for path in across
    )
    panels: dict[str, list[tuple[str, float, float]]] = {}
    for place, found in measured:
        others = {path: value for path, value in place.point.items() if path not in across}
        told = words(others, trial, options, frozenset(others))
        title = ", ".join(reversed(list(told)))
        x, y = (float(str(place.point[path])) for path in across)
        panels.setdefault(title, []).append((_kind(found, place), x, y))
    looks = {
        "stick-slip": "measured",
        "smooth": "alternative",
        "pull too short": "reference",
        "not determined": "none",
    }
    return Figure(
        key="stick-slip",
        title="Where a pulled load sticks and slips",
        caption=f"{_counts(measured)} A mark for each pull: stick-slip where the load rests for "
        "about a fifth of a period in two or more periods in a "
        f"row, up to the last; too short where it first slips after {SHORT:.0%} of the pull.",
        alt="Marks of stick-slip and of smooth sliding over two swept numbers.",
        panels=tuple(
            Panel(
                x_axis,
                y_axis,
                [
                    Curve(
                        np.array([x for own, x, _ in points if own == kind]),
                        np.array([y for own, _, y in points if own == kind]),
                        kind,
                        look,
                        "points",
                    )
                    for kind, look in looks.items()
                    if any(own == kind for own, _, _ in points)
                ],
                title,
            )
            for title, points in panels.items()
        ),
        across=min(3, len(panels)),
        thesis=("2.12",),
    )
