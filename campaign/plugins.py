"""Kinds by name, imported on first use.

A new experiment, friction model, compensation method, backend or format is one file in its room,
or one installed package with an entry point in a group such as `campaign.experiments`. An unusable
package causes an error only when its kind is requested; the error names the package and the defect.
"""

from __future__ import annotations

import ast
import importlib.util
import pkgutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Protocol, TypeVar, get_args

from campaign.entry_points import PlugIn, installed, one_line
from campaign.errors import UsageError
from campaign.options import Options


class Kind(Protocol):
    """Common interface of all kinds; most also have `options`."""

    @property
    def name(self) -> str: ...

    @property
    def summary(self) -> str: ...


K = TypeVar("K", bound=Kind)


class Kinds(Mapping[str, K]):
    """The kinds of one room. Names need no import; `kinds[name]` imports that kind.

    Raises KeyError for an unknown name, and UsageError with the package's name for an unusable one.
    """

    def __init__(
        self, room: str, package: str, attribute: str, interface: type[K], tag: str = ""
    ) -> None:
        """Nothing is read yet.

        Args:
            room: name of a kind, e.g. "friction model".
            package: package of the room; the program's own kinds are its modules that assign
                `attribute`, and its folders with a module of that name.
            interface: class of a kind.
            tag: option that names the kind in a file, if any.
        """
        self.room = room
        self.group = GROUPS[room]
        self._package = package
        self._attribute = attribute
        self._interface = interface
        self._tag = tag
        self._loaded: dict[str, K] = {}
        self._unusable: dict[str, str] = {}

    def __getitem__(self, name: str) -> K:
        if name in self._loaded:
            return self._loaded[name]
        if name in self._unusable:
            raise UsageError(self._unusable[name])
        if name in self._own:
            module = importlib.import_module(self._own[name])
            kind: K = getattr(module, self._attribute)
        elif name in self._installed:
            try:
                kind = self._load(name)
            except UsageError as error:
                self._unusable[name] = str(error)
                raise
        else:
            raise KeyError(name)
        return self._loaded.setdefault(name, kind)

    def __iter__(self) -> Iterator[str]:
        return iter(sorted({*self._own, *self._installed, *self._loaded}))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._installed or name in self._loaded

    def plug_in(self, name: str) -> PlugIn | None:
        """Entry of the installed package that provides a kind; None for the program's own."""
        if name in self._own or name not in self._installed:
            return None
        return self._installed[name][0]

    @property
    def plug_ins(self) -> tuple[str, ...]:
        """Names of all kinds from installed packages."""
        return tuple(name for name in self if self.plug_in(name) is not None)

    def described(self) -> Iterator[tuple[str, K | str]]:
        """Every name with its kind, or with the reason why it is unusable. Imports all kinds."""
        for name in self:
            try:
                yield name, self[name]
            except UsageError as error:
                yield name, str(error)
            if name in self._own:
                for plug_in in self._installed.get(name, ()):
                    yield name, self._is_unusable(plug_in, "the program has one of that name")

    @contextmanager
    def including(self, kind: K) -> Iterator[None]:
        """For tests: register `kind` within the block, as if a package provided it."""
        before = self._loaded.get(kind.name)
        self._loaded[kind.name] = kind
        try:
            yield
        finally:
            del self._loaded[kind.name]
            if before is not None:
                self._loaded[kind.name] = before

    @cached_property
    def _own(self) -> dict[str, str]:
        """Modules of the program's own kinds by name, from their sources."""
        modules = {}
        for each in pkgutil.iter_modules(importlib.import_module(self._package).__path__):
            module = f"{self._package}.{each.name}"
            if each.ispkg:  # a folder for one kind assigns it in a file with this name
                module = f"{module}.{self._attribute.lower()}"
            name = _declared_name(_source(module), self._attribute)
            if name:
                modules[name] = module
        return modules

    @cached_property
    def _installed(self) -> dict[str, list[PlugIn]]:
        entries: dict[str, list[PlugIn]] = {}
        for plug_in in installed().plug_ins:
            if plug_in.group == self.group:
                entries.setdefault(plug_in.name, []).append(plug_in)
        return entries

    def _load(self, name: str) -> K:
        plug_in, *others = self._installed[name]
        if others:
            packages = " and of ".join(map(str, self._installed[name]))
            raise UsageError(
                f"the {self.room} {name!r} is that of {packages}; remove all but one of them"
            )
        try:
            kind: Any = plug_in.load()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a package may also raise SystemExit
            raise UsageError(self._is_unusable(plug_in, one_line(error))) from error
        why = self._why_not(kind, name)
        if why:
            raise UsageError(self._is_unusable(plug_in, why))
        usable: K = kind
        return usable

    def _why_not(self, kind: Any, name: str) -> str:
        """Why `kind` is no valid kind of that name; empty if it is valid."""
        wanted = self._interface.__name__
        if not isinstance(kind, self._interface):
            return f"it is {type(kind).__name__!r}, no {wanted} of this program"
        if kind.name != name:
            return f"it calls itself {kind.name!r}; both names must be the same"
        if "options" not in self._interface.__annotations__:
            return ""
        options: Any = getattr(kind, "options", None)
        if not (isinstance(options, type) and issubclass(options, Options)):
            return "its options are no subclass of campaign.options.Options"
        field = options.model_fields.get(self._tag)
        if self._tag and (field is None or get_args(field.annotation) != (name,)):
            return f"its options lack the field `{self._tag}: Literal[{name!r}]`"
        return ""

    def _is_unusable(self, plug_in: PlugIn, why: str) -> str:
        return f"the {self.room} {plug_in.name!r} of {plug_in} cannot be used: {why}"


GROUPS = {
    "experiment": "campaign.experiments",
    "friction model": "campaign.friction",
    "friction specimen": "campaign.specimens",
    "compensation method": "campaign.compensation",
    "backend": "campaign.backends",
    "export format": "campaign.exports",
    "report format": "campaign.report_formats",
    "recording format": "campaign.recording_formats",
}
"""Entry point group by room."""
ENDED = {
    "campaign.identification_methods": "what identifies is an experiment with a `model`, in the "
    "group campaign.experiments",
}
"""Former groups, and their replacements."""


def stray_entries() -> Iterator[str]:
    """A line about each unreadable package and each entry in an unknown group."""
    yield from installed().unreadable
    for plug_in in installed().plug_ins:
        if plug_in.group in ENDED:
            yield f"{plug_in}: the group {plug_in.group!r} has ended; {ENDED[plug_in.group]}"
        elif plug_in.group not in GROUPS.values():
            known = ", ".join(GROUPS.values())
            yield f"{plug_in}: there is no group {plug_in.group!r}; there are {known}"


def _source(module: str) -> str:
    """Source text of a module, without importing it."""
    spec = importlib.util.find_spec(module)
    loader: Any = spec.loader if spec is not None else None
    return "" if loader is None else loader.get_source(module) or ""


def _declared_name(source: str, attribute: str) -> str:
    """Name in `ATTRIBUTE = Class("name", ...)` or `Class(name="name", ...)`; empty if absent."""
    start = source.find(f"\n{attribute} = ")
    if start < 0:
        return ""
    [statement, *_] = ast.parse(source[start:]).body
    call = statement.value if isinstance(statement, ast.Assign) else None
    if not isinstance(call, ast.Call):
        return ""
    given = [keyword.value for keyword in call.keywords if keyword.arg == "name"]
    for value in (*given, *call.args[:1]):
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            return value.value
    return ""
