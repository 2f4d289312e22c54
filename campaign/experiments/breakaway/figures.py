"""Figures of a breakaway test."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.axis_kind import is_linear
from campaign.estimate import Estimate
from campaign.estimation.presliding import Presliding
from campaign.estimation.presliding_curve import presliding_torque
from campaign.experiments.breakaway.means import OF_A_RAMP, Ramps
from campaign.experiments.shared.captions import amount, sentence, setting, trials_of
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel, Value

TORQUE = Axis("Drive torque", "N m", "N m")
NAMED = 12
"""Largest number of labeled positions at the axis."""
CHANCE = 0.05
"""Largest probability of a false difference between ramps, over all quantities."""
ASIDE = 0.07
"""Offset of the dots of a direction from their position, in position steps."""
DOTS, SMOOTH = 45, 400
"""Dots of a measured curve, and number of averages along which its length is measured."""


def ramp_figure(
    samples: tuple[Array, Array, Array],
    found: Presliding,
    breakaway: float,
    place: Mapping[str, Value],
    trials: tuple[int, ...],
) -> Figure:
    """One ramp. samples: time (s), rate (rad/s) and torque (N m), each (n,), of a rising ramp."""
    time, rate, torque = samples
    axis = Axis("Time", "s", "s")
    low, high = found.window
    return Figure(
        key="ramp",
        title="Breakaway: torque ramp, motion, and the presliding curve",
        caption=f"One ramp, {_where(place)}. The torque rises until the load slides, at "
        f"{amount(breakaway, 'N m')}. {_gives(found)} The angle is the gyro's rate, integrated "
        "without its bias: it drifts with the rate's noise. Dots: some of the samples, evenly "
        "along their curve; last, all of them less the fitted curve.",
        alt="Drive torque and rate over time, drive torque over angle with the fitted "
        "presliding curve and its initial slopes, and what the two differ by.",
        panels=(
            Panel(
                axis,
                TORQUE,
                [Curve(time, torque, "measured", "measured")],
                marks=(Mark("breakaway", y=breakaway),),
            ),
            Panel(
                axis,
                Axis("Rate", "rad/s", "deg/s"),
                [Curve(time, rate, "measured", "measured")],
            ),
            Panel(
                Axis("Angle from the start", "rad", "mrad"),
                TORQUE,
                _curves(samples, found, breakaway),
                marks=(Mark("breakaway", y=breakaway), Mark("fitted here", y=low, until=high)),
            ),
            _residual_panel(samples, found, breakaway),
        ),
        thesis=("4.13",),
        across=2,
        trials=trials,
    )


def _where(place: Mapping[str, Value]) -> str:
    position = place.get("position")
    angle = isinstance(position, int | float) and setting(float(position), "rad", "deg")
    return f"{place.get('direction')} direction{f' at {angle}' if angle else ''}"


def _gives(found: Presliding) -> str:
    """Sentence on the deflection before sliding, for the number of interfaces of the curve."""
    before = "Before that the load already gives, elastically"
    if len(found.interfaces) < 2:
        return f"{before}: the lower curve begins with the stiffness σ0."
    count = len(found.interfaces)
    every = "both" if count == 2 else f"all {count}"
    return (
        f"{before}: the lower curve begins with the stiffness of {every} interfaces together and "
        "goes on, once the weaker ones slip, with that of the strongest."
    )


def _curves(
    samples: tuple[Array, Array, Array], found: Presliding, breakaway: float
) -> list[Curve]:
    angle, torque = _presliding(samples, found, breakaway)
    top = float(np.max(angle, initial=0.0))
    fine = np.linspace(0.0, max(top, 0.0), 400)
    first = found.interfaces[0]
    tail = sum(each.torque for each in found.interfaces[1:])
    reach = fine[fine <= breakaway / first.stiffness]
    curves = [
        _some(angle, torque),
        Curve(fine, presliding_torque(fine, found.interfaces), "fitted curve", "fit"),
        Curve(
            reach,
            tail + first.stiffness * reach,
            f"σ0 = {amount(first.stiffness, 'N m/rad', 'N m/mrad')}",
            "reference",
            "thin",
        ),
    ]
    if len(found.interfaces) > 1:
        at_rest = found.stiffness_at_rest.value
        steep = fine[fine <= 1.3 * (tail + first.stiffness * top * 0.02) / at_rest]
        label = f"at rest: {amount(at_rest, 'N m/rad', 'N m/mrad')}"
        curves.append(Curve(steep, at_rest * steep, label, "alternative"))
    return curves


def _presliding(
    samples: tuple[Array, Array, Array], found: Presliding, breakaway: float
) -> tuple[Array, Array]:
    """Angle (rad) and torque (N m) of a ramp until shortly beyond its breakaway, each (n,)."""
    time, rate, torque = samples
    interval = float(np.ptp(time)) / (len(time) - 1)
    angle = np.cumsum(rate - found.bias) * interval
    shown = torque <= 1.02 * breakaway
    return (angle[shown], torque[shown]) if shown.any() else (angle, torque)


def _some(angle: Array, torque: Array) -> Curve:
    """Samples evenly spaced along the drawn curve: a line of all would hide under the fit."""
    known = np.isfinite(angle) & np.isfinite(torque)
    x, y = angle[known], torque[known]
    # Noise would add length: averages of a few samples have less.
    size = max(1, len(x) // SMOOTH)
    kernel = np.full(size, 1.0 / size)
    rough = [np.convolve(each, kernel, mode="valid") / (np.ptp(each) or 1.0) for each in (x, y)]
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*(np.diff(each) for each in rough)))])
    places = np.searchsorted(length, np.linspace(0.0, length[-1], DOTS)) + size // 2
    places = np.unique(np.minimum(places, len(x) - 1))
    return Curve(x[places], y[places], "measured", "measured", "points")


def _residual_panel(
    samples: tuple[Array, Array, Array], found: Presliding, breakaway: float
) -> Panel:
    """The measured torque less the fitted curve, over the angle."""
    angle, torque = _presliding(samples, found, breakaway)
    away = torque - presliding_torque(angle, found.interfaces)
    level = np.array([0.0, float(np.nanmax(angle, initial=0.0))])
    return Panel(
        Axis("Angle from the start", "rad", "mrad"),
        Axis("Measured less fitted", "N m", "N m"),
        [
            Curve(angle, away, "measured", "measured", "thin"),
            Curve(level, np.zeros(2), "fitted curve", "fit"),
        ],
    )


def position_figure(ramps: Ramps, means: Mapping[str, Mapping[str, Estimate]]) -> Figure:
    """Breakaway torque and stiffness over position, with intervals of the ramps, and means."""
    shown = {"breakaway_torque": "breakaway torque", "bristle_stiffness": "bristle stiffness"}
    sentences = [_what_shows(ramps.values(name), word, len(shown)) for name, word in shown.items()]
    whole = next(iter(means.values()))  # of both directions, where there are two
    axes = (Axis("Breakaway torque", "N m", "N m"), Axis("σ0", "N m/rad", "N m/mrad"))
    panels = [
        Panel(_positions(ramps), axis, [*_dots(ramps, name), *_mean(ramps, whole, name)])
        for name, axis in zip(shown, axes, strict=True)
    ]
    return Figure(
        key="positions",
        title="Breakaway torque and bristle stiffness over position",
        caption=f"{' '.join(filter(None, sentences))} {_bars(ramps)}",
        alt="Breakaway torque and bristle stiffness, one dot with a bar per ramp, and their mean.",
        panels=tuple(panels),
        across=2,
        trials=trials_of(ramps.trials),
    )


def _bars(ramps: Ramps) -> str:
    """Sentence on the bars of single ramps, which may be narrower than intervals of the table."""
    own = "Bars are the 95 % intervals of each ramp alone"
    every = (estimate for each in ramps.found for estimate in each.values())
    if not any(each.has_interval and each.combined != (each.low, each.high) for each in every):
        return f"{own}."
    return (
        f"{own}: compare ramps by these. The bar of the mean and the intervals of the table are "
        "wider: they include the uncertainty of the bench's constants, common to all ramps."
    )


def _what_shows(found: Sequence[Estimate], word: str, tests: int) -> str:
    """Sentence on whether ramps differ by more than their own intervals: a chi-square test.

    tests: number of such tests; each has its share of `CHANCE` (Bonferroni).
    """
    from scipy.stats import chi2

    known = [each for each in found if each.standard_error]
    if len(known) < 2:
        return ""
    values = np.array([each.value for each in known])
    weights = np.array([each.standard_error or np.nan for each in known]) ** -2.0
    spread = float(np.sum(weights * (values - np.average(values, weights=weights)) ** 2))
    if spread <= float(chi2.ppf(1.0 - CHANCE / tests, len(known) - 1)):
        return sentence(f"{word}: the ramps show no difference beyond their own intervals")
    unit = known[0].unit
    ends = [amount(float(end), unit, digits=4) for end in (values.min(), values.max())]
    return sentence(
        f"{word}: ramps differ by more than their own intervals, from {ends[0]} to {ends[1]}"
    )


def _angles(ramps: Ramps) -> list[float]:
    return sorted({float(str(place["position"])) for place in ramps.places})


def _pitch(angles: Sequence[float]) -> float:
    """Mean distance of positions (rad), 1 deg at least."""
    return max((angles[-1] - angles[0]) / max(len(angles) - 1, 1), math.radians(1.0))


def _behind(angles: Sequence[float]) -> float:
    """Abscissa of the mean: one step right of the last position."""
    return angles[-1] + _pitch(angles)


def _positions(ramps: Ramps) -> Axis:
    angles = _angles(ramps)
    step = -(-len(angles) // NAMED)
    # Two panels share the width: label every other angle at most.
    step = max(step, 2) if len(angles) > NAMED // 2 else step
    names = tuple((angle, _place(angle)) for angle in angles[::step])
    return Axis("Position", "rad", "rad", places=(*names, (_behind(angles), "mean")))


def _place(position: float) -> str:
    if is_linear():
        return setting(position, "rad", "deg")
    return f"{np.rad2deg(position):.4g}°".replace("-", "−")


def _mean(ramps: Ramps, means: Mapping[str, Estimate], quantity: str) -> Iterator[Curve]:
    if quantity in means:
        shared = {k: v for k, v in ramps.places[0].items() if k not in OF_A_RAMP}
        yield Curve.of(
            [_behind(_angles(ramps))], [means[quantity]], "mean of all", "measured",
            quantity=quantity, conditions={**shared, "statistic": "mean"},
        )  # fmt: skip


def _dots(ramps: Ramps, quantity: str) -> list[Curve]:
    curves = []
    several = len(ramps.directions) > 1
    aside = ASIDE * _pitch(_angles(ramps)) if several else 0.0
    for direction in ramps.directions:
        # Their own intervals: the bar of the mean includes the common uncertainty.
        shown = {
            float(str(place["position"])): replace(own[quantity], systematic=(), kind="number")
            for place, own in zip(ramps.places, ramps.found, strict=True)
            if quantity in own and place["direction"] == direction
        }
        if shown:
            offset = aside if direction == "positive" else -aside
            estimates = list(shown.values())
            curves.append(
                Curve.of(list(shown), estimates, f"{direction} direction", direction, aside=offset)
            )
    return curves
