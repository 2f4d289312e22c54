"""Many trials as one table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words
from campaign.estimate import Estimate
from campaign.result import Table, bare

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "test",
    "kind",
    "role",
    "repeat",
    "outcome",
    "reason",
    "started",
    "ended",
    "duration",
    "seed",
)
"""Columns of the table of trials, before the swept values."""


def trials_table(trials: Iterable[ArchivedTrial], damaged: Iterable[Damage] = ()) -> pd.DataFrame:
    """One row per executed trial, its number as index; swept values (SI) by their dotted path.

    `duration` is the planned one (s). A swept value with the name of another column has the prefix
    `point.`. An unreadable trial has no row; `attrs["damaged"]` names it in words.
    """
    return _table([(each.trial.number, _row(each)) for each in trials], damaged)


def _table(
    rows: Sequence[tuple[int, dict[str, object]]], damaged: Iterable[Damage]
) -> pd.DataFrame:
    import pandas as pd

    paths = dict.fromkeys(path for _, row in rows for path in row if path not in COLUMNS)
    table = pd.DataFrame(
        [row for _, row in rows],
        index=pd.Index([number for number, _ in rows], name="number", dtype="int64"),
        columns=[*COLUMNS, *paths],
    )
    for column in ("started", "ended"):
        table[column] = pd.to_datetime(table[column], utc=True, format="ISO8601", errors="coerce")
    table.attrs["damaged"] = [in_words(damage) for damage in damaged]
    return table


def metrics_by_trial(
    trials: Iterable[ArchivedTrial], damaged: Iterable[Damage] = ()
) -> pd.DataFrame:
    """Table of trials with a column for each metric (SI), and its interval as `_low`, `_high`.

    NaN if a trial lacks the metric or its interval. `attrs["units"]` has the units.
    """
    import pandas as pd

    rows: list[tuple[int, dict[str, object]]] = []
    units: dict[str, str] = {}
    values: dict[str, dict[int, float | None]] = {}
    for archived in trials:
        rows.append((archived.trial.number, _row(archived)))
        for each in archived.estimates:
            units[each.name] = each.unit
            low, high = each.combined
            numbers = {each.name: each.value, f"{each.name}_low": low, f"{each.name}_high": high}
            for name, value in numbers.items():
                values.setdefault(name, {})[archived.trial.number] = value
    table = _table(rows, damaged)
    columns = pd.DataFrame({n: pd.Series(v, dtype=float) for n, v in values.items()}, table.index)
    wide = pd.concat([table, columns], axis=1)
    wide.attrs = {**table.attrs, "units": units}
    return wide


def _row(archived: ArchivedTrial) -> dict[str, object]:
    trial, ending = archived.trial, archived.ending
    cells = (
        trial.test,
        trial.kind,
        trial.role.value,
        trial.repeat,
        ending.outcome.value,
        ending.reason,
        archived.started,
        archived.ended,
        trial.task.duration,
        trial.seed,
    )
    row: dict[str, object] = dict(zip(COLUMNS, cells, strict=True))
    for path, value in trial.point.items():
        row[f"point.{path}" if path in COLUMNS else path] = value
    return row


def result_table(table: Table, damaged: Iterable[Damage] = ()) -> pd.DataFrame:
    """A table of an analysis, unrounded, SI; `attrs` has its title, units and labels.

    After the table's own columns, `<name>_low` and `<name>_high` for each column with estimates:
    their 95 % intervals, systematic parts included. `attrs["estimates"]` has the estimates by
    column and row; `attrs["damaged"]` describes the damage of the table's trials.
    """
    import pandas as pd

    names = [column.name for column in table.columns]
    frame = pd.DataFrame(
        [{name: bare(cell) for name, cell in row.items()} for row in table.rows], columns=names
    )
    estimates = {name: _estimates(table, name) for name in names}
    for name, own in estimates.items():
        if own:
            ends = [own[k].combined if k in own else (None, None) for k in range(len(frame))]
            frame[f"{name}_low"] = pd.array([low for low, _ in ends], dtype="Float64").astype(float)
            frame[f"{name}_high"] = pd.array([high for _, high in ends], dtype="Float64").astype(
                float
            )
    frame.attrs = {
        "title": table.title,
        "units": {column.name: column.unit for column in table.columns},
        "labels": {column.name: column.label for column in table.columns},
        "estimates": {name: own for name, own in estimates.items() if own},
        "damaged": [in_words(damage) for damage in damaged],
    }
    return frame


def _estimates(table: Table, name: str) -> dict[int, Estimate]:
    """Estimates of a column by row index, from 0."""
    cells = ((number, row.get(name)) for number, row in enumerate(table.rows))
    return {number: cell for number, cell in cells if isinstance(cell, Estimate)}
