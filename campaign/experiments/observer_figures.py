"""Figures of the observer-gain study: measured dots on theory lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np

from campaign.result import Array, Axis, Curve, Figure, Mark, Panel

CORNER = Axis("Corner frequency N K0 / (2π J')", "Hz", "Hz", scale="log")
SHOWN_GAINS = 4
"""curves in the figure of rejection, the one without observer among them."""


class GainLike(Protocol):
    """What a figure needs of one gain; see `observer_gain.Gain`."""

    @property
    def corner(self) -> float: ...
    @property
    def error(self) -> float | None: ...
    @property
    def error_theory(self) -> float | None: ...
    @property
    def noise(self) -> float | None: ...
    @property
    def noise_theory(self) -> float | None: ...
    @property
    def rejection(self) -> Array: ...
    @property
    def unstable(self) -> str: ...


def _pairs(gains: Sequence[GainLike], name: str) -> tuple[Array, Array]:
    """Corner frequency and a value, of stable gains with an observer that have it."""
    found = [(g.corner, getattr(g, name)) for g in gains if g.corner and not g.unstable]
    found = [(corner, value) for corner, value in found if value is not None]
    array = np.array(found, dtype=float).reshape(-1, 2)
    return array[:, 0], array[:, 1]


def _marks(gains: Sequence[GainLike], own: float) -> list[Mark]:
    marks = [Mark("the bench's", x=own)]
    unstable = next((gain.corner for gain in gains if gain.unstable), None)
    return marks if unstable is None else [*marks, Mark("unstable", x=unstable)]


def _without(gains: Sequence[GainLike], name: str) -> list[Mark]:
    value = next((getattr(gain, name) for gain in gains if gain.corner == 0), None)
    return [] if value is None else [Mark("without observer", y=value)]


def error_figure(gains: Sequence[GainLike], own: float) -> Iterator[Figure]:
    """Stabilization error over the gain."""
    x, y = _pairs(gains, "error")
    if not len(x):
        return
    curves = [Curve(x, y, "measured", "measured", "points")]
    theory_x, theory_y = _pairs(gains, "error_theory")
    if len(theory_x):
        label = "Equation 5.4, of the friction that acted"
        curves.insert(0, Curve(theory_x, theory_y, label, "fit"))
    error = Axis("Stabilization error (1σ)", "rad", "mrad", scale="log")
    yield Figure(
        key="error",
        title="Stabilization error over the gain of the observer",
        caption="More gain, less error, until the loop oscillates. The line is what Equation 5.4 "
        "makes of the friction torque recorded in the same trial.",
        alt="Stabilization error over the observer's corner frequency, both logarithmic: falling "
        "dots beside a line of theory.",
        panels=(Panel(CORNER, error, curves, marks=_marks(gains, own) + _without(gains, "error")),),
    )


def noise_figure(gains: Sequence[GainLike], own: float) -> Iterator[Figure]:
    """True rate of the load that the gyro's noise causes, over the gain."""
    x, y = _pairs(gains, "noise")
    if not len(x):
        return
    theory_x, theory_y = _pairs(gains, "noise_theory")
    curves = [
        Curve(theory_x, theory_y, "Equation 5.5", "fit"),
        Curve(x, y, "measured", "measured", "points"),
    ]
    rate = Axis("Rate of the load from noise (1σ)", "rad/s", "mrad/s", scale="log")
    yield Figure(
        key="noise",
        title="Gyro noise that reaches the load, over the gain of the observer",
        caption="The observer differentiates the gyro, so more gain lets more noise through. "
        "Equation 5.5 knows no delay: where the dots leave its line the loop runs out of phase.",
        alt="Standard deviation of the load's rate due to gyro noise over the observer's corner "
        "frequency, rising, beside the line of Equation 5.5.",
        panels=(Panel(CORNER, rate, curves, marks=_marks(gains, own) + _without(gains, "noise")),),
    )


def rejection_figure(gains: Sequence[GainLike], own: float) -> Iterator[Figure]:
    """Rate per disturbance torque over its frequency, for a few gains."""
    usable = [gain for gain in gains if len(gain.rejection) and not gain.unstable]
    if not usable:
        return
    curves = []
    for gain in _spread(usable, own):
        if not gain.corner:
            label, series = "no observer", "none"
        else:
            label = f"corner {gain.corner:.3g} Hz"
            series = label
        frequency, measured, expected = gain.rejection.T
        curves.append(Curve(frequency, expected, label, series))
        curves.append(Curve(frequency, measured, "", series, "points"))
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


def _spread(gains: Sequence[GainLike], own: float) -> list[GainLike]:
    """A few gains: the one without observer, the bench's own, and some evenly between."""
    with_observer = [gain for gain in gains if gain.corner]
    picks = np.unique(np.linspace(0, len(with_observer) - 1, SHOWN_GAINS - 1).round().astype(int))
    chosen = [with_observer[i] for i in picks] if with_observer else []
    mine = [g for g in with_observer if np.isclose(g.corner, own) and g not in chosen]
    plain = [gain for gain in gains if not gain.corner]
    return plain + sorted(chosen + mine[:1], key=lambda gain: gain.corner)
