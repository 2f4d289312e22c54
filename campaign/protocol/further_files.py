"""Files that a protocol names besides its includes: benches, truths, published values, options."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from campaign.errors import Problem
from campaign.protocol.collect import sibling
from campaign.protocol.files import (
    Origin,
    Source,
    UnreadableError,
    looked_for,
    read_source,
    read_text,
)
from campaign.protocol.positions import Keys
from campaign.protocol.problems import allowed, shown
from campaign.text import nearest

Read = Callable[[Path, str], Source | list[Problem]]
"""Reads a file under a name; returns it or its problems. Raises UnreadableError."""
read_bench: Read = partial(read_source, kind="bench")


def read_any_text(file: Path, name: str) -> Source:
    """A file with any text, without values."""
    return Source(file, name, read_text(file), {})


def names_file(written: str) -> bool:
    """Whether the text is a path, not the name of a shipped bench."""
    return "/" in written or "\\" in written or written.endswith(".toml")


def benches_in(shipped: Path) -> dict[str, Path]:
    """The benches of a folder of protocols, by their bare names."""
    return {file.stem: file for file in sorted((shipped / "benches").glob("*.toml"))}


def no_bench(written: str, known: Collection[str], beside: Collection[str] = ()) -> str:
    """Message for an unknown name of a bench; `beside`: files with similar names."""
    slip = nearest(written, known) or nearest(f"{written}.toml", beside)
    message = f"no shipped bench is called {shown(written)}; {allowed(known)}"
    return f"{message}, or the path of a .toml file{slip}"


@dataclass
class FurtherFiles:
    """Files for one kind of use, each read once; problems are appended to `problems`.

    Attributes:
        shipped: folder whose `benches/` holds the benches with a bare name.
        sources: by the written name of the file.
        protocols: files that were read as protocols, and are no benches.
    """

    shipped: Path
    problems: list[Problem]
    sources: dict[str, Source] = field(default_factory=dict)
    protocols: Mapping[Path, object] = field(default_factory=dict)

    def bench(
        self, written: Any, beside: Source | None, origin: Origin, keys: Keys
    ) -> Source | None:
        """A bench by its path, from `beside` or the current folder, or a shipped one by its name.

        `origin`, `keys`: place of the name.
        """
        if not isinstance(written, str):
            return None
        if names_file(written):
            file, name = sibling(beside, written) if beside else (Path(written), written)
            return self.read(read_bench, file, name, origin, keys, written)
        known = benches_in(self.shipped)
        if written in known:
            return self.read(read_bench, known[written], written, origin, keys, written)
        message = no_bench(written, known, self._toml_files(beside.file.parent) if beside else ())
        self.problems.append(origin.problem(keys, "value", message))
        return None

    def read(
        self, read: Read, file: Path, name: str, origin: Origin, keys: Keys, written: str
    ) -> Source | None:
        """Read a further file; a missing one is a problem of the text that names it."""
        known = self.sources.get(name)
        if known is not None and known.file == file:
            return known
        if known is not None:  # another file has this name, such as a shipped bench
            name = str(file)
        try:
            source = read(file, name)
        except UnreadableError as error:
            hint = nearest(file.name, self._toml_files(file.parent))
            message = f"{shown(written)}: {error} {looked_for(file)}{hint}"
            self.problems.append(origin.problem(keys, "value", message))
            return None
        if not isinstance(source, Source):
            self.problems += source
            return None
        self.sources[name] = source
        return source

    def _toml_files(self, folder: Path) -> list[str]:
        """Names of TOML files in a folder that may be benches."""
        protocols = {file.name for file in self.protocols}
        try:
            names = sorted(file.name for file in folder.glob("*.toml"))[:1000]
        except (OSError, ValueError):
            return []
        return [name for name in names if name not in protocols]
