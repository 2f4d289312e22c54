"""Figures of a friction-velocity map."""

from __future__ import annotations

import numpy as np

from campaign.channels import COMMAND, DRIVE_TORQUE, GYRO_RATE
from campaign.experiments.friction_map.fits import MapFits
from campaign.experiments.friction_map.runs import DIRECTIONS, windows_of
from campaign.experiments.friction_map.tables import fitted_torque
from campaign.experiments.interface import TestData
from campaign.identification.intervals import student
from campaign.identification.stribeck import stribeck
from campaign.identification.velocity_map import DirectionFit, band
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel

RATE = Axis("Rate", "rad/s", "deg/s")
TORQUE = Axis("Friction torque", "N m", "N m")


def map_figure(fits: MapFits, suffix: str, where: str) -> Figure:
    """Friction torque over rate, both directions, with the deviation of each point."""
    halves = []
    for name, sign in DIRECTIONS.items():
        own = sorted((p for p in fits.points if p.sign == sign), key=lambda p: p.rate.value)
        told = [fitted_torque(point, fits) for point in own]
        halves.append(
            Curve(
                np.array([point.rate.value for point in own]),
                np.array([each.value for each in told]),
                f"{name} direction",
                name,
                "points",
                low=_ends([each.combined[0] for each in told]),
                high=_ends([each.combined[1] for each in told]),
            )
        )
    return Figure(
        key=f"map{suffix}",
        title=f"Friction-velocity map{f' ({where})' if where else ''}",
        caption="Friction falls from its static value as sliding becomes faster (Stribeck effect) "
        "and rises again with viscous friction. Bars: 95 %, window and scatter between points.",
        alt="Friction torque over rate for both directions, one dot per constant-velocity run.",
        panels=(Panel(RATE, TORQUE, tuple(reversed(halves))),),
        thesis=("4.9",),
    )


def _ends(values: list[float | None]) -> Array:
    return np.array([np.nan if value is None else value for value in values])


def point_bars(fit: DirectionFit, label: str, series: str, sign: float = 1.0) -> Curve:
    """The points of one direction, as they were fitted, with their 95 % intervals.

    sign: -1 shows them at negative rates.
    """
    half = student(fit.freedom) * fit.deviation
    low, high = fit.torque - half, fit.torque + half
    return Curve(sign * fit.speed, fit.torque, label, series, "points", low=low, high=high)


def fit_figure(fits: MapFits, suffix: str, where: str) -> Figure:
    """Points and fitted curves of each direction over the logarithm of the rate."""
    panels = []
    log_rate = Axis("Rate, either direction", "rad/s", "deg/s", scale="log")
    for name, fit in fits.fits.items():
        fine = np.geomspace(fit.speed.min(), fit.speed.max(), 400)
        free = stribeck(fine, fit.fits["free"].values)
        wide = band(fit, "free", fine)
        fixed = stribeck(fine, fit.fits["2"].values)
        panels.append(
            Panel(
                log_rate,
                TORQUE,
                [
                    point_bars(fit, "measured", "measured"),
                    Curve(fine, free, "fitted, δ free", "fit", low=free - wide, high=free + wide),
                    Curve(fine, fixed, "fitted, δ = 2", "alternative"),
                ],
                f"{name.capitalize()} direction, "
                f"δ = {fit.fits['free'].values['stribeck_exponent']:.3g}",
            )
        )
    return Figure(
        key=f"fit{suffix}",
        title=f"Stribeck curve fitted to the map{f' ({where})' if where else ''}",
        caption="Equation 4.6 fitted by least squares, with δ free and with δ = 2. The logarithmic "
        "axis shows the low speeds that decide Ts and vs. Bars and band: 95 %.",
        alt="Measured friction torque over rate on a logarithmic axis with both fitted curves, one "
        "panel per direction.",
        panels=tuple(panels),
        thesis=("4.11",),
        across=2,
    )


def example_figure(data: TestData) -> tuple[Figure, ...]:
    """The time history of one point: the middle one of the first map."""
    measured = list(data.completed())
    if not measured:
        return ()
    item = measured[len(measured) // 2]
    window = windows_of(item.trial)["positive"]
    back = windows_of(item.trial)["negative"]
    # One run: the way back has its window one leg later.
    recording = item.recording().window(0.0, back.start - window.start)
    marks = (Mark("window", x=window.start), Mark("", x=window.stop))
    time = Axis("Time", "s", "s")
    speed = f"{np.rad2deg(float(str(item.trial.point['speed']))):.3g} deg/s"
    rates = [Curve(recording.time, recording[GYRO_RATE], "measured", "measured")]
    if COMMAND in recording.channels:
        command = recording[COMMAND]
        rates.append(Curve(recording.time, command, "commanded", "reference", "thin"))
    return (
        Figure(
            key="one-point",
            title=f"One point of the map: {speed}",
            caption="Rate and drive torque of one run. The mean torque between the two lines is "
            "the friction torque at this speed.",
            alt="Rate and drive torque over time for one constant-velocity run, with the averaging "
            "window marked.",
            panels=(
                Panel(
                    time,
                    RATE,
                    rates,
                    marks=marks,
                ),
                Panel(
                    time,
                    Axis("Drive torque", "N m", "N m"),
                    [Curve(recording.time, recording[DRIVE_TORQUE], "measured", "measured")],
                    marks=marks,
                ),
            ),
            thesis=("4.8",),
        ),
    )
