"""The truth of a test: a second, simulated bench, unknown to the analysis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from campaign.errors import Problem
from campaign.physics.bench import Bench
from campaign.physics.complete import lacking
from campaign.physics.truth import has, is_setting, plant_of, simulated
from campaign.protocol.collect import Draft, sibling
from campaign.protocol.files import (
    Origin,
    Source,
    UnreadableError,
    Within,
    looked_for,
    read_source,
)
from campaign.protocol.matrix import Axis
from campaign.protocol.positions import Aim, Keys
from campaign.protocol.problems import allowed, shown, validate
from campaign.text import nearest
from campaign.trial import Tree


@dataclass(frozen=True)
class _Typed:
    """`--truth FILE`: one place for whatever is wrong with it."""

    text: str

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        return Problem(Path(f"--truth {self.text}"), 0, 0, message)


@dataclass
class Truths:
    """Reads the truths that tests name; what is wrong with one is added to `problems`.

    Attributes:
        shipped: folder whose `benches/` holds the benches that go by a bare name.
        typed: what `--truth` was given, in place of what tests name; empty: nothing.
        sources: each file, or that it cannot be used, by its name.
    """

    shipped: Path
    problems: list[Problem]
    typed: str = ""
    sources: dict[str, Source | None] = field(default_factory=dict)

    @property
    def texts(self) -> dict[str, str]:
        """Verbatim text of every file, by its name as written."""
        return {name: source.text for name, source in self.sources.items() if source is not None}

    def of(self, draft: Draft, written: str, stated: Bench, axes: Sequence[Axis]) -> Tree | None:
        """The plant that is simulated for a test whose bench is `stated`; None when that is it."""
        source = self._source(draft, written)
        if source is None:
            return None
        bench = validate(Bench, source.tree, Within(source))
        if isinstance(bench, list):
            self._report(*bench)
            return None
        plant = plant_of(bench)
        if lacking(stated):  # whoever simulates says so, at the stated bench's own file
            return plant
        try:
            simulated(plant, stated)
        except ValueError as error:
            why = _reason(error)
            self._report(source.problem(("gear", "ratio") if "ratio" in why else (), "value", why))
            return None
        self._report(*_not_there(draft, plant, axes, bench.name))
        return plant

    def _source(self, draft: Draft, written: str) -> Source | None:
        origin: Origin = _Typed(self.typed) if self.typed else draft.origin
        keys: Keys = () if self.typed else ("truth",)
        written = self.typed or written
        if not written:
            return None
        if "/" in written or "\\" in written or written.endswith(".toml"):
            file, name = (Path(written), written) if self.typed else sibling(draft.source, written)
        else:
            file, name = self.shipped / "benches" / f"{written}.toml", written
            there = sorted(file.stem for file in (self.shipped / "benches").glob("*.toml"))
            if written not in there:
                message = f"no shipped bench is called {shown(written)}; {allowed(there)}"
                message += f", or the path of a .toml file{nearest(written, there)}"
                self._report(origin.problem(keys, "value", message))
                return None
        if name not in self.sources:
            self.sources[name] = self._read(file, name, origin, keys, written)
        return self.sources[name]

    def _read(
        self, file: Path, name: str, origin: Origin, keys: Keys, written: str
    ) -> Source | None:
        try:
            source = read_source(file, name, "bench")
        except UnreadableError as error:
            message = f"{shown(written)}: {error} {looked_for(file)}"
            self._report(origin.problem(keys, "value", message))
            return None
        if isinstance(source, Source):
            return source
        self._report(*source)
        return None

    def _report(self, *problems: Problem) -> None:
        self.problems += problems


def _not_there(draft: Draft, plant: Tree, axes: Sequence[Axis], name: str) -> list[Problem]:
    """A sweep over what the truth does not have would change the stated bench alone."""
    found = []
    for axis in axes:
        if axis.of_bench and is_setting(axis.keys) and not has(plant, axis.keys):
            path = ".".join(map(str, axis.keys))
            message = (
                f"the truth '{name}' has no '{path}': the sweep would change what is stated, and "
                "not what is simulated"
            )
            found.append(draft.axes[axis.path][1].problem((), "key", message))
    return found


def _reason(error: ValueError) -> str:
    """The first line of what a bench refuses."""
    errors = getattr(error, "errors", None)
    text = errors()[0]["msg"].removeprefix("Value error, ") if callable(errors) else str(error)
    return f"under the stated controller: {text}" if callable(errors) else text
