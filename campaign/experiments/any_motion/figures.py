"""Figures of inverse dynamics: friction over rate, residuals, predictions, delay."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimation.inverse.motion import kept_times
from campaign.estimation.inverse.rows import all_rows, moving
from campaign.experiments.any_motion.inverse_fit import CandidateFit, InverseDynamics, together
from campaign.experiments.any_motion.motions import place_and_rate
from campaign.result import Axis, Curve, Figure, Panel

TIME = Axis("Time", "s", "s")
RATE = Axis("Rate", "rad/s", "deg/s")
PLACE = Axis("Angle", "rad", "deg")
FORCE = Axis("Torque", "N m", "N m")
LEFT = Axis("Left over", "N m", "N m")
LAGS = 200
"""Largest number of drawn lags of the autocorrelation."""
BEST = 4
"""Largest number of models whose residuals are drawn."""
BINS = 40
"""of the rate, for means of friction torque in both directions together."""


def figures(found: InverseDynamics) -> Iterator[Figure]:
    """All figures, the most important first."""
    yield friction_figure(found)
    if found.best.predictions:
        yield validation_figure(found)
        yield models_figure(found)
    yield residual_figure(found)


def friction_figure(found: InverseDynamics) -> Figure:
    """Force less the inertia term over the rate, measured and modeled, for moving rows."""
    best = found.best
    moves = _moving(found)
    rate = place_and_rate(found.pieces, found.filtering)[moves, 1]
    pieces = [
        all_rows(each.motion, best.structure.terms, found.filtering, best.delay)
        for each in found.pieces
    ]
    force = np.concatenate([each.force for each in pieces])[moves]
    design = np.concatenate([each.columns for each in pieces])[moves]
    terms, values = best.structure.terms, best.structure.fit.values
    inertia = [i for i, term in enumerate(terms) if term.name == "inertia"]
    rest = force - design[:, inertia] @ values[inertia]
    model = design @ values - design[:, inertia] @ values[inertia]
    centre, measured, modelled = _binned(rate, rest, model)
    return Figure(
        key="friction-over-rate",
        title="Friction over rate",
        caption=f"Torque less what accelerates the inertia, {len(rate)} rows (dots), their means "
        f"over bins of rate, and the chosen model's. What scatters about the line at "
        "one rate follows something else than the rate.",
        alt="Friction torque over rate with the fitted model.",
        panels=(
            Panel(
                RATE,
                FORCE,
                (
                    Curve(rate, rest, "rows", "measured", "points"),
                    Curve(centre, measured, "mean of rows", "reference", "line+points"),
                    Curve(centre, modelled, "model", "fit"),
                ),
            ),
        ),
    )


def residual_figure(found: InverseDynamics) -> Figure:
    """Residuals of the chosen model over time, rate and angle, and their autocorrelation."""
    fit = found.fit
    own = place_and_rate(found.pieces, found.filtering)
    time = np.concatenate([kept_times(piece.motion, found.filtering) for piece in found.pieces])
    left = np.where(_moving(found), np.concatenate(fit.residuals), np.nan)
    lag, correlation, bound = autocorrelation(fit.residuals)
    step = float(np.median(np.diff(time)))
    return Figure(
        key="residuals",
        title="Residual",
        caption=f"Residuals of the chosen model, {100 * fit.relative:.2f} % of the force, over "
        "time, rate and angle; and their autocorrelation, with the band (±1.96/√n) in which 95 % "
        f"of it would lie if they were white. {fit.count} rows are worth {fit.effective:.0f}.",
        alt="Residual torque over time, over rate, over angle, and its autocorrelation.",
        panels=(
            Panel(
                TIME, LEFT, (Curve(*with_gaps(time, left), "", "measured", "thin"),), "Over time"
            ),
            Panel(RATE, LEFT, (Curve(own[:, 1], left, "", "measured", "points"),), "Over rate"),
            Panel(PLACE, LEFT, (Curve(own[:, 0], left, "", "measured", "points"),), "Over angle"),
            Panel(
                Axis("Lag", "s", "s"),
                Axis("Autocorrelation", "", ""),
                (
                    Curve(lag * step, np.full(len(lag), bound), "white", "reference", "band",
                          y_low=np.full(len(lag), -bound)),
                    Curve(lag * step, correlation, "residuals", "measured"),
                ),
                "Autocorrelation",
            ),
        ),
        across=2,
        trials=tuple(dict.fromkeys(piece.trial for piece in found.pieces)),
    )  # fmt: skip


def validation_figure(found: InverseDynamics) -> Figure:
    """Force of the validation motions, measured and predicted by the chosen model."""
    whole = together(found.best.predictions)
    share = found.best.validation
    residual = f"{100 * share.value:.2f} %" if share is not None else ""
    return Figure(
        key="prediction",
        title="Prediction of the validation motion",
        caption="Torque of the validation motion and the chosen model's prediction, with what is "
        f"left over: {residual} of the torque.",
        alt="Measured and predicted torque over time, and their difference.",
        panels=(
            Panel(TIME, FORCE, (
                Curve(*with_gaps(whole.time, whole.force), "measured", "measured"),
                Curve(*with_gaps(whole.time, whole.predicted), "predicted", "fit", "thin"),
            )),
            Panel(TIME, LEFT, (
                Curve(*with_gaps(whole.time, whole.residuals), "", "measured", "thin"),
            )),
        ),
    )  # fmt: skip


def models_figure(found: InverseDynamics) -> Figure:
    """Validation residuals of the plain models and the chosen one."""
    models = shown_models(found)
    panels = []
    for title, each in models:
        own = together(each.predictions)
        share = 100.0 * own.relative
        curve = Curve(*with_gaps(own.time, own.residuals), "", "measured", "thin")
        panels.append(Panel(TIME, LEFT, (curve,), f"{title}: {share:.2f} %"))
    return Figure(
        key="models",
        title="Validation residual of the models",
        caption="Residuals of the validation motion, one panel for each model, on one scale.",
        alt="Residuals over time of several models.",
        panels=tuple(panels),
        across=2,
        one_scale=True,
    )


def shown_models(found: InverseDynamics) -> list[tuple[str, CandidateFit]]:
    """Titles and fits: plain models, the first with a delay, and the chosen one; each once."""
    picked = [0, 1] if len(found.tried) > 2 and found.tried[1].delay == 0.0 else [0]
    later = [i for i, each in enumerate(found.tried) if each.delay != 0.0]
    picked += [*later[:1], found.chosen]
    names = []
    for index in dict.fromkeys(picked):
        each = found.tried[index]
        name = "Directions alike" if "coulomb" in each.structure.names else "By direction"
        name += ", delayed" if each.delay else ""
        chosen = index == found.chosen and index > 1
        names.append(("Chosen" if chosen else name, each))
    return names[:BEST]


def autocorrelation(residuals: Sequence[Array]) -> tuple[Array, Array, float]:
    """Lags (rows), autocorrelation, and the half-width of its 95 % band for white residuals."""
    count = sum(len(each) for each in residuals)
    most = min(LAGS, max(len(each) for each in residuals) // 4)
    square = sum(float(each @ each) for each in residuals)
    lags = np.arange(most + 1)
    correlation = [
        sum(float(e[lag:] @ e[: len(e) - lag]) for e in residuals if len(e) > lag) / square
        for lag in lags
    ]
    return lags.astype(float), np.array(correlation), 1.96 / float(np.sqrt(count))


def with_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """Curves with a gap (NaN) wherever time restarts, so that no line connects two recordings."""
    anew = np.flatnonzero(np.diff(time) < 0.0) + 1
    return np.insert(time, anew, np.nan), np.insert(values, anew, np.nan)


def _moving(found: InverseDynamics) -> NDArray[np.bool_]:
    """Mask of the rows that move and are fitted; friction at standstill balances any force."""
    parts = [moving(each.motion, found.filtering) for each in found.pieces]
    return np.concatenate(parts) > 0.0


def _binned(rate: Array, rest: Array, model: Array) -> tuple[Array, Array, Array]:
    """Means over bins of rate, for each direction; a gap (NaN) between the directions."""
    means: list[tuple[float, float, float]] = []
    for own in (rate < 0.0, rate > 0.0):
        if not own.any():
            continue
        edges = np.unique(np.quantile(rate[own], np.linspace(0.0, 1.0, BINS // 2 + 1)))
        which = np.where(own, np.searchsorted(edges[1:-1], rate, side="right"), -1)
        means += [(math.nan,) * 3] if means else []
        for each in np.unique(which[own]):
            inside = which == each
            means.append((rate[inside].mean(), rest[inside].mean(), model[inside].mean()))
    centre, measured, modelled = np.array(means).T
    return centre, measured, modelled
