"""Systematic parts that two runs share.

Only constants of the bench can be shared, e.g. torque constant and inertia. Conditions: both tests
state the same value and uncertainty for a bench of the same name. Their samples are from the same
kind of source. A simulated truth has the same value for both. All other parts (interpolation,
resolution, windows ...) are errors of one evaluation. They are independent and add in squares.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from campaign.api.analysis import AnalysedTest
from campaign.axis_kind import Sides, in_axis_terms
from campaign.experiments.shared.systematic import SOURCES
from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import number_at
from campaign.physics.truth import value_at
from campaign.trial import Tree, canonical_json

Plants = Mapping[str, Tree]
"""Simulated truths in place of stated benches, by digest (`RunHeader.truth.plants`)."""


def shared_sources(
    one: AnalysedTest, other: AnalysedTest, plants: Plants, other_plants: Plants
) -> frozenset[str]:
    """Names of the sources of systematic parts that shift both tests' numbers equally."""
    other_constants = constants(other, other_plants)
    own = constants(one, plants).items()
    return frozenset(source for source, text in own if other_constants.get(source) == text)


def constants(test: AnalysedTest, plants: Plants) -> Mapping[str, str]:
    """Constants of a test by the name of their systematic part; equal text, equal constant.

    Empty for a test whose bench or source of samples is unknown.
    """
    if not test.source or test.bench is None:
        return {}
    return {
        source: repr((test.source, test.bench.name, known, sorted(_true(test, path, plants))))
        for path, source in SOURCES.items()
        if (known := _known(test.bench, path)) is not None
    }


def source_called(name: str, sources: Iterable[str], sides: Sides) -> str | None:
    """Source with this name, possibly in terms of the axis; None if unknown."""
    return next((each for each in sources if name in (each, in_axis_terms(each, sides))), None)


def _known(bench: Bench, path: str) -> tuple[object, object] | None:
    """Value of the bench at a path, and its entry in `known.values`; None without a value."""
    value = number_at(bench, path)
    return None if value is None else (value[0], bench.known.values.get(path))


def _true(test: AnalysedTest, path: str, plants: Plants) -> frozenset[str]:
    """Simulated values at a path; empty if the stated bench was simulated."""
    truths = (archived.trial.truth for archived in test.trials if archived.trial.truth)
    return frozenset(_at(plants.get(digest), path) for digest in truths)


def _at(plant: Tree | None, path: str) -> str:
    try:
        return canonical_json(value_at(plant, tuple(path.split("."))))
    except (LookupError, TypeError):
        return "unknown"
