"""Names under this program's entry point groups, without importing packages.

Each distribution is read separately: unreadable metadata of one package costs only its own kinds.
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
_OWN = ("campaign", "typer", "click")
"""Packages with frames in every traceback: this program, and its command line."""
_VALUE = re.compile(r"=\s*(\S+)")


@dataclass(frozen=True)
class PlugIn:
    """An entry point of an installed package.

    Attributes:
        group: entry point group, e.g. `campaign.friction`.
        distribution, version: name and version of the package, as in `pip list`.
        entry_point: `module:object` of the kind.
        packages: top-level packages and modules: first that of the entry point, then all others of
            the distribution, if it lists its files.
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
        """The package without the entry point, for errors in any of its code."""
        return f"the package {self.distribution} {self.version}"

    def load(self) -> object:
        """Import the kind. Raises any error of the package."""
        return metadata.EntryPoint(self.name, self.entry_point, self.group).load()


@dataclass(frozen=True)
class InstalledPlugins:
    """All plug-ins, and a line about each unreadable package."""

    plug_ins: tuple[PlugIn, ...]
    unreadable: tuple[str, ...]


@cache
def installed() -> InstalledPlugins:
    """Plug-ins of all packages that this process can import; searched once."""
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
            # Python imports the first distribution of a name on the path.
            same = re.sub(r"[-_.]+", "-", name).lower()
            plug_ins.setdefault(same, tuple(_declared(distribution, name)))
        except Exception as error:  # noqa: BLE001 (an unreadable package must not affect others)
            which = name or f"with {', '.join(_VALUE.findall(text))}"
            where = distribution.locate_file("")
            unreadable.append(f"the package {which} in {where} cannot be read: {one_line(error)}")
    plug_in_iter = (one for several in plug_ins.values() for one in several)
    return InstalledPlugins(tuple(plug_in_iter), tuple(dict.fromkeys(unreadable)))


def packages_of(module: str) -> tuple[str, ...]:
    """Top-level package of a module, and all packages of the plug-ins that provide it."""
    top = module.partition(".")[0]
    beside = (each.packages for each in installed().plug_ins if top in each.packages)
    return tuple(dict.fromkeys((top, *(name for names in beside for name in names))))


def provider(module: str) -> PlugIn | None:
    """Plug-in that contains a module; None for this program and for libraries."""
    top = module.partition(".")[0]
    return next((each for each in installed().plug_ins if top in each.packages), None)


def blamed(error: BaseException) -> PlugIn | None:
    """Innermost plug-in in the traceback of `error`; None without one."""
    modules = [frame.f_globals.get("__name__") or "" for frame, _ in walk_tb(error.__traceback__)]
    foreign = (module for module in reversed(modules) if module.partition(".")[0] not in _OWN)
    return next(filter(None, map(provider, foreign)), None)


def one_line(error: BaseException) -> str:
    """Type of an error and the first line of its message."""
    try:
        lines = str(error).strip().splitlines()
    except Exception:  # noqa: BLE001 - its text raises an error
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
    """Importable names in a distribution's file list; an editable install lists none."""
    for file in distribution.files or ():
        path = PurePosixPath(file.as_posix())
        name = path.parts[0].partition(".")[0]
        if path.name.endswith(_MODULES) and name.isidentifier():
            yield name
