"""TOML file of a calibration's result, and the bench file with fitted values and intervals."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from campaign.calibration.leave_out import LeftOut, deviations
from campaign.calibration.outcome import CalibrationOutcome
from campaign.calibration.space import Parameter, Space
from campaign.calibration.targets import Target, shortest
from campaign.errors import CampaignError
from campaign.estimation.linear_uncertainty import strong
from campaign.estimation.multi_start import Start, agreeing
from campaign.protocol.bench_edit import with_known
from campaign.protocol.files import Source
from campaign.units import convert, split_quantity

HEADER = """\
# Written by `campaign calibrate {protocol}`; docs/calibration.md says what each line means.
# The same protocol and files give the same result, so nothing here says when it was made.
"""


LEAST_CORRELATION = 0.1
"""Correlations below this magnitude are not written."""
ASSUMPTION = (
    "cells deviate independently, each by its standard deviation times the scatter; linear at the "
    "optimum; the structure of the bench counts as right"
)
"""Assumptions of the covariance."""


def result_text(outcome: CalibrationOutcome, bench_name: str, bench: str = "") -> str:
    """TOML text of the result.

    Args:
        bench_name: file of the calibrated bench.
        bench: its text, with the fingerprint.
    """
    import tomlkit

    problem, options = outcome.problem, outcome.problem.options
    parameters = problem.space.parameters
    document: dict[str, Any] = {
        "protocol": problem.protocol.path.name,
        "bench": options.bench,
        "calibrated_bench": bench_name,
        "finished": not outcome.interrupted,
        "loss": options.loss,
        "starts": options.starts if outcome.was_fitted else 0,
        "seed": options.seed,
        "evaluations": outcome.evaluations,
        "cells": shortest(problem.targets, problem.published),
        "fit": dict(_fit(outcome)),
        "start": [_start(outcome, each) for each in outcome.starts],
        "parameter": [dict(_parameter(outcome, index)) for index in range(len(parameters))],
        "correlation": _correlation(outcome),
        "covariance": _covariance(outcome),
        "cell": [dict(_cell(outcome, target)) for target in problem.targets],
        "leave_one_out": _left_out(outcome),
        "propagation": _propagation(outcome, bench),
    }
    header = HEADER.format(protocol=problem.protocol.path.name)
    return header + tomlkit.dumps({k: v for k, v in document.items() if v not in ({}, [])})


def interruption(outcome: CalibrationOutcome) -> str:
    """Sentence on the missing parts of an interrupted calibration."""
    if outcome.uncertainty is None:
        return "interrupted: the best values so far are kept, without intervals"
    return "interrupted: the fit is whole, the leave-one-out error is not"


def bench_text(
    source: Source, space: Space, values: Sequence[float], known: Mapping[str, Any]
) -> str:
    """Bench file with the values; comments and units of the file stay.

    `known`: entries for the bench's table `known`; its fingerprint is updated. Raises CampaignError
    if the file has no value at a path.
    """
    content = source.text.encode()
    edits: list[tuple[int, int, str]] = []
    for parameter, value in zip(space.parameters, values, strict=True):
        for path, factor in parameter.fields:
            keys = tuple(path.split("."))
            span = source.positions.span(keys)
            if span is None:
                raise CampaignError(f"{source.file}: nothing is written at {path!r}")
            edits.append((*span, _as_written(source.tree, keys, parameter, factor * value)))
    for first, last, text in sorted(edits, reverse=True):
        content = content[:first] + text.encode() + content[last:]
    return with_known(content.decode(), known, str(source.file))


def known_entries(
    outcome: CalibrationOutcome, fitted: Iterable[str], document: str
) -> dict[str, Any]:
    """Entries of a bench's table `known`, for TOML.

    Every fitted value has an entry, to replace that of an earlier calibration. The entry has no
    interval if the cells do not determine the value.

    Args:
        fitted: names of the cells in the bench file.
        document: name of their document in the bench file.
    """
    entries: dict[str, Any] = {"document": document, "fitted": list(fitted)}
    entries["values"] = dict(_values(outcome))
    pairs = list(_correlations(outcome))
    return {**entries, "correlations": pairs} if pairs else entries


def _values(outcome: CalibrationOutcome) -> Iterator[tuple[str, dict[str, Any]]]:
    for index, parameter in enumerate(outcome.problem.space.parameters):
        ends = [parameter.unknown.value(end) for end in _ends(outcome, index)]
        for path, factor in parameter.fields:
            entry: dict[str, Any] = {"origin": "fitted"}
            if ends:
                low, high = sorted(factor * end for end in ends)
                entry = {"interval": [parameter.text(low), parameter.text(high)], **entry}
            yield path, entry


def _ends(outcome: CalibrationOutcome, index: int) -> tuple[float, ...]:
    """Ends of the 95 % interval, in shares of the range; empty if not determined.

    The interval is valid for any true value of the parameters at a bound.
    """
    certainty = outcome.uncertainty
    if certainty is None or certainty.bound[index] or certainty.open[index]:
        return ()
    ends = float(certainty.low[index]), float(certainty.high[index])
    return ends if all(map(math.isfinite, ends)) else ()


def _correlations(outcome: CalibrationOutcome) -> Iterator[list[Any]]:
    """Pairs of paths with correlated errors; fields of one parameter correlate fully."""
    certainty = outcome.uncertainty
    if certainty is None:
        return
    fields = [
        (index, path, factor)
        for index, parameter in enumerate(outcome.problem.space.parameters)
        if _ends(outcome, index)
        for path, factor in parameter.fields
    ]
    for (i, one, first), (j, other, second) in combinations(fields, 2):
        share = float(certainty.correlation[i, j]) * math.copysign(1.0, first * second)
        if math.isfinite(share) and abs(share) >= LEAST_CORRELATION:
            yield [one, other, round(min(1.0, max(-1.0, share)), 3)]


def _as_written(tree: Any, keys: Sequence[str], parameter: Parameter, value: float) -> str:
    for key in keys:
        tree = tree[key]
    if parameter.quantity is None:
        return repr(float(f"{value:.6g}"))
    unit = split_quantity(tree)[1]
    return f'"{convert(value, parameter.quantity.si, unit):.6g} {unit}"'


def _fit(outcome: CalibrationOutcome) -> Iterator[tuple[str, Any]]:
    problem = outcome.problem
    reproduced = [outcome.fitted.found.get(t.cell.path) for t in problem.targets]
    yield "cost", _short(outcome.cost)
    yield "cost_before", _short(outcome.cost_before)
    yield "cells", len(problem.targets)
    yield "parameters", len(problem.space.parameters)
    yield from _summary(deviations(problem.targets, reproduced))
    yield "starts_finished", len(outcome.starts)
    yield "starts_that_agree", agreeing(outcome.starts)
    if outcome.uncertainty is not None:
        yield "scatter", _short(outcome.uncertainty.scatter)
    notes = [*problem.warnings, *dict.fromkeys(outcome.fitted.problems)]
    if outcome.interrupted:
        notes.insert(0, interruption(outcome))
    if notes:
        yield "notes", notes


def _summary(percent: np.ndarray[Any, np.dtype[np.float64]]) -> Iterator[tuple[str, float]]:
    known = np.abs(percent[np.isfinite(percent)])
    if len(known):
        yield "median_deviation_percent", _short(float(np.median(known)))
        yield "worst_deviation_percent", _short(float(np.max(known)))


def _parameter(outcome: CalibrationOutcome, index: int) -> Iterator[tuple[str, Any]]:
    parameter = outcome.problem.space.parameters[index]
    unknown, share = parameter.unknown, float(outcome.shares[index])
    yield "name", parameter.name
    yield "paths", [path for path, _ in parameter.fields]
    if any(factor != 1.0 for _, factor in parameter.fields):
        yield "factors", [factor for _, factor in parameter.fields]
    yield "value", parameter.text(unknown.value(share))
    certainty = outcome.uncertainty
    half = float(certainty.half_width[index]) if certainty is not None else math.nan
    if math.isfinite(half) and half < 10.0:  # ten times the range is no information
        ends = (unknown.value(share - half), unknown.value(share + half))
        yield "interval_95", [parameter.text(end) for end in ends]
        if certainty is not None and any(certainty.bound):
            wide = (float(certainty.low[index]), float(certainty.high[index]))
            yield "interval_95_wide", [parameter.text(unknown.value(end)) for end in wide]
    if certainty is not None and math.isfinite(certainty.limit[index]):
        yield "limit_95", parameter.text(unknown.value(float(certainty.limit[index])))
    yield "before", parameter.text(unknown.start)
    yield "bounds", [parameter.text(unknown.lower), parameter.text(unknown.upper)]
    if certainty is not None:
        bound = certainty.bound[index]
        yield "identified", not certainty.open[index] and not bound
        if bound:
            yield "note", f"at its {bound} bound; the others' intervals take it as known"
        elif certainty.open[index]:
            yield "note", "not determined by these cells within its bounds"


def _start(outcome: CalibrationOutcome, start: Start) -> dict[str, Any]:
    space = outcome.problem.space
    named = zip(space.parameters, space.values(start.end), strict=True)
    values = {parameter.name: parameter.text(value) for parameter, value in named}
    return {"cost": _short(start.cost), "ended": start.reason, "values": values}


def _correlation(outcome: CalibrationOutcome) -> dict[str, Any]:
    certainty = outcome.uncertainty
    if certainty is None:
        return {}
    names = [parameter.name for parameter in outcome.problem.space.parameters]
    pairs = strong(certainty.correlation, names)
    matrix = [
        [round(float(r), 3) + 0.0 if math.isfinite(r) else "" for r in row]
        for row in certainty.correlation
    ]
    entries = [[a, b, round(r, 3)] for a, b, r in pairs]
    return {"parameters": names, "strong": _rows(entries), "matrix": _rows(matrix)}


def _covariance(outcome: CalibrationOutcome) -> dict[str, Any]:
    certainty = outcome.uncertainty
    matrix = None if certainty is None else certainty.covariance
    if certainty is None or matrix is None:
        return {}
    names = [parameter.name for parameter in outcome.problem.space.parameters]
    rows = _rows([[_short(float(c)) for c in row] for row in matrix])
    head = {"assumption": ASSUMPTION, "freedom": certainty.freedom, "parameters": names}
    return {**head, "matrix": rows}


def _propagation(outcome: CalibrationOutcome, bench: str) -> dict[str, Any]:
    """Table that `published.calibration_covariance` reads; last, as it is mainly for programs."""
    propagation = outcome.propagation
    if propagation is None:
        return {}
    stated = tomllib.loads(bench).get("known", {}).get("fingerprint", {})
    return {
        "protocol": propagation.protocol,
        "fingerprint": stated.get("bench", ""),
        "freedom": propagation.freedom,
        "lost": propagation.lost,
        "standard_uncertainty": {k: _short(v) for k, v in propagation.uncertainty.items()},
    }


def _cell(outcome: CalibrationOutcome, target: Target) -> Iterator[tuple[str, Any]]:
    fitted = outcome.fitted.found.get(target.cell.path)
    before = outcome.before.found.get(target.cell.path)
    yield "cell", target.cell.path
    yield "unit", target.cell.unit
    yield "published", target.cell.value
    for name, value in (("fitted", fitted), ("before", before)):
        if value is not None:
            yield name, _short(value)
    if math.isfinite(percent := target.percent(fitted)):
        yield "deviation_percent", _short(percent)
    yield "standard_deviation", target.weight
    yield "residual", _short(target.residual(fitted))


def _left_out(outcome: CalibrationOutcome) -> dict[str, Any]:
    if not outcome.left_out:
        return {}
    targets = [target for left in outcome.left_out for target in left.targets]
    overall = deviations(targets, [value for left in outcome.left_out for value in left.found])
    fitted = [outcome.fitted.found.get(target.cell.path) for target in targets]
    beside = _summary(deviations(targets, fitted))
    return {
        "condition": outcome.problem.options.leave_out,
        **dict(_summary(overall)),
        **{f"fitted_{name}": value for name, value in beside},
        "without": [_without(left) for left in outcome.left_out],
    }


def _without(left: LeftOut) -> dict[str, Any]:
    percent = deviations(left.targets, left.found)
    return {
        "value": left.value,
        "cells": [target.cell.path for target in left.targets],
        "predicted": ["" if f is None else _short(f) for f in left.found],
        "deviation_percent": [_short(p) if math.isfinite(p) else "" for p in percent],
    }


def _rows(rows: Sequence[Sequence[Any]]) -> Any:
    """TOML array with one row per line."""
    import tomlkit

    array = tomlkit.array()
    array.extend(rows)
    return array.multiline(True)


def _short(value: float) -> float:
    """Round to six digits, which rounding errors do not affect; -0 becomes 0."""
    return float(f"{value:.6g}") + 0.0
