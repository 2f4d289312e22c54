"""Tables, findings and sentences of a friction-velocity map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.both_directions import correlation
from campaign.estimation.intervals import with_error
from campaign.estimation.sampled_curve import drop_interval_if_deterministic
from campaign.estimation.stribeck import PARAMETERS, SYMBOLS, UNITS
from campaign.estimation.velocity_map import MODELS, DirectionFit, Model, doubts
from campaign.experiments.friction_map.curves import DIGITS, Curves
from campaign.experiments.friction_map.points import Point, coefficient_of, stated_periods
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.interface import TrialData, bench_of
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Table, Value
from campaign.units import angle_text

FITTED: tuple[Model, ...] = ("free", "2")
"""Models whose parameters are findings."""
MODEL_LABELS = {"free": "δ free", "2": "δ = 2", "none": "no Stribeck effect"}
ERROR_OF = Cause("standard error of a column", "the standard error of the column before it")
BY_LONG_RUNS = Cause("from the ripple of long runs", "it follows from the ripple of long runs")
MEAN_OF_STRETCH = Cause("mean of a stretch", "mean of the stretch")
OF_SAMPLES = Cause("describes the window's samples", "it describes the window's samples")
OF_RESIDUALS = Cause("describes the residuals", "it describes the residuals")
CRITERION = Cause("criterion", "a criterion to compare models by")
MISFIT = 2.0
"""Ratio of the residuals of delta = 2 to those of delta free, above which a note states it."""


def map_findings(fits: Curves, place: Mapping[str, Value]) -> Iterator[Finding]:
    """Every parameter by direction, δ free before δ = 2."""
    for model in FITTED:
        estimates = fits.estimates(model)
        for parameter in PARAMETERS:
            for direction, found in estimates.items():
                where = {**place, "direction": direction, "exponent": model}
                yield Finding.of(found[parameter], where)


def curve_findings(
    found: Mapping[str, Mapping[str, Estimate]], place: Mapping[str, Value]
) -> Iterator[Finding]:
    """Friction of each direction where there is no map: parameters by direction, then by name."""
    for direction, by_name in found.items():
        for name, one in by_name.items():
            known = replace(one, name="friction_torque") if name == "friction" else one
            yield Finding.of(known, {**place, "direction": direction})


def point_table(points: Sequence[Point], first: TrialData, where: str = "") -> Table:
    """The points of runs by speed, or stretches in order of time; those left out among them.

    first: one of the trials.
    """
    runs = all(point.commanded is not None for point in points)
    if runs:
        every = sorted(points, key=lambda point: point.speed)
    else:
        every = sorted(points, key=lambda point: (point.trial, point.start))
    several = len({point.trial for point in every}) > 1
    pressed = any(np.isfinite(point.normal_load) for point in every)
    rippled = any(point.ripple for point in every)
    columns = {
        Column("stretch", "Stretch", exact=True): not runs,
        Column("trial", "Trial", exact=True): not runs and several,
        Column("first", "From", "s", "s", exact=True): not runs,
        Column("last", "To", "s", "s", exact=True): not runs,
        Column("speed", "Commanded rate", "rad/s", "deg/s", exact=True): runs,
        Column("rate", "Measured rate" if runs else "Rate", "rad/s", "deg/s"): True,
        Column("torque", "Friction torque", "N m", "N m"): True,
        Column("load", "Normal load", "N", "N", reason=MEAN_OF_STRETCH()): pressed,
        Column("coefficient", "Friction coefficient"): pressed,
        Column("spread", "Spread in the window (1σ)", "N m", "N m", reason=OF_SAMPLES()): runs,
        Column("window", "Window", "s", "s", exact=True): runs,
        Column("rule", "Window set by"): runs,
        Column("ripple", "Ripple", "N m", "N m", reason=BY_LONG_RUNS()): rippled,
        Column("without_ripple", "Friction torque without ripple", "N m", "N m"): rippled,
        Column("left_out", "Left out"): not runs and any(point.unsteady for point in every),
    }
    shown = tuple(column for column, there in columns.items() if there)
    rows = (_point_row(number, point, first) for number, point in enumerate(every, start=1))
    kept = {column.name for column in shown}
    of = "Points of the friction-velocity map" if runs else "Steady stretches"
    return Table(
        key="map" if runs else "steady-stretches",
        title=f"{of}{f' ({where})' if where else ''}",
        columns=shown,
        rows=tuple({name: cell for name, cell in row.items() if name in kept} for row in rows),
        note="Mean drive torque over the settled window, less inertia times residual acceleration. "
        "The interval is that of the window. It does not include the scatter between trials, which "
        "the fit includes."
        if runs
        else "",
    )


def _point_row(number: int, point: Point, first: TrialData) -> dict[str, Cell]:
    torque = point.torque
    clean = replace(torque, value=torque.value - point.ripple, low=None, high=None)
    if torque.standard_error is not None and torque.freedom is not None:
        told = with_error("", clean.value, "N m", point.error, torque.freedom, torque.method)
        clean = replace(told, systematic=torque.systematic)
    row: dict[str, Cell] = {
        "stretch": number,
        "trial": point.trial,
        "first": point.start,
        "last": point.stop,
        "speed": point.speed,
        "spread": point.spread,
        "window": point.stop - point.start,
        "rule": point.rule,
        "ripple": point.ripple,
        "left_out": str(point.unsteady),
    }
    for name, one in (("rate", point.rate), ("torque", torque), ("without_ripple", clean)):
        row[name] = drop_interval_if_deterministic(one, abs(one.value), DIGITS)
    if np.isfinite(point.normal_load):
        row["load"] = point.normal_load
    if np.isfinite(point.load):
        row["coefficient"] = coefficient_of(point, first)
    return row


def parameter_table(fits: Curves, where: str) -> Table:
    """Table 4.3: parameters by direction, δ free and δ = 2."""
    free, fixed = fits.estimates("free"), fits.estimates("2")
    rows: list[dict[str, Cell]] = []
    for parameter in PARAMETERS:
        row: dict[str, Cell] = {"parameter": SYMBOLS[parameter], "unit": UNITS[parameter]}
        for name, found in free.items():
            row[name] = found[parameter]
            row[f"{name}_exponent_2"] = fixed[name][parameter]
            row[f"{name}_standard_error"] = found[parameter].standard_error
        rows.append(row)
    rms: dict[str, Cell] = {"parameter": "residual (rms)", "unit": "N m"}
    for name, fit in fits.fits.items():
        rms |= {name: _rms(fit, "free"), f"{name}_exponent_2": _rms(fit, "2")}
    return Table(
        key="parameters",
        title=f"Static friction parameters{f' ({where})' if where else ''}",
        columns=(
            Column("parameter", "Parameter"),
            Column("unit", "Unit"),
            Column("positive", "Positive"),
            Column("positive_standard_error", "± (1σ)", reason=ERROR_OF(), file_only=True),
            Column("negative", "Negative"),
            Column("negative_standard_error", "± (1σ)", reason=ERROR_OF(), file_only=True),
            Column("nominal", "Nominal"),
            Column("positive_exponent_2", "Positive, δ = 2"),
            Column("negative_exponent_2", "Negative, δ = 2"),
            Column("nominal_exponent_2", "Nominal, δ = 2"),
        ),
        rows=(*rows, rms),
        thesis=("4.3",),
        note="δ free is for the static model and this table; δ = 2 is what the LuGre model uses. "
        "Nominal is the mean of both directions, whose errors are correlated.",
    )


def _rms(fit: DirectionFit, model: Model) -> Estimate:
    return Estimate.without_interval("residual", fit.fits[model].rms, "N m", OF_RESIDUALS())


def model_table(fits: Curves, where: str) -> Table:
    """How well each model of the Stribeck effect describes the points of each direction."""
    rows: list[dict[str, Cell]] = [
        {
            "direction": direction,
            "model": MODEL_LABELS[model],
            "parameters": len(fit.fits[model].free),
            "points": len(fit.speed),
            "rms": fit.fits[model].rms,
            "chi_square": fit.fits[model].chi_square,
            "bic": fit.fits[model].bic,
            "preferred": "yes" if model == fit.preferred else "",
        }
        for direction, fit in fits.fits.items()
        for model in MODELS
    ]
    return Table(
        key="models",
        title=f"Models of the Stribeck effect{f' ({where})' if where else ''}",
        columns=(
            Column("direction", "Direction"),
            Column("model", "Model"),
            Column("parameters", "Parameters", exact=True),
            Column("points", "Speeds", exact=True),
            Column("rms", "Residual (rms)", "N m", "N m", reason=OF_RESIDUALS()),
            Column("chi_square", "χ²", reason=CRITERION()),
            Column("bic", "BIC", reason=CRITERION()),
            Column("preferred", "Lowest BIC"),
        ),
        rows=tuple(rows),
        note="All models of a direction have the weights of the one with δ free, so that χ² and "
        "BIC can be compared.",
    )


def map_notes(fits: Curves, where: str) -> Iterator[str]:
    """What a reader should know of the fits, and what to do about it."""
    there = f" ({where})" if where else ""
    for name, fit in fits.fits.items():
        start = f"{name.capitalize()} direction{there}"
        yield from (f"{start}, δ free: {doubt}." for doubt in doubts(fit))
        yield f"{start}: {_scatter(fit)}."
        if fit.preferred != "free" or fit.misfit > MISFIT:
            yield (
                f"{start}: {MODEL_LABELS[fit.preferred]} has the lowest BIC; over their own "
                f"deviations, the residuals of δ = 2 are {fit.misfit:.2g} times those of δ free. "
                "Intervals hold for each model by itself, not for the choice among them."
            )
        yield f"{start}: {_ripple(fits, name)}."
    together = correlation(fits.fits["positive"], fits.fits["negative"])
    yield f"Residuals of both directions{there} correlate by {together:.2g}."


def _scatter(fit: DirectionFit) -> str:
    if not any(each.relative for each in fit.scatters):
        return "points scatter by no more than their windows show"
    shares = " or ".join(
        f"{100 * each.relative:.2g} % of "
        + ("friction without its viscous part" if each.steady_viscous else "their torque")
        for each in fit.scatters
    )
    undecided = ", which the points do not distinguish" if len(fit.scatters) > 1 else ""
    return f"points scatter by {shares} beyond their windows{undecided}"


def _ripple(fits: Curves, direction: str) -> str:
    ripple, told = fits.ripples[direction], stated_periods(bench_of(fits.first.trial))
    points = [point for point in fits.points if point.sign == DIRECTIONS[direction]]
    if ripple is not None:
        turn = 2.0 * np.pi / ripple.periods
        short = sum(abs(point.last - point.first) < turn for point in points)
        source = "as the bench describes it" if told else "as these runs show it"
        return (
            f"a ripple of {ripple.periods:.4g} periods over {angle_text(2.0 * np.pi, '.4g')}, "
            f"{source}, and {100 * abs(ripple.amplitude):.2g} % of dry friction in {ripple.runs} "
            f"runs, was subtracted from all points; {short} windows are shorter than its period"
        )
    least = angle_text(
        min(abs(point.speed) * (point.stop - point.start) for point in points), ".2g"
    )
    return (
        "no ripple over position was found in runs long enough to show one; if friction has one, "
        f"windows that are shorter than its period (the shortest is {least}) see it at "
        "one place: start_angles averages it"
    )


def fitted_torque(point: Point, curves: Curves) -> Estimate:
    """A point's torque without ripple, with its whole deviation: window and between points."""
    fit = curves.fits["positive" if point.sign > 0 else "negative"]
    value = point.torque.value - point.ripple
    between = max(each.deviation(abs(point.speed), abs(value)) for each in fit.scatters)
    error = float(np.hypot(np.nan_to_num(point.error), between))
    told = with_error("friction_torque", value, "N m", error, fit.freedom, "window and scatter")
    return curves.with_constants(told)
