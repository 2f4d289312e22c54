"""Stabilization error of each method with its interval, also over a sweep."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate
from campaign.experiments.shared.common import method_label, short_label
from campaign.experiments.shared.swept_words import axis_of, name_of, words
from campaign.result import Axis, Cell, Curve, Figure, Panel, Value
from campaign.trial import Trial

COMPENSATION, QUANTITY = "compensation", "stabilization_error"
FOUND = frozenset({"error", "peak", "stuck", "repeats", "spread", "next"})
"""Entries of a row that are no condition."""
BARE = frozenset({"frequency", "acceleration", "motion"})
"""Conditions that are shown without a name: their unit or word identifies them."""
SEVERAL = 3
"""Fewest values of a swept number for an axis of its own; two values get two panels."""
MOST_PANELS = 6
"""Most panels of a figure."""
WIDE = 20.0
"""Ratio of the largest to the smallest error above which their axis is logarithmic."""
DECADE = 10.0
"""Ratio of the largest to the smallest swept value from which their axis is logarithmic."""

BY_METHOD = "error-by-method"

Rows = Sequence[Mapping[str, Cell]]


def error_figures(rows: Rows, paths: Sequence[str], trial: Trial) -> Iterator[Figure]:
    """One figure for each swept number, two at most; without a swept number, one by method."""
    known = [row for row in rows if _error(row) is not None]
    swept = [path for path in paths if len(_numbers(known, path)) >= SEVERAL][:2]
    for path in swept:
        yield _along(path, known, paths, trial)
    if not swept and len(known) > 1:
        yield _by_method(known, paths, trial)


def _error(row: Mapping[str, Cell]) -> Estimate | None:
    error = row["error"]
    return error if isinstance(error, Estimate) and np.isfinite(error.value) else None


def _numbers(rows: Rows, path: str) -> set[float]:
    values = (row.get(path) for row in rows if path != COMPENSATION)
    return {float(v) for v in values if isinstance(v, int | float) and not isinstance(v, bool)}


def _conditions(row: Mapping[str, Cell]) -> dict[str, Value]:
    return {
        name: value
        for name, value in row.items()
        if name not in FOUND and not isinstance(value, Estimate)
    }


def _places(rows: Rows, paths: Sequence[str], *without: str) -> list[tuple[dict[str, Value], Rows]]:
    """Groups of rows that differ in `without` only, each with its shared swept conditions."""
    places: list[tuple[dict[str, Value], list[Mapping[str, Cell]]]] = []
    for row in rows:
        point = {p: v for p, v in _conditions(row).items() if p in paths and p not in without}
        same = next((group for known, group in places if known == point), None)
        if same is None:
            places.append((point, [row]))
        else:
            same.append(row)
    return [(point, group) for point, group in places]


def _along(path: str, rows: Rows, paths: Sequence[str], trial: Trial) -> Figure:
    places = _places(rows, paths, COMPENSATION, path)
    axis, values = axis_of(path, trial), _numbers(rows, path)
    if min(values) > 0 and max(values) >= DECADE * min(values):
        axis = replace(axis, scale="log")
    panels = [
        Panel(axis, _axis(rows), _curves_along(path, group), _title(point, trial))
        for point, group in places[:MOST_PANELS]
    ]
    key = "".join(c if c.isalnum() else "-" for c in path.lower())
    return Figure(
        key=f"error-over-{key}",
        title=f"Stabilization error over {name_of(path)}",
        caption=f"Error (1σ) of each method along the sweep{_where(rows, path, trial)}"
        f"{_with_interval(rows)}.{_left_out(places)}",
        alt=f"Stabilization error over {name_of(path)}, one curve per compensation method.",
        panels=tuple(panels),
        across=min(2, len(panels)),
    )


def _curves_along(path: str, rows: Rows) -> list[Curve]:
    methods: dict[str, list[tuple[float, Estimate, Mapping[str, Cell]]]] = {}
    for row in rows:
        value, error = row.get(path), _error(row)
        if isinstance(value, int | float) and error is not None:
            methods.setdefault(str(row[COMPENSATION]), []).append((float(value), error, row))
    curves = []
    for name, points in methods.items():
        points.sort(key=lambda point: point[0])
        conditions = _conditions(points[0][2])
        conditions.pop(path, None)
        values, errors, _ = zip(*points, strict=True)
        curve = Curve.of(values, errors, method_label(name), name, "line+points")
        curves.append(replace(curve, quantity=QUANTITY, along=path, conditions=conditions))
    return curves


def _by_method(rows: Rows, paths: Sequence[str], trial: Trial) -> Figure:
    methods = list(dict.fromkeys(str(row[COMPENSATION]) for row in rows))
    axis = method_axis(methods)
    places = _places(rows, paths, COMPENSATION)
    panels = [
        Panel(axis, _axis(rows), [_dot(row, methods) for row in group], _title(point, trial))
        for point, group in places[:MOST_PANELS]
    ]
    return Figure(
        key=BY_METHOD,
        title="Stabilization error by compensation method",
        caption=f"Error (1σ) of each method{_where(rows, '', trial)}"
        f"{_with_interval(rows)}.{_left_out(places)}",
        alt="Stabilization error, one dot with its interval for each compensation method.",
        panels=tuple(panels),
        across=min(2, len(panels)),
        one_scale=True,
    )


def method_axis(methods: Sequence[str]) -> Axis:
    """Axis with one place for each method, from 0."""
    places = tuple((float(k), short_label(name)) for k, name in enumerate(methods))
    return Axis("Compensation", limits=(-0.5, len(methods) - 0.5), places=places)


def _dot(row: Mapping[str, Cell], methods: Sequence[str]) -> Curve:
    method, error = str(row[COMPENSATION]), _error(row)
    assert error is not None  # noqa: S101 (for the type checker; its rows have one)
    place, conditions = float(methods.index(method)), _conditions(row)
    return Curve.of([place], [error], "", method, quantity=QUANTITY, conditions=conditions)


def _axis(rows: Rows) -> Axis:
    """Error axis of all panels: from zero, or logarithmic above a ratio of `WIDE`."""
    values = [error.value for row in rows if (error := _error(row)) is not None]
    positive = [value for value in values if value > 0]
    wide = len(positive) == len(values) and max(positive) > WIDE * min(positive)
    label = "Stabilization error (1σ)"
    if wide:
        return Axis(label, "rad", "mrad", scale="log")
    return Axis(label, "rad", "mrad", limits=(0.0, math.nan))


def _title(told: Mapping[str, Value], trial: Trial) -> str:
    title = ", ".join(words(told, trial, BARE))
    return title[:1].upper() + title[1:]


def _where(rows: Rows, along: str, trial: Trial) -> str:
    """` at 36 deg/s²`: frequency and acceleration that all rows share; "" for none."""
    same = {
        name: rows[0].get(name)
        for name in ("frequency", "acceleration")
        if name != along and len({row.get(name) for row in rows}) == 1
    }
    shown = {name: value for name, value in same.items() if isinstance(value, int | float)}
    text = " and ".join(words(shown, trial, BARE))
    return f" at {text}" if text else ""


def _with_interval(rows: Rows) -> str:
    has = [error.has_interval for row in rows if (error := _error(row)) is not None]
    if all(has):
        return ", with its 95 % interval"
    return ", with its 95 % interval where there is one" if any(has) else ""


def _left_out(places: Sequence[object]) -> str:
    if len(places) <= MOST_PANELS:
        return ""
    return f" Shown are the first {MOST_PANELS} of {len(places)} conditions; the table has all."
