"""Figures of the stabilization test: one trial of each method over time, errors over a sweep."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from campaign.channels import (
    BASE_RATE,
    COMPENSATION_TORQUE,
    FRICTION_TORQUE,
    POINTING_ERROR,
    RELATIVE_RATE,
    missing,
)
from campaign.estimate import Estimate
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.common import method_label
from campaign.experiments.shared.pointing_error import SHOWN, ends, window_of
from campaign.result import Axis, Cell, Curve, Figure, Panel
from campaign.trial import Recording

TIME = Axis("Time", "s", "s")
RATE = Axis("Rate relative to the hull", "rad/s", "deg/s")
ERROR = Axis("Position error", "rad", "mrad")
ZOOM_RATE = 0.12
"""Half height of the zoom on a reversal, as a share of the largest relative rate."""
ZOOM_SPAN = 0.02
"""Time before the reversal in the zoom, as a share of the time shown; a little more follows."""


def stabilization_figures(
    firsts: Sequence[TrialData], paths: Sequence[str], rows: Sequence[Mapping[str, Cell]]
) -> Iterator[Figure]:
    """Time histories of one trial per method, and the errors along each swept number.

    `firsts` are the first trials of the sweep's places, `rows` those of the table.
    """
    shown = _one_per_method(firsts)
    if shown:
        yield from _rate_figure(shown)
        yield _error_figure(shown)
        if any(name != "none" for name in shown):
            yield from _torque_figure(shown)
    numeric = [
        path
        for path in paths
        if path != "compensation"
        and len({row.get(path) for row in rows if isinstance(row.get(path), int | float)}) > 2
    ]
    for path in numeric[:2]:
        yield _sweep_figure(path, rows)


def _shown_at(shown: Mapping[str, TrialData]) -> str:
    """A sentence on where in the sweep the trials of a figure lie; empty without a sweep."""
    point = next(iter(shown.values())).trial.point
    known = {"frequency": (1.0, " Hz"), "acceleration": (float(np.rad2deg(1.0)), " deg/s²")}
    told = []
    for path, value in point.items():
        if path == "compensation" or not isinstance(value, int | float | str):
            continue
        factor, unit = known.get(path, (1.0, ""))
        text = value if isinstance(value, str) else f"{factor * value:.4g}{unit}"
        told.append(f"{path} {text}")
    return f" Shown at {', '.join(told)}." if told else ""


def _one_per_method(trials: Sequence[TrialData]) -> dict[str, TrialData]:
    """One trial of each compensation, all at the last point of the rest of the sweep."""
    shown: dict[str, TrialData] = {}
    for item in trials:
        same = all(
            item.trial.point.get(path) == value
            for path, value in trials[-1].trial.point.items()
            if path != "compensation"
        )
        if same:
            shown.setdefault(item.trial.task.compensation, item)
    return shown


def _cut(data: TrialData) -> Recording:
    """The first cycles of the measuring window, on a time axis that begins with it."""
    window = window_of(data.trial, SHOWN)
    cut = data.recording().window(window.start, window.stop)
    return Recording(cut.time - window.start, cut.channels, cut.events, cut.ending)


def _rate_figure(shown: dict[str, TrialData]) -> Iterator[Figure]:
    cuts = {name: _cut(item) for name, item in shown.items()}
    if any(missing((BASE_RATE, RELATIVE_RATE), cut.channels) for cut in cuts.values()):
        return
    reference = next(iter(cuts.values()))
    largest = float(np.max(np.abs(reference[BASE_RATE])))
    zoom = _reversal(reference)
    hull = Curve(reference.time, -reference[BASE_RATE], "held still in space", "reference", "thin")
    curves = [hull]
    for name, cut in cuts.items():
        curves.append(Curve(cut.time, cut[RELATIVE_RATE], method_label(name), name))
    inside = (reference.time >= zoom[0]) & (reference.time <= zoom[1])
    near = [Curve(c.x[inside], c.y[inside], c.label, c.series, c.style) for c in curves]
    zoomed_time = Axis("Time", "s", "s", limits=zoom)
    zoomed_rate = Axis(
        RATE.label, "rad/s", "deg/s", limits=(-ZOOM_RATE * largest, ZOOM_RATE * largest)
    )
    yield Figure(
        key="relative-rate",
        title="Rate of the load relative to the hull",
        caption="Where the relative rate passes zero the load sticks to the hull and is carried "
        "along; then it breaks loose. The zoom shows by how much each method leaves the dotted "
        "line of a load held still in space." + _shown_at(shown),
        alt="Relative rate over time for each compensation method, and a zoom on one reversal "
        "where the uncompensated curve stays at zero the longest.",
        panels=(
            Panel(TIME, RATE, curves, "Base motion"),
            Panel(zoomed_time, zoomed_rate, near, "At a reversal"),
        ),
        thesis=("5.4", "5.18", "5.8", "5.22"),
        across=2,
    )


def _reversal(recording: Recording) -> tuple[float, float]:
    """Times (s) around a sign change of the base rate, wide enough to show the sticking."""
    rate = recording[BASE_RATE]
    changes = np.flatnonzero(np.diff(np.sign(rate)) != 0)
    span = float(np.ptp(recording.time))
    middle = recording.time[changes[len(changes) // 2]] if len(changes) else span / 2
    return float(middle - ZOOM_SPAN * span), float(middle + 1.25 * ZOOM_SPAN * span)


def _error_figure(shown: dict[str, TrialData]) -> Figure:
    panels = []
    for name, item in shown.items():
        cut = _cut(item)
        error = cut[POINTING_ERROR] - np.mean(cut[POINTING_ERROR])
        panels.append(
            Panel(
                TIME, ERROR, [Curve(cut.time, error, method_label(name), name)], method_label(name)
            )
        )
    return Figure(
        key="position-error",
        title="Position error by compensation method",
        caption="The error jumps at every reversal of the relative rate and is then integrated "
        "away. The scales differ: each panel shows its method's own error." + _shown_at(shown),
        alt="Position error over time, one panel per compensation method, each with peaks at the "
        "reversals.",
        panels=tuple(panels),
        thesis=("5.9", "5.23", "5.10", "5.24"),
        across=2,
    )


def _torque_figure(shown: dict[str, TrialData]) -> Iterator[Figure]:
    torque = Axis("Torque", "N m", "N m")
    curves = []
    for name, item in shown.items():
        cut = _cut(item)
        if name == "none":
            if FRICTION_TORQUE in cut.channels:
                curves.append(
                    Curve(cut.time, cut[FRICTION_TORQUE], "true friction", "reference", "thin")
                )
        elif COMPENSATION_TORQUE in cut.channels:
            curves.append(Curve(cut.time, cut[COMPENSATION_TORQUE], method_label(name), name))
    if all(curve.series == "reference" for curve in curves):
        return
    yield Figure(
        key="compensation-torque",
        title="Compensation torque",
        caption="What each method adds to the drive torque, beside the friction that acts without "
        "compensation (known only to a simulation)." + _shown_at(shown),
        alt="Compensation torque over time for each method, square-like with the sign of the "
        "relative rate.",
        panels=(Panel(TIME, torque, curves),),
        thesis=("5.7", "5.21"),
    )


def _sweep_figure(path: str, rows: Sequence[Mapping[str, Cell]]) -> Figure:
    methods: dict[str, list[tuple[float, Estimate]]] = {}
    for row in rows:
        value, error = row.get(path), row["error"]
        if isinstance(value, int | float) and isinstance(error, Estimate):
            methods.setdefault(str(row["compensation"]), []).append((float(value), error))
    curves = [_sweep_curve(name, points) for name, points in methods.items()]
    axis = {
        "frequency": Axis("Frequency of the base motion", "Hz", "Hz"),
        "acceleration": Axis("Base acceleration", "rad/s^2", "deg/s^2"),
    }.get(path, Axis(path))
    return Figure(
        key="error-over-" + "".join(c if c.isalnum() else "-" for c in path.lower()),
        title=f"Stabilization error over {axis.label.lower() if axis.unit else path}",
        caption="Error (1σ) of each method along the sweep, with its 95 % interval where there is "
        "one.",
        alt=f"Stabilization error over {path}, one curve per compensation method.",
        panels=(Panel(axis, Axis("Stabilization error (1σ)", "rad", "mrad"), curves),),
    )


def _sweep_curve(method: str, points: Sequence[tuple[float, Estimate]]) -> Curve:
    by_value = sorted(
        ((x, e) for x, e in points if np.isfinite(e.value)), key=lambda point: point[0]
    )
    x = np.array([value for value, _ in by_value])
    y = np.array([error.value for _, error in by_value])
    low, high = ends([error for _, error in by_value])
    return Curve(x, y, method_label(method), method, "line+points", low=low, high=high)
