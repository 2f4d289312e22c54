"""Tests of a protocol and its includes, before validation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from campaign.errors import Problem
from campaign.protocol.files import (
    MOST_VALUES,
    TOO_MANY,
    Origin,
    PatchedTree,
    Source,
    UnreadableError,
    Within,
    count_values,
    looked_for,
    read_source,
)
from campaign.protocol.matrix import flatten
from campaign.protocol.overrides import Override
from campaign.protocol.positions import Keys
from campaign.protocol.problems import allowed, shown, validate
from campaign.protocol.schema import ProtocolFile, replaced
from campaign.text import nearest

DEEPEST_INCLUDE = 16
MOST_FILES = 256
SETTABLE = frozenset(ProtocolFile.model_fields) - {"include", "test", "calibration", "columns"}
TABLES = frozenset({"faults", "rest", "check"})
"""Top-level tables whose keys can be set individually."""


@dataclass
class Draft:
    """A `[[test]]` as written, with the changes of the command line.

    Attributes:
        tree: its keys, without the matrix.
        axes: dotted path to value and place of each swept path.
        patches, bench_patches: changes by `--set` in the test and in its bench.
    """

    source: Source
    index: int
    tree: dict[str, Any]
    axes: dict[str, tuple[Any, Origin]]
    patches: list[tuple[Keys, Origin]] = field(default_factory=list)
    bench_patches: list[Override] = field(default_factory=list)

    @property
    def name(self) -> str:
        return str(self.tree.get("name", ""))

    @property
    def origin(self) -> Origin:
        return PatchedTree(Within(self.source, ("test", self.index)), self.patches)

    def apply(self, override: Override) -> None:
        """Apply `--set name.…`; setting a swept path ends its sweep."""
        keys = override.keys[1:]
        if keys[0] == "matrix" and isinstance(override.value, dict) and len(keys) == 1:
            self.axes = {p: (v, override.origin) for p, _, v in flatten(override.value)}
            return
        if keys[0] == "matrix" and len(keys) > 1:
            self.axes[_dotted(keys[1:])] = (override.value, override.origin)
            return
        self.axes.pop(_dotted(keys), None)
        if keys[0] == "bench" and len(keys) > 1:
            self.bench_patches.append(Override(override.text, keys[1:], override.value))
        else:
            self.tree = replaced(self.tree, keys, override.value)
            self.patches.append((keys, override.origin))


@dataclass
class Collection:
    """All data read so far, and all their problems."""

    drafts: list[Draft] = field(default_factory=list)
    sources: dict[str, Source] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    chains: dict[Path, tuple[str, ...]] = field(default_factory=dict)
    values: int = 0


def collect(path: Path, collected: Collection) -> Source | None:
    """Read the protocol at `path` and its includes into `collected`; the main file's source."""
    try:
        return _collect(path, path.name, (), collected)
    except UnreadableError as error:
        collected.problems.append(Problem(path, 0, 0, str(error)))
        return None


def apply_overrides(overrides: list[Override], collected: Collection) -> None:
    """Apply `--set` to the drafts; the caller applies it to top-level keys."""
    names = [draft.name for draft in collected.drafts if draft.name]
    for override in overrides:
        first = str(override.keys[0])
        drafts = [draft for draft in collected.drafts if draft.name == first]
        if drafts and len(override.keys) > 1:
            for draft in drafts:
                draft.apply(override)
        elif first not in (SETTABLE if len(override.keys) == 1 else TABLES):
            choices = [f"{name}.…" for name in names] + sorted(SETTABLE)
            slip = nearest(first, [*names, *SETTABLE])
            message = f"no test and no top-level key is called '{first}'; {allowed(choices)}{slip}"
            if drafts:
                message = f"'{first}' is a whole test; name one of its keys"
            collected.problems.append(override.origin.problem((), "value", message))


def top_level(source: Source, overrides: list[Override]) -> tuple[dict[str, Any], Origin]:
    """The main file's tree with `--set` applied, and the origin of its values."""
    tests = source.tree.get("test")
    tables = [t for t in tests if isinstance(t, dict)] if isinstance(tests, list) else []
    named = [table.get("name") for table in tables]
    tree, patches = dict(source.tree), []
    for override in overrides:
        key = override.keys[0]
        settable = SETTABLE if len(override.keys) == 1 else TABLES
        if key in settable and key not in named:
            tree = replaced(tree, override.keys, override.value)
            patches.append((override.keys, override.origin))
    return tree, PatchedTree(Within(source), patches)


def sibling(source: Source, written: str) -> tuple[Path, str]:
    """Path and name of the file that `source` names `written`."""
    name = PurePosixPath(source.name).parent / written.replace("\\", "/")
    parts: list[str] = []
    for part in name.parts:
        if part == ".." and parts and parts[-1] not in ("..", "/"):
            parts.pop()
        else:
            parts.append(part)
    return source.file.parent / written, str(PurePosixPath(*parts))


def _collect(file: Path, name: str, chain: tuple[str, ...], collected: Collection) -> Source | None:
    source = read_source(file, name, "protocol")
    if not isinstance(source, Source):
        collected.problems += source
        return None
    collected.values += count_values(source.tree)
    if collected.values > MOST_VALUES:
        collected.problems.append(Problem(file, 0, 0, f"with what was included before: {TOO_MANY}"))
        return None
    chain = (*chain, name)
    collected.sources[name] = source
    collected.chains[_identity(file)] = chain
    if chain[1:]:
        # The main file's own top level is validated by the caller, with --set applied.
        valid = validate(ProtocolFile, source.tree, Within(source))
        collected.problems += valid if isinstance(valid, list) else []
    includes = source.tree.get("include", [])
    for index, written in enumerate(includes if isinstance(includes, list) else []):
        if isinstance(written, str):
            _include(source, index, written, chain, collected)
    tests = source.tree.get("test", [])
    for index, tree in enumerate(tests if isinstance(tests, list) else []):
        if isinstance(tree, dict):
            collected.drafts.append(_draft(source, index, tree))
    return source


def _include(
    source: Source, index: int, written: str, chain: tuple[str, ...], collected: Collection
) -> None:
    file, name = sibling(source, written)

    def refuse(message: str) -> None:
        problem = source.problem(("include", index), "value", f"{shown(written)}: {message}")
        collected.problems.append(problem)

    before = collected.chains.get(_identity(file))
    if before is not None:
        loop = before == chain[: len(before)]
        how = "includes itself" if loop else "is included twice, the first time"
        through = (*chain, name) if loop else before
        return refuse(f"{how}: {' → '.join(through)}")
    if len(chain) >= DEEPEST_INCLUDE:
        return refuse(f"included through more than {DEEPEST_INCLUDE} files: {' → '.join(chain)}")
    if len(collected.chains) >= MOST_FILES:
        return refuse(f"more than {MOST_FILES} files in all")
    try:
        _collect(file, name, chain, collected)
    except UnreadableError as error:
        refuse(f"{error} {looked_for(file)}")


def _draft(source: Source, index: int, tree: Mapping[str, Any]) -> Draft:
    matrix = tree.get("matrix")
    if not isinstance(matrix, dict):
        return Draft(source, index, dict(tree), {})
    axes: dict[str, tuple[Any, Origin]] = {}
    for path, keys, value in flatten(matrix):
        axes[path] = (value, Within(source, ("test", index, "matrix", *keys)))
    return Draft(source, index, dict(tree), axes)


def _identity(file: Path) -> Path:
    try:
        return file.resolve()
    except (OSError, RuntimeError, ValueError):
        return file


def _dotted(keys: Keys) -> str:
    return ".".join(str(key) for key in keys)
