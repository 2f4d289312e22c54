"""Tables and findings as NeXus: a dataset per column, and one column that viewers plot."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import h5py
import numpy as np

from campaign.archive.writing import hdf5
from campaign.archive.writing.plots import INTERVAL, half_widths, labels, names_of, unused
from campaign.estimate import Estimate
from campaign.result import Array, Cell, Column, Finding, Table, Value, bare
from campaign.trial import canonical_json

INDEX = "index"


def put_table(parent: h5py.Group, name: str, table: Table, signal: str = "") -> bool:
    """Write a table; return whether it has a column of numbers to plot over the row number.

    `signal` is the column to plot; by default the first with estimates, else with inexact numbers,
    else with exact numbers. A table without numbers is not an NXdata.
    """
    if not table.rows:
        return False
    names = names_of([INDEX, *(column.name for column in table.columns)])[1:]
    cells = {c.name: [row.get(c.name) for row in table.rows] for c in table.columns}
    numeric = [c for c in table.columns if _is_numeric(cells[c.name])]
    shown = next(iter(sorted(numeric, key=lambda c: _rank(c, cells[c.name], signal))), None)
    group = hdf5.make_group(parent, name, "NXcollection" if shown is None else "NXdata")
    hdf5.put_text(group, "title", table.title)
    hdf5.put_attribute(group, "note", table.note)
    own = dict(zip((column.name for column in table.columns), names, strict=True))
    if shown is not None:
        hdf5.put_attribute(group, "signal", own[shown.name])
        group.attrs["axes"] = [INDEX]
        group.attrs[f"{INDEX}_indices"] = np.array([0], dtype="<i4")
    _put_index(group, len(table.rows))
    for column in table.columns:
        _put_column(group, own[column.name], column, cells[column.name], column in numeric)
    for column in numeric:
        _put_intervals(group, own[column.name], column, cells[column.name])
    hdf5.attach_time(group, INDEX)
    return shown is not None


def put_findings(parent: h5py.Group, name: str, findings: Sequence[Finding]) -> None:
    """Write findings as a table: value, interval or reason for no interval, conditions."""
    known = [finding.known for finding in findings]
    ends = [estimate.combined for estimate in known]
    conditions = dict.fromkeys(key for finding in findings for key in finding.conditions)
    columns: dict[str, Sequence[Cell]] = {
        "quantity": [each.name for each in known],
        "value": [each.value for each in known],
        "units": [each.unit for each in known],
        "low": [low for low, _ in ends],
        "high": [high for _, high in ends],
        "standard_error": [each.standard_error for each in known],
        "origin": [each.origin.value for each in known],
        "kind": [each.kind for each in known],
        "reason": [str(each.reason) for each in known],
        "reason_code": [each.reason.code for each in known],
        "reason_values": [canonical_json(dict(each.reason.values)) for each in known],
        "method": [each.method for each in known],
    }
    columns |= {
        f"condition {key}": [finding.conditions.get(key) for finding in findings]
        for key in conditions
    }
    group = hdf5.make_group(parent, name, "NXcollection")
    _put_index(group, len(findings))
    names = names_of([INDEX, *columns])[1:]
    for own, (label, cells) in zip(names, columns.items(), strict=True):
        _put_column(group, own, Column(label, label.replace("_", " ")), cells, _is_numeric(cells))
    hdf5.attach_time(group, INDEX)


def _put_index(group: h5py.Group, rows: int) -> None:
    hdf5.put_series(group, INDEX, np.arange(1.0, rows + 1), long_name="Number of the row")


def _put_column(
    group: h5py.Group, name: str, column: Column, cells: Sequence[Cell], numeric: bool
) -> None:
    if numeric:
        hdf5.put_series(group, name, _numbers(map(bare, cells)), **labels(column))
    else:
        hdf5.put_texts(group, name, [_text(bare(cell)) for cell in cells], **labels(column))


def _put_intervals(group: h5py.Group, name: str, column: Column, cells: Sequence[Cell]) -> None:
    """Write the ends of a column's intervals, and the half-widths if all are symmetric."""
    if not any(isinstance(cell, Estimate) for cell in cells):
        return
    ends = [cell.combined if isinstance(cell, Estimate) else (None, None) for cell in cells]
    low, high = _numbers(end for end, _ in ends), _numbers(end for _, end in ends)
    half = half_widths(_numbers(map(bare, cells)), low, high)
    parts = {"errors": half, "low": low, "high": high}
    for ending, values in parts.items():
        if values is not None and np.isfinite(values).any():
            attributes = labels(column, f", {INTERVAL[ending]}")
            hdf5.put_series(group, unused(f"{name}_{ending}", group), values, **attributes)


def _rank(column: Column, cells: Sequence[Cell], signal: str) -> int:
    """Rank of a column as the default plot; 0 is best."""
    if column.name == signal:
        return 0
    if any(isinstance(cell, Estimate) for cell in cells):
        return 1
    return 3 if column.exact else 2


def _is_numeric(cells: Sequence[Cell]) -> bool:
    """Whether a column contains only numbers or estimates; True and False count as text."""
    values = [value for value in map(bare, cells) if value is not None]
    numbers = all(isinstance(v, int | float | np.number) for v in values)
    estimated = any(isinstance(cell, Estimate) for cell in cells)
    return numbers and not any(isinstance(v, bool) for v in values) and bool(values or estimated)


def _numbers(values: Iterable[Value]) -> Array:
    return np.array([np.nan if v is None else float(v) for v in values], dtype=np.float64)


def _text(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)
