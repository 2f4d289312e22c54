"""Systematic parts that two runs share.

Only constants of the bench can be shared, e.g. torque constant and inertia. Conditions: both tests
state the same value and uncertainty for a bench of the same name. Their samples are from the same
kind of source. If a truth was simulated, its value is the same for both. All other parts
(interpolation, resolution, windows ...) are errors of one evaluation. They are treated as
independent and add in squares.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from campaign.api.analysis import AnalysedTest
from campaign.axis_kind import Sides, in_axis_terms
from campaign.experiments.shared.systematic import SOURCES
from campaign.physics.bench_knowledge import number_at
from campaign.physics.truth import value_at
from campaign.trial import Tree, canonical_json

Plants = Mapping[str, Tree]
"""Simulated truths in place of stated benches, by digest: `RunHeader.truth.plants`."""


def shared_sources(
    one: AnalysedTest, other: AnalysedTest, plants: Plants, other_plants: Plants
) -> frozenset[str]:
    """Names of the sources of systematic parts that shift both tests' numbers equally."""
    if not one.source or one.source != other.source:
        return frozenset()
    if one.bench is None or other.bench is None or one.bench.name != other.bench.name:
        return frozenset()
    shared = [
        source
        for path, source in SOURCES.items()
        if _known(one, path) is not None
        and _known(one, path) == _known(other, path)
        and _true(one, path, plants) == _true(other, path, other_plants)
    ]
    return frozenset(shared)


def source_called(name: str, sources: Iterable[str], sides: Sides) -> str | None:
    """Source by its name, or by its name in terms of the axis; None if unknown."""
    return next((each for each in sources if name in (each, in_axis_terms(each, sides))), None)


def _known(test: AnalysedTest, path: str) -> tuple[object, object] | None:
    """Value of the bench at a path, and its entry in `known.values`; None without a value."""
    if test.bench is None or (value := number_at(test.bench, path)) is None:
        return None
    return value[0], test.bench.known.values.get(path)


def _true(test: AnalysedTest, path: str, plants: Plants) -> frozenset[str]:
    """Simulated values at a path; empty if the stated bench was simulated."""
    return frozenset(_at(plants.get(digest), path) for digest in _truths(test))


def _truths(test: AnalysedTest) -> Iterator[str]:
    return (archived.trial.truth for archived in test.trials if archived.trial.truth)


def _at(plant: Tree | None, path: str) -> str:
    try:
        return canonical_json(value_at(plant, tuple(path.split("."))))
    except (LookupError, TypeError):
        return "unknown"


def constants(test: AnalysedTest, plants: Plants) -> Mapping[str, str]:
    """Constants of a test by the name of their systematic part; equal texts mean equal constants.

    The conditions are those of `shared_sources`, for more than two runs.
    """
    if not test.source or test.bench is None:
        return {}
    return {
        source: repr((test.source, test.bench.name, known, sorted(_true(test, path, plants))))
        for path, source in SOURCES.items()
        if (known := _known(test, path)) is not None
    }
