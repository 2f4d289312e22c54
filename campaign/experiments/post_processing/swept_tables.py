"""Names of swept values that are tables, such as friction models.

Pages show *lugre* or *stribeck* instead of all parameters, which are in the archive.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from pydantic import JsonValue

from campaign.trial import canonical_json, leaves

KINDS = ("model", "method", "kind")
"""Entries that state the kind of a table; its name begins with the kind."""


def table_names(values: Sequence[JsonValue]) -> dict[str, str]:
    """Name of each table among `values`, by its canonical JSON.

    The kind of the table, and each number or text that differs from another table of the same
    kind: `lugre`, or `lugre, coulomb_torque = 26`. Numbers are SI, as the tables are.
    """
    tables = {canonical_json(value): value for value in values if isinstance(value, dict)}
    entries = {key: dict(leaves(table)) for key, table in tables.items()}
    names = {}
    for key, own in entries.items():
        like = [other for other in entries.values() if _kind(other) == _kind(own)]
        differing = [
            path
            for path in own
            if any(path not in other or not _same(other[path], own[path]) for other in like)
        ]
        words = [f"{path} = {_text(own[path])}" for path in differing]
        names[key] = ", ".join(([_kind(own)] if _kind(own) else []) + words) or "as given"
    return _numbered(names)


def _numbered(names: Mapping[str, str]) -> dict[str, str]:
    """Number equal names, where kind and six digits do not distinguish the tables."""
    count = Counter(names.values())
    numbers: Counter[str] = Counter()
    unique = {}
    for key, name in names.items():
        numbers[name] += 1
        unique[key] = f"{name} #{numbers[name]}" if count[name] > 1 else name
    return unique


def _same(one: JsonValue, other: JsonValue) -> bool:
    return type(one) is type(other) and one == other


def _kind(leaves: Mapping[str, JsonValue]) -> str:
    return next((str(leaves[name]) for name in KINDS if name in leaves), "")


def _text(value: JsonValue) -> str:
    if value is None:
        return "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
