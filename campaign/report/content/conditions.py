"""Conditions of a test: kind, bench, effective options, sweep."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from campaign.api.analysis import AnalysedTest
from campaign.experiments.interface import options_of
from campaign.report.content.recording_sources import recorded_from
from campaign.report.content.written_units import TestUnits
from campaign.text import count, path_words
from campaign.trial import Role, canonical_json


def conditions_of(test: AnalysedTest, units: TestUnits) -> Iterator[tuple[str, str]]:
    """Kind, bench, sweep and effective options as text, in the units of the protocol."""
    yield "Experiment", test.kind
    if test.bench:
        yield (
            "Bench",
            test.bench.name + (f": {test.bench.description}" if test.bench.description else ""),
        )
    if test.source:
        yield "Samples from", test.source
    yield from recorded_from(test)
    failed = f", {len(test.failed)} not completed" if test.failed else ""
    yield "Trials", f"{len(test.trials)} executed{failed}"
    points = _points(test)
    for path, values in points.items():
        yield f"{path_words(path)} (swept)", units.words(path, values)
    skip = points.keys() | _without_effect(test)
    skip |= {units.listed_by(path) for path, values in points.items() if _lists(test, units, path)}
    for path, value in test.options.items():
        if path not in skip and value is not None and value != []:
            yield path_words(path), _names(value) or units.value(path, value)


def _names(value: Any) -> str:
    """Names of named tables, whose content is in a table of its own; else ""."""
    named = isinstance(value, dict) and value and all(isinstance(v, dict) for v in value.values())
    return ", ".join(value) if named else ""


def _points(test: AnalysedTest) -> dict[str, list[Any]]:
    """Swept values: distinct values (SI) by dotted path, in order of occurrence."""
    trials = [archived.trial for archived in test.trials]
    points: dict[str, dict[str, Any]] = {}
    for trial in [each for each in trials if each.role is Role.MEASUREMENT] or trials:
        for path, value in trial.point.items():
            points.setdefault(path, {})[canonical_json(value)] = value
    return {path: list(values.values()) for path, values in points.items()}


def _lists(test: AnalysedTest, units: TestUnits, path: str) -> bool:
    """Whether an option lists the same values as the experiment's own sweep."""
    listed, swept = test.options.get(units.listed_by(path)), _points(test)[path]
    if not isinstance(listed, list) or len(listed) != len(swept):
        return False
    return all(_same(one, other) for one, other in zip(listed, swept, strict=True))


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-9)
    return bool(one == other)


def _without_effect(test: AnalysedTest) -> frozenset[str]:
    """Options without effect in all trials; empty without a readable experiment."""
    trees = [trial.trial.options for trial in test.trials] or [test.options]
    if test.experiment is None:
        return frozenset()
    try:
        inactive = [options_of(test.experiment, tree).without_effect() for tree in trees]
    except ValueError:  # another version of the experiment
        return frozenset()
    return frozenset.intersection(*inactive)


def summary_of(test: AnalysedTest) -> str:
    """The conditions in one line: kind, bench, number of trials, source."""
    parts: Sequence[str] = (
        test.kind.replace("_", " "),
        f"bench {test.bench.name}" if test.bench else "",
        count(len(test.trials), "trial"),
        test.source,
    )
    return ", ".join(part for part in parts if part)
