"""Tables of inverse dynamics: structures, deviations, instruments, correlations, filters."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from campaign.experiments.any_motion.instrument_estimates import Instruments, differs
from campaign.experiments.any_motion.inverse_fit import CandidateFit, InverseDynamics
from campaign.experiments.shared.common import correlations
from campaign.reason import Cause
from campaign.result import Cell, Column, Table

STRONG = 0.9
"""Smallest magnitude of a correlation that is reported."""
AS_THEY_ARE = Cause("sum over rows", "a sum over all rows; blocks show how it varies")
DEVIATION = Cause("deviation", "a deviation, not a quantity of the rig")


COMPARED = (
    Column("residual", "Residual", "", "percent", reason=AS_THEY_ARE()),
    Column("held_out", "Blocks left out", "", "percent", reason=AS_THEY_ARE()),
    Column("criterion", "BIC", exact=True),
)
"""Columns that compare fits."""


def validation_columns(first: str) -> tuple[Column, Column]:
    """Columns of the validation residual and its reduction against the `first` fit."""
    return (
        Column("validation", "Validation", "", "percent"),
        Column("gain", f"Lower than {first} by", "", "percent"),
    )


def structures_table(found: InverseDynamics) -> Table:
    """All structures: residuals on their rows, on blocks left out, and on the validation."""
    columns = [
        Column("terms", "Terms"),
        Column("delay", "Delay", "s", "ms", exact=True),
        *COMPARED,
        Column("simulated", "Rate after 1 s", "", "percent", reason=AS_THEY_ARE()),
    ]
    validated = found.tried[0].validation is not None
    columns += validation_columns("plain") if validated else ()
    columns.append(Column("condition", "Condition", exact=True))
    rows = []
    for index, each in enumerate(found.tried):
        row: dict[str, Cell] = {
            "terms": ("→ " if index == found.chosen else "") + formula(each),
            "delay": each.delay,
            "residual": each.structure.fit.relative,
            "held_out": each.structure.held_out,
            "criterion": each.structure.criterion,
            "simulated": each.simulated if np.isfinite(each.simulated) else None,
            "condition": each.structure.fit.condition,
        }
        if validated:
            row |= {"validation": each.validation, "gain": each.gain}
        rows.append(row)
    note = (
        "The arrow shows the chosen one. Residuals are shares of the force (norms); BIC counts "
        "rows by what they are worth, and compares structures of one delay; “rate after 1 s”: the "
        "motion that the model makes of the recorded force, released every second"
    )
    gain = (
        ". “Lower than plain by”: the validation residual of both directions without delay less "
        "this one's, on the same rows."
    )
    return Table(
        "structures", "Fitted structures", tuple(columns), tuple(rows), note=note + gain * validated
    )


def formula(tried: CandidateFit) -> str:
    """Symbols of the terms: `a, v+, v-, (v > 0), -(v < 0), q`."""
    return ", ".join(term.symbol for term in tried.structure.terms)


def deviations_table(key: str, title: str, tried: CandidateFit) -> Table:
    """Coefficients of one structure with ordinary and autocorrelation-consistent deviations."""
    fit = tried.structure.fit
    half, rule, twice = fit.by_bandwidth
    reason = DEVIATION()
    columns = (
        Column("term", "Coefficient"),
        Column("unit", "Unit"),
        Column("value", "Value"),
        Column("ordinary", "Ordinary", reason=reason),
        Column("half", f"HAC, {half.lags:.3g} lags", reason=reason),
        Column("rule", f"HAC, {rule.lags:.3g} lags", reason=reason),
        Column("twice", f"HAC, {twice.lags:.3g} lags", reason=reason),
        Column("used", "Used", reason=reason),
    )
    rows: tuple[Mapping[str, Cell], ...] = tuple(
        {
            "term": term.name,
            "unit": term.unit,
            "value": f"{fit.values[i]:.7g}",
            "ordinary": float(fit.ordinary[i]),
            "half": float(half.values[i]),
            "rule": float(rule.values[i]),
            "twice": float(twice.values[i]),
            "used": float(fit.robust[i]),
        }
        for i, term in enumerate(tried.structure.terms)
    )
    note = (
        f"Standard deviations (1 sigma). Residual {100 * fit.relative:.4f} % of the force, "
        f"condition number {fit.condition:.5g}; effective sample size {fit.effective:.0f} of "
        f"{fit.count}. Ordinary deviations hold for uncorrelated residuals; these are correlated. "
        "The largest is used where half and twice the bandwidth differ by more than 1.3."
    )
    return Table(key, title, columns, rows, note=note)


def instruments_table(found: InverseDynamics, held: Instruments) -> Table:
    """Estimates by least squares and by instruments; the note states which are reported."""
    rows: list[Mapping[str, Cell]] = [
        {
            "term": term.name,
            "unit": term.unit,
            "squares": found.squares[term.name],
            "instruments": held.estimates[term.name],
            "strength": float(held.found.strength[index]),
        }
        for index, term in enumerate(found.best.structure.terms)
    ]
    columns = (
        Column("term", "Coefficient"),
        Column("unit", "Unit"),
        Column("squares", "Least squares"),
        Column("instruments", "Instruments"),
        Column("strength", "F, first stage", exact=True),
    )
    return Table(
        "instruments",
        f"Instruments {held.along}",
        columns,
        tuple(rows),
        note=instruments_note(found),
    )


def instruments_note(found: InverseDynamics) -> str:
    """Conclusion of the comparison of least squares and instruments; empty without instruments."""
    held = found.instruments
    if held is None:
        return ""
    if found.biased:
        return (
            "The two differ by more than scatter explains: noise of the motion, or what filters "
            "make of jumps of friction, biases least squares. What instruments say goes to the "
            "bench file; predictions are of least squares, which predict what the same loop does "
            "of the same noise."
        )
    alike = "How far the two differ is a systematic part (“instruments”) of what least squares say."
    if held.of_wanted:
        return f"{alike} They do not differ by more than scatter explains: no bias shows."
    undecided = (
        f"{alike} They decide nothing: a recorded force may have been made, by a loop, of the very "
        "noise that instruments are to be free of."
    )
    if not differs(found.squares, held):
        return undecided
    return (
        "The two differ by more than scatter explains: noise of the motion, or an unrecorded "
        "disturbance, biases one of them. Record the setpoints to find out which. "
        f"{undecided}"
    )


def correlated(found: InverseDynamics) -> list[tuple[str, str, float]]:
    """Pairs of coefficients with a correlation of `STRONG` or more, the strongest first."""
    every = correlations(found.best.structure.names, found.fit.correlation)
    pairs = [(*names, share) for names, share in every.items() if abs(share) >= STRONG]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))
