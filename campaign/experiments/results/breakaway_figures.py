"""Figures of a breakaway test."""

from __future__ import annotations

import numpy as np

from campaign.estimate import Estimate
from campaign.experiments.results.breakaway_means import Ramps
from campaign.identification.presliding import Presliding
from campaign.identification.presliding_curve import presliding_torque
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel

TORQUE = Axis("Drive torque", "N m", "N m")
SERIES = {"positive": "measured", "negative": "alternative"}


def ramp_figure(
    samples: tuple[Array, Array, Array], found: Presliding, breakaway: float, suffix: str
) -> Figure:
    """One ramp: time (s), rate (rad/s) and torque (N m), each (n,), to the positive side."""
    time, rate, torque = samples
    axis = Axis("Time", "s", "s")
    return Figure(
        key=f"ramp{suffix}",
        title="Breakaway: torque ramp, motion, and the presliding curve",
        caption="The torque rises until the load slides. Before that it already gives, "
        "elastically: the lower curve begins with the stiffness of all interfaces together and "
        "goes on, once the weaker ones slip, with that of the strongest. The angle is the gyro's "
        "rate, integrated without its bias: it drifts with the rate's noise.",
        alt="Drive torque and rate over time, and drive torque over angle with the fitted "
        "presliding curve and its initial slopes.",
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
                marks=(Mark("end of the fit", y=found.window[1]),),
            ),
        ),
        thesis=("4.13",),
    )


def _curves(
    samples: tuple[Array, Array, Array], found: Presliding, breakaway: float
) -> list[Curve]:
    time, rate, torque = samples
    interval = float(np.ptp(time)) / (len(time) - 1)
    angle = np.cumsum(rate - found.bias) * interval
    shown = torque <= 1.02 * breakaway
    top = float(np.max(angle[shown])) if shown.any() else float(angle.max())
    fine = np.linspace(0.0, max(top, 0.0), 400)
    first = found.interfaces[0]
    tail = sum(each.torque for each in found.interfaces[1:])
    reach = fine[fine <= breakaway / first.stiffness]
    curves = [
        Curve(angle[shown], torque[shown], "measured", "measured"),
        Curve(fine, presliding_torque(fine, found.interfaces), "fitted curve", "fit"),
        Curve(
            reach,
            tail + first.stiffness * reach,
            f"σ0 = {first.stiffness:,.0f} N m/rad",
            "reference",
            "thin",
        ),
    ]
    if len(found.interfaces) > 1:
        at_rest = found.stiffness_at_rest.value
        steep = fine[fine <= 1.3 * (tail + first.stiffness * top * 0.02) / at_rest]
        label = f"at rest: {at_rest:,.0f} N m/rad"
        curves.append(Curve(steep, at_rest * steep, label, "alternative"))
    return curves


def position_figure(ramps: Ramps, suffix: str) -> Figure:
    """Breakaway torque and stiffness over position, with the interval of each ramp."""
    axis = Axis("Position", "rad", "deg")
    return Figure(
        key=f"positions{suffix}",
        title="Breakaway torque and bristle stiffness over position",
        caption="A real axis differs from place to place; a simulated one only as far as its bench "
        "says so. Bars are the 95 % intervals of each ramp.",
        alt="Breakaway torque and bristle stiffness, one dot with a bar per ramp.",
        panels=(
            Panel(
                axis,
                Axis("Breakaway torque", "N m", "N m"),
                _dots(ramps, "breakaway_torque"),
            ),
            Panel(axis, Axis("σ0", "N m/rad", "N m/mrad"), _dots(ramps, "bristle_stiffness")),
        ),
        across=2,
    )


def _dots(ramps: Ramps, quantity: str) -> list[Curve]:
    curves = []
    for direction in ramps.directions:
        shown = [
            (float(str(place["position"])), own[quantity])
            for place, own in zip(ramps.places, ramps.found, strict=True)
            if quantity in own and place["direction"] == direction
        ]
        if not shown:
            continue
        ends = np.array([_ends(estimate) for _, estimate in shown])
        curves.append(
            Curve(
                np.array([position for position, _ in shown]),
                np.array([estimate.value for _, estimate in shown]),
                "measured" if len(ramps.directions) == 1 else direction,
                SERIES[direction],
                "points",
                low=ends[:, 0],
                high=ends[:, 1],
            )
        )
    return curves


def _ends(estimate: Estimate) -> tuple[float, float]:
    low, high = estimate.low, estimate.high
    return np.nan if low is None else low, np.nan if high is None else high
