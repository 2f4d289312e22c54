"""Paths to friction parameters of a bench, and the tables that use them.

`coulomb_torque` (or `*.coulomb_torque`) matches every interface whose model declares it,
`load.coulomb_torque` one interface. In a table such a path is a key, or a key within the table of
its interface: TOML reads `load.coulomb_torque = 0.03` as the latter.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from campaign.physics.friction import model_of

Keys = tuple[str | int, ...]
EVERY = "*"
INTERFACE = "interface"
"""Pydantic's label of an interface's table among the values of a table of paths."""


@dataclass(frozen=True)
class Wrong:
    """An invalid path: its keys in the normalised table, and the message."""

    keys: Keys
    message: str


def changeable(options: Any) -> tuple[str, ...]:
    """Parameters of an interface that can change: declared by its model and set here."""
    names = model_of(options).may_change()
    return tuple(name for name in names if getattr(options, name, None) is not None)


def torques(options: Any) -> tuple[str, ...]:
    """Those of `changeable` that are torques."""
    names = model_of(options).torques()
    return tuple(name for name in names if getattr(options, name, None) is not None)


def split(path: str) -> tuple[str, str]:
    """Interface (`*` for every one) and parameter."""
    interface, _, parameter = path.rpartition(".")
    return interface or EVERY, parameter


def plain(path: str) -> str:
    """The path for comparisons, without `*.`."""
    interface, parameter = split(path)
    return parameter if interface == EVERY else path


def matched(path: str, declared: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, str]]:
    """Interface and parameter of each match of `path`; `declared`: parameters by interface."""
    wanted, parameter = split(path)
    for interface, parameters in declared.items():
        if wanted in (EVERY, interface) and parameter in parameters:
            yield interface, parameter


def why_not(path: str, declared: Mapping[str, Sequence[str]], what: str) -> str:
    """Why `path` has no match, with the allowed names; "" if it has one.

    `what`: kind of declared parameters, e.g. "that can change". With `*`, one interface with the
    parameter is enough. Without any interface every path is valid: experiments can remove all
    friction.
    """
    if not declared or next(matched(path, declared), None) is not None:
        return ""
    interface, parameter = split(path)
    if interface not in (EVERY, *declared):
        return f"there is no friction interface '{interface}'; {choices(interface, declared)}"
    if interface == EVERY:
        names = list(dict.fromkeys(name for names in declared.values() for name in names))
        whose = "no friction interface has a parameter"
    else:
        names = list(declared[interface])
        whose = f"friction.{interface} has no parameter"
    return f"{whose} '{parameter}' {what}; {choices(parameter, names)}"


def choices(word: str, names: Iterable[str]) -> str:
    """Text with the allowed names instead of `word`, and the closest of them."""
    listed = list(names)
    close = difflib.get_close_matches(word, listed, n=1)
    hint = f"; did you mean '{close[0]}'?" if close else ""
    return f"allowed are {', '.join(listed)}{hint}" if listed else "there is none"


def nested(tree: Any) -> Any:
    """A table of paths in one spelling: quoted paths as nested keys, and without `*.`.

    Raises pydantic's error for a duplicate path. A value that is no table is returned unchanged.
    """
    if not isinstance(tree, Mapping):
        return tree
    tidy: dict[str, Any] = {}
    for key, value in tree.items():
        interface, parameter = split(str(key))
        if key == EVERY and isinstance(value, Mapping):
            again = _merge(tidy, value)
        else:
            again = _merge(tidy, {parameter: value} if interface == EVERY else
                           {interface: {parameter: value}})  # fmt: skip
        if again:
            message = f"'{again}' stands there twice; write it once, without quotes"
            raise invalid([((str(key),), message)])
    return tidy


def _merge(tree: dict[str, Any], more: Mapping[str, Any]) -> str:
    """Merge `more` into `tree`; returns the dotted path of a duplicate, or ""."""
    for key, value in more.items():
        present = tree.get(key)
        if key not in tree:
            tree[key] = dict(value) if isinstance(value, Mapping) else value
        elif isinstance(present, dict) and isinstance(value, Mapping):
            again = _merge(present, value)
            if again:
                return f"{key}.{again}"
        else:
            return str(key)
    return ""


def without(tree: Mapping[str, Any], keys: Sequence[str | int]) -> dict[str, Any]:
    """A copy of nested tables without the value at `keys`, and without tables that become empty."""
    copy = dict(tree)
    key, *rest = keys
    if rest and isinstance(copy.get(str(key)), Mapping):
        copy[str(key)] = without(copy[str(key)], rest)
    if not rest or not copy[str(key)]:
        copy.pop(str(key), None)
    return copy


def as_written(raw: Any, keys: Keys) -> Keys:
    """Location of `keys` of a normalised table in the original one, with pydantic's labels."""
    if not isinstance(raw, Mapping):
        return keys
    table, *rest = keys
    written = raw.get(str(table))
    written = written if isinstance(written, Mapping) else {}
    path = ".".join(str(key) for key in rest[:2])
    if len(rest) == 2 and path in written:
        return table, path
    if len(rest) == 1 and f"{EVERY}.{rest[0]}" in written:
        return table, f"{EVERY}.{rest[0]}"
    if len(rest) == 1 and rest[0] not in written and EVERY in written:
        return table, EVERY, INTERFACE, rest[0]
    if not rest or rest[0] not in written:
        return keys
    label = () if len(rest) == 1 else (INTERFACE if len(rest) == 2 else "Scatter",)
    return (table, rest[0], *label, *rest[1:])


def invalid(wrong: Iterable[tuple[Keys, str]]) -> ValidationError:
    """Pydantic's error with each message at its location."""
    return ValidationError.from_exception_data(
        "Bench",
        [
            InitErrorDetails(
                # Pydantic would interpret a brace in a message as a placeholder.
                type=PydanticCustomError("friction_path", "{message}", {"message": message}),
                loc=keys,
                input=None,
            )
            for keys, message in wrong
        ],
    )
