"""Figures of the observer-gain study: measured dots on theory lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from campaign.experiments.observer_gain.metrics import Gain
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel

CORNER = Axis("Corner frequency N K0 / (2π J')", "Hz", "Hz", scale="log")
BEYOND = 2.0
"""Limit of stability up to which it is drawn, in multiples of the highest gain."""
SHOWN_GAINS = 4
"""Curves in the figure of rejection, including the one without observer."""


def _pairs(gains: Sequence[Gain], name: str) -> tuple[Array, list[Any]]:
    """Corner frequencies and results of stable gains with an observer and this result."""
    stable = [(g.corner, getattr(g, name)) for g in gains if g.corner and not g.unstable]
    known = [(corner, value) for corner, value in stable if value is not None]
    return np.array([corner for corner, _ in known]), [value for _, value in known]


def _marks(gains: Sequence[Gain], own: float, limit: float | None, name: str) -> list[Mark]:
    """Marks of the bench's own gain, of instability, and of the quantity without observer.

    limit: of stability by the eigenvalues (Hz); None if stable. name: of the quantity.
    """
    marks = [Mark("the bench's", x=own)]
    unstable = next((gain.corner for gain in gains if gain.unstable), None)
    highest = max((gain.corner for gain in gains), default=0.0)
    if unstable is not None:
        below = [gain.corner for gain in gains if 0 < gain.corner < unstable]
        if below:
            marks.append(Mark("becomes unstable", x=max(below), until=unstable))
        else:
            marks.append(Mark("unstable", x=unstable))
    if limit is not None and limit <= BEYOND * highest:
        marks.append(Mark("unstable by eigenvalues", x=limit))
    without = next((getattr(gain, name) for gain in gains if gain.corner == 0), None)
    return marks if without is None else [*marks, Mark("without observer", y=without.value)]


def _stability_words(gains: Sequence[Gain]) -> str:
    """Caption sentence on the shaded range, or on stability at every gain."""
    if any(gain.unstable for gain in gains):
        return " Shaded: between the highest gain that was stable and the lowest that was not."
    highest = max((gain.corner for gain in gains), default=0.0)
    return f" The loop is stable at every gain that was tried, up to {highest:.3g} Hz."


def error_figure(gains: Sequence[Gain], own: float, limit: float | None) -> Iterator[Figure]:
    """Stabilization error over the gain."""
    x, y = _pairs(gains, "error")
    if not len(x):
        return
    curves = [Curve.of(x, y, "measured", "measured")]
    theory_x, theory_y = _pairs(gains, "error_theory")
    line = ""
    if len(theory_x):
        line = " The line is what Equation 5.4 makes of the friction recorded in the same trial."
        label = "Equation 5.4, of the friction that acted"
        curves.insert(0, Curve(theory_x, np.array([e.value for e in theory_y]), label, "fit"))
    error = Axis("Stabilization error (1σ)", "rad", "mrad", scale="log")
    yield Figure(
        key="error",
        title="Stabilization error over the gain of the observer",
        caption="Error over the gain, with its 95 % interval where it is wide enough to be seen."
        f"{line}{_stability_words(gains)}",
        alt="Stabilization error over the observer's corner frequency, both logarithmic: falling "
        "dots beside a line of theory.",
        panels=(Panel(CORNER, error, curves, marks=_marks(gains, own, limit, "error")),),
    )


def noise_figure(gains: Sequence[Gain], own: float, limit: float | None) -> Iterator[Figure]:
    """True rate of the load that the gyro's noise causes, over the gain."""
    x, y = _pairs(gains, "noise")
    if not len(x):
        return
    theory_x, theory_y = _pairs(gains, "noise_theory")
    curves = [
        Curve(theory_x, np.array(theory_y, dtype=float), "Equation 5.5", "fit"),
        Curve.of(x, y, "measured", "measured"),
    ]
    rate = Axis("Rate of the load from noise (1σ)", "rad/s", "mrad/s", scale="log")
    yield Figure(
        key="noise",
        title="Gyro noise that reaches the load, over the gain of the observer",
        caption="The observer differentiates the gyro, so more gain lets more noise through. "
        "Equation 5.5 has no delay: the dots leave its line where delays make the loop less stable."
        + _stability_words(gains),
        alt="Standard deviation of the load's rate due to gyro noise over the observer's corner "
        "frequency, rising, beside the line of Equation 5.5.",
        panels=(Panel(CORNER, rate, curves, marks=_marks(gains, own, limit, "noise")),),
    )


def rejection_figure(gains: Sequence[Gain], own: float) -> Iterator[Figure]:
    """Rate per disturbance torque over its frequency, for a few gains."""
    usable = [gain for gain in gains if gain.rejection and not gain.unstable]
    if not usable:
        return
    curves = []
    for gain in _spread(usable, own):
        label = f"corner {gain.corner:.3g} Hz" if gain.corner else "no observer"
        series = label if gain.corner else "none"
        frequency = np.array([point.frequency for point in gain.rejection])
        expected = np.array([point.expected for point in gain.rejection])
        measured = [point.measured for point in gain.rejection]
        curves.append(Curve(frequency, expected, label, series))
        curves.append(Curve.of(frequency, measured, "", series))
    x = Axis("Frequency of the disturbance", "Hz", "Hz", scale="log")
    y = Axis("|ω/T|", "rad/s/(N m)", "mrad/s/(N m)", scale="log")
    yield Figure(
        key="rejection",
        title="Disturbance rejection for several gains of the observer",
        caption="Rate of the load per disturbance torque: dots measured, lines Equation 5.4 with "
        "the bench's PI controller. Below its corner frequency the observer gains a decade per "
        "decade over the loop without it. Delays, which the equation leaves out, show at high "
        "gains.",
        alt="Rate per torque over frequency, both logarithmic, one line with dots on it for each "
        "gain; higher gains lie lower.",
        panels=(Panel(x, y, curves),),
    )


def _spread(gains: Sequence[Gain], own: float) -> list[Gain]:
    """Gains for a figure: without observer, the bench's own, and some at even spacing."""
    with_observer = [gain for gain in gains if gain.corner]
    picks = np.unique(np.linspace(0, len(with_observer) - 1, SHOWN_GAINS - 1).round().astype(int))
    chosen = [with_observer[i] for i in picks] if with_observer else []
    own_gains = [g for g in with_observer if np.isclose(g.corner, own) and g not in chosen]
    plain = [gain for gain in gains if not gain.corner]
    return plain + sorted(chosen + own_gains[:1], key=lambda gain: gain.corner)
