"""Estimates as a table: values, intervals, origins and conditions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words
from campaign.estimate import Estimate
from campaign.result import Finding

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "quantity",
    "value",
    "unit",
    "low",
    "high",
    "standard_error",
    "freedom",
    "origin",
    "kind",
    "method",
    "reason",
    "scatter_low",
    "scatter_high",
    "systematic",
    "reason_code",
    "reason_values",
)
"""Columns of an estimate.

`low` and `high`: interval of tables and CSV, systematic parts included. `scatter_low` and
`scatter_high`: interval from scatter alone. `systematic`: dict of source to standard uncertainty
(None: unknown). `reason`: text; `reason_code`: its identifier; `reason_values`: dict of the values
in the text, by name.
"""
NUMBERS = ("value", "low", "high", "standard_error", "freedom", "scatter_low", "scatter_high")


def findings_table(findings: Sequence[Finding], damaged: Iterable[Damage] = ()) -> pd.DataFrame:
    """One row per finding (SI): `COLUMNS`, then a column per condition, by its name.

    A condition with the name of another column has the prefix `condition.`. `attrs["damaged"]`
    describes the damage of the underlying trials.
    """
    rows = [
        row_of(finding.known)
        | {_condition(name): value for name, value in finding.conditions.items()}
        for finding in findings
    ]
    return _frame(rows, COLUMNS, damaged)


def metrics_table(trials: Iterable[ArchivedTrial], damaged: Iterable[Damage] = ()) -> pd.DataFrame:
    """One row per archived metric (SI): `trial`, `COLUMNS`, and `measured_by`."""
    rows = [
        {"trial": item.trial.number, **row_of(estimate), "measured_by": item.measured_by}
        for item in trials
        for estimate in item.estimates
    ]
    return _frame(rows, ("trial", *COLUMNS, "measured_by"), damaged)


def row_of(estimate: Estimate) -> dict[str, object]:
    """Values of an estimate by column of `COLUMNS`."""
    low, high = estimate.combined
    values = {name: getattr(estimate, name, None) for name in COLUMNS}
    return values | {
        "quantity": estimate.name,
        "origin": estimate.origin.value,
        "low": low,
        "high": high,
        "scatter_low": estimate.low,
        "scatter_high": estimate.high,
        "systematic": {part.source: part.standard_uncertainty for part in estimate.systematic},
        **estimate.reason.columns(),
    }


def _condition(name: str) -> str:
    return f"condition.{name}" if name in COLUMNS else name


def _frame(
    rows: Sequence[Mapping[str, object]], columns: Sequence[str], damaged: Iterable[Damage]
) -> pd.DataFrame:
    import pandas as pd

    names = dict.fromkeys([*columns, *(name for row in rows for name in row)])
    frame = pd.DataFrame([dict(row) for row in rows], columns=list(names))
    frame = frame.astype(dict.fromkeys(NUMBERS, "float64"))
    frame.attrs["damaged"] = [in_words(damage) for damage in damaged]
    return frame
