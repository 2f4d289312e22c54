"""Figures of repeated friction-velocity maps and their parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, student
from campaign.estimation.stribeck import SYMBOLS, UNITS
from campaign.experiments.friction_map.curves import Curves
from campaign.experiments.friction_map.figures import OWN_TORQUE, SPEED, point_bars
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.shared.captions import amount, listed
from campaign.result import Array, Axis, Curve, Figure, Panel

ASIDE = 0.1
"""Distance of the dots of a direction from the place of their map, in maps."""
ROUNDING = 1e-9
"""Relative difference of a parameter up to which two directions are equal."""
SHOWN = 6
"""Most maps in one figure: more are indistinguishable."""


@dataclass(frozen=True)
class MapSet:
    """One complete map.

    Attributes:
        name: of its two sets, e.g. "1-2".
        where: its condition, e.g. `bench.variation.day = 1`.
        found: estimates with a free exponent, by direction and parameter.
    """

    name: str
    where: str
    fits: Curves
    found: Mapping[str, Mapping[str, Estimate]]

    def value(self, direction: str, parameter: str) -> float:
        return self.found[direction][parameter].value


def by_map(sets: Sequence[MapSet], parameter: str) -> Array:
    """Values of a parameter, shape (maps, directions)."""
    return np.array([[each.value(name, parameter) for name in DIRECTIONS] for each in sets])


def overlay_figure(sets: Sequence[MapSet], trials: tuple[int, ...]) -> Figure:
    """Figure 4.9: maps on one another, and their differences from the first."""
    shown = list(sets[:SHOWN])
    maps, changes = [], []
    for direction in DIRECTIONS:
        curves = [
            point_bars(each.fits.fits[direction], f"sets {each.name}", f"sets {each.name}")
            for each in shown
        ]
        maps.append(Panel(SPEED, OWN_TORQUE, curves, f"{direction.capitalize()} direction"))
        changes.append(_change_panel(shown, direction))
    count = "first maps" if len(sets) > len(shown) else "maps"
    drift_text = _drifts(shown)
    return Figure(
        key="sets",
        title="Overlaid friction-velocity maps",
        caption=f"The same speeds in {len(shown)} {count}, each direction in its own sign"
        f"{'; below, difference from the first map' if len(shown) > 1 else ''}.{drift_text} "
        "Bars: 95 %, window and scatter between points.",
        alt="Friction torque over speed on a logarithmic axis, one panel per direction, dots of "
        "each map, and the differences of the maps from the first.",
        panels=(*maps, *(changes if len(shown) > 1 else ())),
        thesis=("4.9",),
        across=2,
        one_scale=True,
        trials=trials,
    )


def _change_panel(sets: Sequence[MapSet], direction: str) -> Panel:
    curves = []
    for each in sets[1:]:
        speed, change = _change(sets[0], each, direction)
        curves.append(Curve(speed, change, f"sets {each.name}", f"sets {each.name}", "points"))
    return Panel(SPEED, Axis(f"Less sets {sets[0].name}", "N m", "N m"), curves)


def _change(first: MapSet, other: MapSet, direction: str) -> tuple[Array, Array]:
    """Speeds that both maps have (rad/s), and the differences of friction there (N m)."""
    one, two = first.fits.fits[direction], other.fits.fits[direction]
    _, in_first, in_other = np.intersect1d(one.place, two.place, return_indices=True)
    return two.speed[in_other], two.torque[in_other] - one.torque[in_first]


def _drifts(sets: Sequence[MapSet]) -> str:
    """Differences of friction from the first map, as means and ranges over the speeds, in words."""
    parts = []
    for each in sets[1:]:
        words = []
        for direction in DIRECTIONS:
            _, change = _change(sets[0], each, direction)
            if len(change):
                extremes = (np.min(change), np.max(change))
                ends = [amount(float(end), "N m", digits=2) for end in extremes]
                mean = amount(float(np.mean(change)), "N m", digits=2)
                words.append(f"{mean} ({ends[0]} to {ends[1]}) {direction}")
        if words:
            parts.append(f"sets {each.name} {listed(words)}")
    if not parts:
        return ""
    of_first = f"Difference from sets {sets[0].name}, mean and range over the speeds"
    return f" {of_first}: {'; '.join(parts)}."


def scatter_figure(
    sets: Sequence[MapSet],
    means: Mapping[str, Estimate],
    deviations: Mapping[str, Estimate],
    trials: tuple[int, ...],
) -> Figure:
    """Parameters by map and direction, and the mean of all; `means`, `deviations` by parameter."""
    panels = [_scatter_panel(sets, means[name], deviations[name], name) for name in means]
    return Figure(
        key="scatter",
        title="Scatter of the parameters from map to map",
        caption="Each dot is one direction of one map, with its own 95 % interval; on the right, "
        "the mean of all. The percentages are the standard deviation of all dots, relative to "
        f"their mean.{_apart(sets, means)}",
        alt="One panel for each parameter with a dot for every map and direction, and their mean.",
        panels=tuple(panels),
        across=2,
        trials=trials,
    )


def _scatter_panel(
    sets: Sequence[MapSet], mean: Estimate, deviation: Estimate, parameter: str
) -> Panel:
    symbol, unit = SYMBOLS[parameter], UNITS[parameter]
    last = len(sets) + 1.0
    names = ((k + 1.0, each.name) for k, each in enumerate(sets))
    sets_axis = Axis("Sets", limits=(0.5, last + 0.5), places=(*names, (last, "mean")))
    whole = Curve.of([last], [mean], "mean of all", "measured", quantity=parameter)
    curves = [*_dots(sets, parameter), replace(whole, conditions={"statistic": "mean"})]
    share = f"{100 * deviation.value:.1f} %" if np.isfinite(deviation.value) else "its mean is zero"
    return Panel(sets_axis, Axis(symbol, unit, unit), curves, f"{symbol}: {share}")


def _dots(sets: Sequence[MapSet], parameter: str) -> Iterator[Curve]:
    """One curve per dot, because each dot has its own published number."""
    for direction in DIRECTIONS:
        for place, each in enumerate(sets, start=1):
            estimate, aside = each.found[direction][parameter], ASIDE * DIRECTIONS[direction]
            conditions = {"set": each.name, "direction": direction}
            dot = Curve.of([place], [estimate], f"{direction} direction", direction, aside=aside)
            yield replace(dot, quantity=parameter, conditions=conditions)


def _apart(sets: Sequence[MapSet], means: Mapping[str, Estimate]) -> str:
    """Parameters that differ between the directions: t-tests of the difference in each map.

    Both directions of a map share its day, and their difference is free of it. All parameters
    together are one claim: each test has its share of the error probability (Bonferroni).
    """
    level = 1.0 - (1.0 - LEVEL) / len(means)
    apart = []
    for name in means:
        each = by_map(sets, name)
        if _differs(each[:, 1] - each[:, 0], level, ROUNDING * float(np.max(np.abs(each)))):
            apart.append(SYMBOLS[name])
    if not apart:
        return " No parameter differs between the directions, as far as these maps show."
    sure = f"{100 * LEVEL:.0f} % for all parameters together"
    return f" The directions differ in {listed(apart)} by more than maps scatter ({sure})."


def _differs(values: Array, level: float, spare: float) -> bool:
    """Whether the mean of independent values, shape (n,), is significant and exceeds `spare`."""
    if len(values) < 2 or not np.isfinite(values).all():
        return False
    error = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    return abs(float(np.mean(values))) > max(student(len(values) - 1, level) * error, spare)
