"""Tables and figures of friction models along motions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import Motion
from campaign.estimation.inverse.rows import moving, rows
from campaign.estimation.inverse.terms import Term
from campaign.estimation.inverse.terms import columns as columns_of
from campaign.experiments.any_motion.figures import FORCE, LEFT, PLACE, RATE, TIME, with_gaps
from campaign.experiments.any_motion.inverse_fit import CandidateFit, InverseDynamics, together
from campaign.experiments.any_motion.motions import MotionPiece, place_and_rate
from campaign.experiments.any_motion.tables import COMPARED, validation_columns
from campaign.experiments.whole_model.whole_model_fit import Fit, Whole
from campaign.physics.friction import friction_models
from campaign.result import Cell, Column, Curve, Figure, Mark, Panel, Table

MOST_DRAWN = 5
"""Most models with curves in a figure: more have equal looks, or hide one another."""
MOST_LEFT_OVER = 4
"""Most models with residuals in a figure, including the plain regression."""
FINE = 200
"""Rates of one direction at which friction is drawn."""
PLAIN = "plain regression"


def models_table(found: Whole) -> Table:
    """Residuals of every model: on its rows, on held-out blocks, on other motions."""
    columns = [
        Column("model", "Friction model"),
        Column("numbers", "Numbers", exact=True),
        *COMPARED,
        Column("agreeing", "Starts that agree"),
    ]
    validated = found.fits[0].validation is not None
    columns += validation_columns("the first") if validated else ()
    rows_: list[Mapping[str, Cell]] = []
    for index, each in enumerate(found.fits):
        row: dict[str, Cell] = {
            "model": ("→ " if index == found.best else "") + each.model.name,
            "numbers": len(each.fit.values),
            "residual": each.relative,
            "held_out": each.held_out,
            "criterion": each.criterion if np.isfinite(each.criterion) else None,
            "agreeing": f"{each.fit.found.agreeing} of {len(each.fit.found.starts)}",
        }
        if validated:
            row |= {"validation": each.validation, "gain": each.gain}
        rows_.append(row)
    note = (
        "The arrow shows the lowest BIC, with the effective number of rows of the model that "
        "predicts held-out blocks best (every third of twelve). The column BIC takes the effective "
        "number of each model. What each model is, and which other to try: "
        "docs/friction-models.md#which-model-to-try."
    )
    return Table("models", "Friction models", tuple(columns), tuple(rows_), note=note)


def values_table(fit: Fit) -> Table:
    """The numbers of a model with their intervals."""
    rows_: tuple[Mapping[str, Cell], ...] = tuple(
        {"number": name, "unit": each.unit, "value": each}
        for name, each in fit.fit.estimates.items()
    )
    columns = (Column("number", "Number"), Column("unit", "Unit"), Column("value", "Value"))
    key = fit.model.name.replace(",", "").replace(" ", "-")
    return Table(key, f"Numbers of {fit.model.name}", columns, rows_)


def figures(
    found: Whole, plain: InverseDynamics, unseen: Sequence[MotionPiece]
) -> Iterator[Figure]:
    """Figures of friction over rate, and of validation residuals."""
    yield _curve_figure(found, plain)
    if unseen:
        yield _left_figure(found, plain, unseen)


def _curve_figure(found: Whole, plain: InverseDynamics) -> Figure:
    """Measured force less inertia and linear terms, with each model's steady friction."""
    best = found.fits[found.best]
    rate, rest = _measured(found, best)
    top = float(np.abs(rate).max())
    near = top * np.geomspace(1e-3, 1.0, FINE)
    sweep = np.concatenate([-near[::-1], [np.nan], near])
    drawn = _drawn(found, MOST_DRAWN)
    curves = [
        Curve(rate, rest, "rows", "measured", "points"),
        Curve(sweep, _regressed(_plainest(plain), sweep), PLAIN, PLAIN),
        *(Curve(sweep, _steady(each, sweep), each.model.name, each.model.name) for each in drawn),
    ]
    left_out = len(found.fits) - len(drawn)
    which = f" Without the {left_out} models that predict omitted blocks worst." if left_out else ""
    return Figure(
        key="steady-friction",
        title="Friction of the fitted models",
        caption="Torque less what accelerates the inertia (dots: rows), and the friction of steady "
        "sliding of each fitted model; the plain regression is least squares without any delay. "
        f"Rows beside the lines were not steady.{which}",
        alt="Friction torque over rate with the curves of the fitted models.",
        panels=(Panel(RATE, FORCE, tuple(curves), marks=(Mark("", y=0.0),)),),
        trials=tuple(dict.fromkeys(piece.trial for piece in found.pieces)),
    )


def _drawn(found: Whole, most: int) -> list[Fit]:
    """The best model and those that predict omitted blocks best, in their order."""
    order = sorted(range(len(found.fits)), key=lambda i: (i != found.best, found.fits[i].held_out))
    return [found.fits[i] for i in sorted(order[:most])]


def _measured(found: Whole, best: Fit) -> tuple[Array, Array]:
    values = best.values
    own = (Term("v", "", "", "", lambda m: m.rate), Term("a", "", "", "", lambda m: m.acceleration))
    terms = (*own, *best.extra)
    rate, rest = [], []
    for piece in found.pieces:
        made = rows(piece.motion, terms, found.filtering, values["delay"])
        linear = made.columns[:, 1] * values["inertia"]
        for index, term in enumerate(best.extra):
            linear = linear + made.columns[:, 2 + index] * values[term.name]
        moves = moving(piece.motion, found.filtering) > 0.0
        rate.append(made.columns[moves, 0])
        rest.append((made.force - linear)[moves])
    return np.concatenate(rate), np.concatenate(rest)


def _steady(fit: Fit, rate: Array) -> Array:
    model = friction_models()[fit.model.model]
    options = model.options.model_validate(fit.model.options(fit.values), context={"si": True})
    friction = np.full(len(rate), np.nan)
    known = np.isfinite(rate)
    friction[known] = model.steady_state(options, rate[known])
    return friction


def _plainest(plain: InverseDynamics) -> CandidateFit:
    """The usual regression: each direction of its own, without delay."""
    return plain.tried[min(1, len(plain.tried) - 1)]


def _regressed(fitted: CandidateFit, rate: Array) -> Array:
    """Friction of a regression at steady rates."""
    still = np.zeros(len(rate))
    steady = Motion(time=still, position=still, rate=rate, acceleration=still, force=still)
    return columns_of(steady, fitted.structure.terms) @ fitted.structure.fit.values


def _left_figure(found: Whole, plain: InverseDynamics, unseen: Sequence[MotionPiece]) -> Figure:
    """Validation residuals of up to four models over time, rate and angle."""
    every = [(PLAIN, _plainest(plain).predictions)]
    every += [(each.model.name, each.predictions) for each in _drawn(found, MOST_LEFT_OVER - 1)]
    place = place_and_rate(unseen, found.filtering)
    panels = []
    for name, predictions in every:
        prediction = together(predictions)
        left = prediction.residuals
        title = f"{name}: {100 * prediction.relative:.2f} %"
        panels += [
            Panel(TIME, LEFT, (
                Curve(*with_gaps(prediction.time, left), "", "measured", "thin"),
            ), title),
            Panel(RATE, LEFT, (Curve(place[:, 1], left, "", "measured", "points"),)),
            Panel(PLACE, LEFT, (Curve(place[:, 0], left, "", "measured", "points"),)),
        ]  # fmt: skip
    return Figure(
        key="left-over",
        title="Validation residual of each model",
        caption="Residuals of the validation motion, to which nothing was fitted, over time, rate "
        "and angle, on one scale. A model that knew everything would leave noise.",
        alt="Residual torque of each model over time, rate and angle.",
        panels=tuple(panels),
        across=3,
        one_scale=True,
    )
