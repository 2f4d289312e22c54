"""Figures of a friction-velocity map."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from campaign.channels import COMMAND, DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Estimate
from campaign.estimation.intervals import student
from campaign.estimation.stribeck import UNITS, stribeck
from campaign.estimation.velocity_map import DirectionFit, Model, band
from campaign.experiments.friction_map.curves import FRICTION, Curves
from campaign.experiments.friction_map.points import Point
from campaign.experiments.friction_map.runs import DIRECTIONS, speed_of, windows_of
from campaign.experiments.friction_map.tables import MODEL_LABELS, fitted_torque
from campaign.experiments.interface import TestData, with_samples
from campaign.experiments.shared.captions import amount, listed, sentence, setting, surely_above
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel
from campaign.text import count

RATE = Axis("Rate", "rad/s", "deg/s")
TORQUE = Axis("Friction torque", "N m", "N m")
SPEED = Axis("Speed", "rad/s", "deg/s", scale="log")
OWN_TORQUE = Axis("Friction, in its direction", "N m", "N m")
LEVEL = 1e-3
"""Smallest visible change, relative to the largest friction."""
TALLEST, HEADROOM = 1.7, 1.4
"""Over the mean torque: a start peak above the first is cut off, at the second."""
FINE = 160
"""Points of a fitted curve."""


def map_figure(fits: Curves, where: str, trials: tuple[int, ...]) -> Figure:
    """Both directions: points and fits with their intervals, over rate and over its logarithm."""
    whole: list[Curve] = []
    own: dict[str, list[Curve]] = {}
    for name in reversed(DIRECTIONS):
        bars = point_bars(fits.fits[name], f"{name} direction", name)
        whole.append(_points(fits, name, partial(fitted_torque, curves=fits)))
        whole.append(_fitted(fits, name, name, sign=DIRECTIONS[name]))
        own[name] = [bars, _law(_fitted(fits, name, name), name)]
    marks = _least_marks(fits)
    return Figure(
        key="map",
        title=f"Friction-velocity map{f' ({where})' if where else ''}",
        caption=f"{_what_shows(fits)} (a) Both directions with their signs, (b) each in its "
        "own sign over the logarithm of speed. Lines: Equation 4.6 fitted with δ "
        "free, with its 95 % band. Bars: 95 %, window and scatter between points.",
        alt="Friction torque over rate for both directions, one dot per constant-velocity run, and "
        "the fitted curves; over all rates, and over the logarithm of speed.",
        panels=(
            Panel(RATE, TORQUE, whole, "All rates"),
            Panel(
                SPEED,
                OWN_TORQUE,
                [curve for curves in own.values() for curve in curves],
                "Each direction",
                [mark for name in own for mark in marks[name]],
            ),
        ),
        thesis=("4.9",),
        trials=trials,
    )


def _points(curves: Curves, name: str, read: Callable[[Point], Estimate]) -> Curve:
    """Measured points of a direction, signed."""
    own = [point for point in curves.points if point.sign == DIRECTIONS[name]]
    own.sort(key=lambda point: point.rate.value)
    rate = np.array([point.rate.value for point in own])
    return Curve.of(rate, [read(point) for point in own], f"{name} direction", name)


def point_bars(fit: DirectionFit, label: str, series: str) -> Curve:
    """Points of one direction as used in the fit, with their 95 % intervals."""
    half = student(fit.freedom) * fit.deviation
    low, high = fit.torque - half, fit.torque + half
    return Curve(fit.speed, fit.torque, label, series, "points", low=low, high=high)


def _fitted(
    curves: Curves,
    name: str,
    series: str,
    label: str = "",
    model: Model | None = "free",
    sign: float = 1.0,
) -> Curve:
    """Fitted curve of a direction, with its band; sign: -1 shows it at negative rates."""
    own = [abs(p.rate.value) for p in curves.points if p.sign == DIRECTIONS[name]]
    fine = np.geomspace(min(own), max(own), FINE)
    y, low, high = (sign * each for each in curves.curve(name, fine, model))
    return _in_order(Curve(sign * fine, y, label, series, low=low, high=high))


def _in_order(curve: Curve) -> Curve:
    """The curve with the lower ends of its intervals below the upper ones."""
    ends = np.sort(np.array([curve.low, curve.high]), axis=0)
    return replace(curve, low=ends[0], high=ends[1])


def _law(curve: Curve, direction: str) -> Curve:
    """A fitted curve with its law, for comparison with published parameters of its direction."""
    return replace(curve, conditions={"direction": direction}, law=stribeck, parameters=UNITS)


def falls(fit: DirectionFit) -> bool:
    """Whether friction falls with rising speed by more than the scatter."""
    values = fit.fits["free"].values
    return fit.shows_stribeck_effect and values["static_torque"] > values["coulomb_torque"]


def _least(fit: DirectionFit) -> tuple[float, float] | None:
    """Speed (rad/s) and torque (N m) of the least fitted friction; None at an end."""
    fine = np.geomspace(fit.speed.min(), fit.speed.max(), FINE)
    torque = stribeck(fine, fit.fits["free"].values)
    at = int(np.argmin(torque))
    return (float(fine[at]), float(torque[at])) if 0 < at < FINE - 1 else None


def _least_marks(fits: Curves) -> dict[str, list[Mark]]:
    """Mark of the least friction of each direction, if friction falls."""
    marks: dict[str, list[Mark]] = {name: [] for name in fits.fits}
    for name, fit in fits.fits.items():
        least = _least(fit) if falls(fit) else None
        if least is not None:
            speed, torque = least
            label = f"{amount(torque, 'N m')} at {amount(speed, 'rad/s', 'deg/s', 2)}"
            marks[name].append(Mark(label, x=speed, y=torque, point=True, series=name))
    return marks


def _what_shows(fits: Curves) -> str:
    """What the fits of this map show at low and at high speed, in words."""
    fall = [name for name, fit in fits.fits.items() if falls(fit)]
    rise = [name for name in fits.fits if _rises(fits, name)]
    effect = "friction falls as sliding becomes faster (Stribeck effect)"
    viscous = "rises with viscous friction"
    if not fall:
        first = "no Stribeck effect shows: friction does not fall as sliding becomes faster"
        both = f"; it {viscous}{_of(rise, fits)}" if rise else ""
        return sentence(first + both)
    if rise == fall:
        return sentence(f"{effect} and then {viscous}{_of(fall, fits)}")
    second = f" It {viscous}{_of(rise, fits)}." if rise else ""
    return sentence(f"{effect}{_of(fall, fits)}") + second


def _of(names: list[str], fits: Curves) -> str:
    """Directions that a sentence is about, in words; empty for all."""
    return "" if len(names) == len(fits.fits) else f" in the {listed(names)} direction"


def _rises(fits: Curves, name: str) -> bool:
    """Whether friction rises with speed by more than the scatter, and visibly."""
    fit = fits.fits[name]
    seen = LEVEL * float(fit.torque.max()) / float(fit.speed.max())
    return surely_above(fits.estimates("free")[name]["viscous_friction"], 0.0, seen)


def fit_figure(fits: Curves, where: str, trials: tuple[int, ...]) -> Figure:
    """Points and fitted curves of each direction over the logarithm of speed, and residuals."""
    curves, residuals = [], []
    for name, fit in fits.fits.items():
        exponent = fit.fits["free"].values["stribeck_exponent"]
        free = _fitted(fits, name, "fit", "fitted, δ free")
        fixed = _fitted(fits, name, "alternative", "fitted, δ = 2", "2")
        fixed = replace(fixed, low=None, high=None)
        shown = [point_bars(fit, f"{name} direction", name), _law(free, name), fixed]
        curves.append(
            Panel(SPEED, OWN_TORQUE, shown, f"{name.capitalize()} direction, δ = {exponent:.3g}")
        )
        residuals.append(_residual_panel(fit, name))
    return Figure(
        key="fit",
        title=f"Stribeck curve fitted to the map{f' ({where})' if where else ''}",
        caption="Equation 4.6 fitted by least squares, (a, b) with δ free and with δ = 2; (c, d) "
        "residuals of the fit with δ free, on a scale of their own. "
        f"{_misfit(fits.fits)} The logarithmic axis shows the low speeds that decide Ts and vs. "
        "Bars and band: 95 %.",
        alt="Measured friction torque over speed on a logarithmic axis with both fitted curves, "
        "one panel per direction, and the residuals below.",
        panels=(*curves, *residuals),
        thesis=("4.11",),
        across=2,
        one_scale=True,
        trials=trials,
    )


def _residual_panel(fit: DirectionFit, name: str) -> Panel:
    fine = np.geomspace(fit.speed.min(), fit.speed.max(), FINE)
    wide = band(fit, "free", fine)
    points = point_bars(fit, f"{name} direction", name)
    assert points.low is not None  # noqa: S101 (for the type checker)
    assert points.high is not None  # noqa: S101
    at = stribeck(fit.speed, fit.fits["free"].values)
    low, high = points.low - at, points.high - at
    zero = Curve(fine, np.zeros(FINE), "fitted, δ free", "fit", low=-wide, high=wide)
    curves = [
        Curve(points.x, points.y - at, points.label, name, "points", low=low, high=high),
        replace(_law(zero, name), law=partial(_difference, less=fit.fits["free"].values)),
    ]
    return Panel(SPEED, Axis("Difference from the fit", "N m", "N m"), curves)


def _difference(speed: Array, values: Mapping[str, float], less: Mapping[str, float]) -> Array:
    """Friction torque (N m) of one set of parameters minus that of another, shape (n,)."""
    return stribeck(speed, values) - stribeck(speed, less)


def _misfit(fits: Mapping[str, DirectionFit]) -> str:
    """Misfit of δ = 2 relative to δ free, by direction, and the model of lowest BIC, in words."""
    words = [
        f"{fit.misfit:.2g} times ({name} direction; lowest BIC: {MODEL_LABELS[fit.preferred]})"
        for name, fit in fits.items()
    ]
    start = "over their own deviations, the residuals with δ = 2 are"
    return sentence(f"{start} {listed(words)} those with δ free")


def rate_figure(curves: Curves) -> Figure:
    """One quantity over rate."""
    what = curves.quantity.axis[0]
    return Figure(
        key="map" if curves.quantity is FRICTION else "coefficient",
        title=f"{what} over rate",
        caption=rate_caption(curves),
        alt=f"{what} over rate in both directions: a dot for each point, and curves.",
        panels=rate_panels(curves),
        across=2,
        trials=tuple(sorted({point.trial for point in curves.points})),
    )


def rate_caption(curves: Curves) -> str:
    """Caption of `rate_panels`."""
    runs = any(point.commanded is not None for point in curves.points)
    one, several = ("run", "runs") if runs else ("steady stretch", "steady stretches")
    fitted = "Lines: what was fitted to each direction, with its 95 % band; "
    return (
        f"Mean {curves.quantity.axis[0].lower()} of {count(len(curves.points), one, several)} over "
        f"the mean rate. {fitted if curves.fits or curves.lines else ''}bars: "
        f"95 % of each {one} alone, without what differs between them."
    )


def rate_panels(curves: Curves) -> tuple[Panel, ...]:
    """Points and fitted curves, signed, and with both directions on each other."""
    signed: list[Curve] = []
    against: list[Curve] = []
    for name, sign in DIRECTIONS.items():
        if not any(point.sign == sign for point in curves.points):
            continue
        signed.append(_points(curves, name, curves.read))
        points = replace(signed[-1], **{
            axis: sign * getattr(signed[-1], axis) for axis in ("x", "y", "low", "high")
        })  # fmt: skip
        against.append(_in_order(points))
        if name in curves.fits or name in curves.lines:
            signed.append(_fitted(curves, name, name, model=None, sign=sign))
            against.append(_fitted(curves, name, name, model=None))
    what, unit, display = curves.quantity.axis
    of = "runs" if all(p.commanded is not None for p in curves.points) else "steady stretches"
    return (
        Panel(RATE, Axis(what, unit, display), signed, f"{what} of {of}"),
        Panel(
            Axis("Speed", "rad/s", "deg/s"),
            Axis(f"{what}, in its direction", unit, display),
            against,
            "Both directions",
        ),
    )


def example_figure(data: TestData) -> tuple[Figure, ...]:
    """Time history of one point: the middle one of the first map."""
    # A steady stretch of a recording has one direction, and no start of its own.
    measured = [
        item
        for item in with_samples(data.completed())
        if windows_of(item.trial).keys() >= DIRECTIONS.keys()
    ]
    if not measured:
        return ()
    item = measured[len(measured) // 2]
    window = windows_of(item.trial)["positive"]
    back = windows_of(item.trial)["negative"]
    # One run: the window of the way back is one leg later.
    recording = item.recording().window(0.0, back.start - window.start)
    marks = (Mark("averaged", x=window.start, until=window.stop),)
    time = Axis("Time", "s", "s")
    speed = setting(speed_of(item.trial), "rad/s", "deg/s")
    rates = [Curve(recording.time, recording[GYRO_RATE], "measured", "measured")]
    if COMMAND in recording.channels:
        command = recording[COMMAND]
        rates.append(Curve(recording.time, command, "commanded", "reference", "thin"))
    whole = recording[DRIVE_TORQUE]
    torques = [Curve(recording.time, whole, "measured", "measured")]
    cut = recording.window(window.start, window.stop)
    near = [Curve(cut.time, cut[DRIVE_TORQUE], "measured", "measured")]
    level = _mean(cut[DRIVE_TORQUE])
    if level is not None:
        ends = np.array([window.start, window.stop])
        near.append(Curve(ends, np.full(2, level), "mean", "fit"))
    mean_text = "" if level is None else f", {amount(level, 'N m')} here,"
    above = _cut_above(whole, level)
    start = ""
    if above is not None:
        start = f"The peak of {amount(float(np.nanmax(whole)), 'N m')} at the start is cut off. "
    return (
        Figure(
            key="one-point",
            title=f"One point of the map: {speed}",
            caption=f"(a) Rate and (b) drive torque of one run at {speed}, (c) the torque of its "
            f"shaded stretch alone. {start}The friction torque at this speed is the mean torque "
            f"of that stretch{mean_text} less inertia times acceleration.",
            alt="Rate and drive torque over time for one constant-velocity run, with the averaging "
            "window shaded.",
            panels=(
                Panel(time, RATE, rates, marks=marks),
                Panel(time, Axis("Drive torque", "N m", "N m", limits=above), torques, marks=marks),
                Panel(time, Axis("Drive torque", "N m", "N m"), near, "Averaged stretch"),
            ),
            thesis=("4.8",),
            trials=(item.trial.number,),
        ),
    )


def _cut_above(torque: Array, level: float | None) -> tuple[float, float] | None:
    """Limits (N m) that cut off a tall peak of the start; None without such a peak."""
    if level is None or level <= 0 or not np.nanmax(torque) > TALLEST * level:
        return None
    return -np.inf, HEADROOM * level


def _mean(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else None
