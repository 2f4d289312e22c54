"""Units in the protocol text, by test and option."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from campaign.archive.layout.header import RunHeader
from campaign.protocol.matrix import RANGE_KEYS, flatten
from campaign.protocol.overrides import parse_overrides
from campaign.trial import leaves
from campaign.units import split_quantity

Written = Mapping[str, Mapping[str, str]]
"""By test: unit in the text of an option or of the matrix, by dotted path."""


def written_units(header: RunHeader) -> Written:
    """Units as written in the run's protocol and its `--set`; without unreadable ones."""
    by_test: dict[str, dict[str, str]] = {}
    for text in header.sources.values():
        for test in _tests(text):
            units = by_test.setdefault(str(test.get("name", "")), {})
            matrix = test.get("matrix")
            units |= _units({k: v for k, v in test.items() if k != "matrix"})
            units |= _swept_units(matrix if isinstance(matrix, dict) else {})
    settings, _ = parse_overrides([f"{path}={value}" for path, value in header.overrides.items()])
    for setting in settings:
        name, *keys = map(str, setting.keys)
        units, value = by_test.setdefault(name, {}), setting.value
        if keys[:1] == ["matrix"]:
            units |= _swept_units(_nested(keys[1:], value))
        else:
            units |= _units(_nested(keys, value))
    return by_test


def _tests(text: str) -> Iterator[Mapping[str, Any]]:
    """Tests of a source; none for a bench, a CSV file and an unreadable text."""
    try:
        tests = tomllib.loads(text).get("test")
    except (ValueError, RecursionError):
        return
    yield from (test for test in tests if isinstance(test, dict)) if isinstance(tests, list) else ()


def _units(tree: Mapping[str, Any]) -> dict[str, str]:
    """Unit by dotted path of all values with a unit in a tree; the first unit of a list counts."""
    units: dict[str, str] = {}
    for path, value in leaves(tree):
        for name, unit in _units_of(path, value):
            units.setdefault(name, unit)
    return units


def _swept_units(matrix: Mapping[str, Any]) -> dict[str, str]:
    units: dict[str, str] = {}
    for path, _, value in flatten(matrix):
        if isinstance(value, Mapping):
            value = [value[key] for key in sorted(RANGE_KEYS & value.keys())]
        for name, unit in _units_of(path, value):
            units.setdefault(name, unit)
    return units


def _units_of(path: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        yield from ((f"{path}.{name}", unit) for name, unit in _units(value).items())
    elif isinstance(value, list):
        for item in value:
            yield from _units_of(path, item)
    elif isinstance(value, str):
        try:
            unit = split_quantity(value)[1]
        except ValueError:
            return
        if unit:
            yield path, unit


def _nested(keys: Sequence[str], value: Any) -> dict[str, Any]:
    for key in reversed(keys):
        value = {key: value}
    return value if isinstance(value, dict) else {}
