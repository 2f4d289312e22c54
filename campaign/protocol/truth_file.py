"""The truth of a test: a second, simulated bench, unknown to the analysis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import ValidationError

from campaign.errors import Problem
from campaign.physics.bench import Bench
from campaign.physics.complete import lacking
from campaign.physics.truth import has, is_setting, plant_of, simulated
from campaign.protocol.collect import Draft
from campaign.protocol.files import Source, Typed, Within
from campaign.protocol.further_files import FurtherFiles
from campaign.protocol.matrix import Axis
from campaign.protocol.problems import validate
from campaign.trial import Tree


@dataclass
class Truths:
    """Reader of the truths of tests; `typed`: the value of `--truth`, which replaces them."""

    files: FurtherFiles
    typed: str = ""

    @property
    def texts(self) -> dict[str, str]:
        """Verbatim text of every file, by its name as written."""
        return {name: source.text for name, source in self.files.sources.items()}

    def of(self, draft: Draft, written: str, stated: Bench, axes: Sequence[Axis]) -> Tree | None:
        """The plant to simulate for a test with the bench `stated`; None without a valid truth."""
        source = self._source(draft, written)
        if source is None:
            return None
        bench = validate(Bench, source.tree, Within(source))
        if isinstance(bench, list):
            self.files.problems += bench
            return None
        plant = plant_of(bench)
        if lacking(stated):  # the simulation reports this, at the stated bench's file
            return plant
        try:
            simulated(plant, stated)
        except ValueError as error:
            why = _reason(error)
            keys = ("gear", "ratio") if "ratio" in why else ()
            self.files.problems.append(source.problem(keys, "value", why))
            return None
        self.files.problems += _not_there(draft, plant, axes, bench.name)
        return plant

    def _source(self, draft: Draft, written: str) -> Source | None:
        if self.typed:
            return self.files.bench(self.typed, None, Typed(f"--truth {self.typed}"), ())
        return self.files.bench(written or None, draft.source, draft.origin, ("truth",))


def _not_there(draft: Draft, plant: Tree, axes: Sequence[Axis], name: str) -> list[Problem]:
    """Problems of sweeps over settings that the truth lacks: only the stated bench would change."""
    problems = []
    for axis in axes:
        if axis.of_bench and is_setting(axis.keys) and not has(plant, axis.keys):
            path = ".".join(map(str, axis.keys))
            message = f"the truth '{name}' has no '{path}', which the sweep changes"
            problems.append(draft.axes[axis.path][1].problem((), "key", message))
    return problems


def _reason(error: ValueError) -> str:
    """The first error of a refused bench or truth."""
    if isinstance(error, ValidationError):
        text = error.errors()[0]["msg"].removeprefix("Value error, ")
        return f"under the stated controller: {text}"
    return str(error)
