"""Names under this program's entry point groups, without importing packages.

One package whose metadata cannot be read costs its own kinds and nobody else's, which is why each
distribution is read by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import PurePosixPath
from traceback import walk_tb

_MODULES = (".py", *EXTENSION_SUFFIXES)
_GROUP = re.compile(r"^\s*\[\s*campaign\.", re.MULTILINE)
_VALUE = re.compile(r"=\s*(\S+)")


@dataclass(frozen=True)
class PlugIn:
    """One name of one group, as an installed package declares it.

    Attributes:
        group: of entry points, e.g. `campaign.friction`.
        distribution, version: of the package, as `pip list` shows them.
        entry_point: `module:object`, where the kind is to be imported from.
        packages: top-level packages and modules: that of the entry point first, then all others of
            the distribution, as far as it lists its files.
    """

    group: str
    name: str
    distribution: str
    version: str
    entry_point: str
    packages: tuple[str, ...]

    def __str__(self) -> str:
        return f"the package {self.distribution} {self.version} (entry point {self.entry_point})"

    @property
    def package(self) -> str:
        """The package alone, for what any of its code has done."""
        return f"the package {self.distribution} {self.version}"

    def load(self) -> object:
        """Import it. Raises whatever the package raises."""
        return metadata.EntryPoint(self.name, self.entry_point, self.group).load()


@dataclass(frozen=True)
class InstalledPlugins:
    """Every plug-in there is, and a line about each package that could not be read."""

    plug_ins: tuple[PlugIn, ...]
    unreadable: tuple[str, ...]


@cache
def installed() -> InstalledPlugins:
    """All packages that this process can import are searched, once."""
    plug_ins: dict[str, tuple[PlugIn, ...]] = {}
    unreadable = []
    for distribution in metadata.distributions():
        name = text = ""
        try:
            text = distribution.read_text("entry_points.txt") or ""
            if not _GROUP.search(text):
                continue
            name = distribution.metadata["Name"] or ""
            if not name:
                raise ValueError("its metadata has no name")
            # The first of a name on the path is the one that is imported.
            same = re.sub(r"[-_.]+", "-", name).lower()
            plug_ins.setdefault(same, tuple(_declared(distribution, name)))
        except Exception as error:  # noqa: BLE001 (whatever is wrong with it is its own business)
            which = name or f"with {', '.join(_VALUE.findall(text))}"
            where = distribution.locate_file("")
            unreadable.append(f"the package {which} in {where} cannot be read: {one_line(error)}")
    found = (one for several in plug_ins.values() for one in several)
    return InstalledPlugins(tuple(found), tuple(dict.fromkeys(unreadable)))


def packages_of(module: str) -> tuple[str, ...]:
    """The top-level package of a module, and all others of the plug-ins that provide it."""
    top = module.partition(".")[0]
    beside = (each.packages for each in installed().plug_ins if top in each.packages)
    return tuple(dict.fromkeys((top, *(name for names in beside for name in names))))


def provider(module: str) -> PlugIn | None:
    """The plug-in whose package a module belongs to; None for this program and for libraries."""
    top = module.partition(".")[0]
    return next((each for each in installed().plug_ins if top in each.packages), None)


def blamed(error: BaseException) -> PlugIn | None:
    """The plug-in whose code was being executed when `error` was raised; None when none was."""
    modules = [frame.f_globals.get("__name__") or "" for frame, _ in walk_tb(error.__traceback__)]
    found = (provider(module) for module in reversed(modules) if not module.startswith("campaign."))
    return next(filter(None, found), None)


def one_line(error: BaseException) -> str:
    """An error without its traceback."""
    try:
        lines = str(error).strip().splitlines()
    except Exception:  # noqa: BLE001 - one that cannot be told
        lines = []
    return f"{type(error).__name__}: {lines[0]}"[:300] if lines else type(error).__name__


def _declared(distribution: metadata.Distribution, name: str) -> Iterator[PlugIn]:
    listed = tuple(_top_level(distribution))
    for entry in distribution.entry_points:
        if entry.group.startswith("campaign."):
            own = entry.value.partition(":")[0].strip().partition(".")[0]
            packages = tuple(dict.fromkeys((own, *listed)))
            version = str(distribution.version)
            yield PlugIn(entry.group, entry.name, name, version, entry.value, packages)


def _top_level(distribution: metadata.Distribution) -> Iterator[str]:
    """Importable names in the list of its files; an editable install lists none."""
    for file in distribution.files or ():
        path = PurePosixPath(file.as_posix())
        name = path.parts[0].partition(".")[0]
        if path.name.endswith(_MODULES) and name.isidentifier():
            yield name
