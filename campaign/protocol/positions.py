"""Positions of keys and values in a TOML text.

`tomllib` gives values without positions. If an error needs a position, tree-sitter parses the text
again.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

Keys = tuple[str | int, ...]
"""A path into a TOML document, e.g. ("test", 0, "matrix", "bench.axis.inertia", 1)."""

Aim = Literal["key", "value"]
"""The part to report; the value of a table is its header, or the brace of an inline table."""


class Position(NamedTuple):
    """Line and column of a character, both from 1."""

    line: int
    column: int


class _Point(NamedTuple):
    """Line and byte in the line, both from 0, as in tree-sitter."""

    row: int
    byte: int


@dataclass(frozen=True, slots=True)
class _Entry:
    key: _Point
    value: _Point


class Positions:
    """The positions of one TOML document that `tomllib` accepts."""

    def __init__(self, text: str) -> None:
        encoded = text.encode()
        self._lines = encoded.split(b"\n")
        self._entries: dict[Keys, _Entry] = {}
        self._lengths: dict[Keys, int] = {}
        self._spans: dict[Keys, tuple[int, int]] = {}
        self.first_table: int | None = None
        """First byte of the first header of a table, in UTF-8; None without one."""
        self._read_document(_parse(encoded))

    def find(self, keys: Keys, aim: Aim = "value") -> Position:
        """Position of the entry at `keys`, or of the innermost entry around it."""
        for length in range(len(keys), 0, -1):
            entry = self._entries.get(keys[:length])
            if entry is not None:
                whole = aim == "value" and length == len(keys)
                return self._position(entry.value if whole else entry.key)
        return Position(1, 1)

    def span(self, keys: Keys) -> tuple[int, int] | None:
        """First byte of the value at `keys`, and the first byte after it, in UTF-8."""
        return self._spans.get(keys)

    def _read_document(self, root: Any) -> None:
        for node in root.children:
            if node.type in ("table", "table_array_element") and self.first_table is None:
                self.first_table = node.start_byte
            match node.type:
                case "pair":
                    self._read_pair(node, ())
                case "table":
                    self._read_table(node, self._resolve(self._header(node)))
                case "table_array_element":
                    self._read_table(node, self._next_element(self._header(node)))

    def _read_table(self, node: Any, keys: Keys) -> None:
        here = _point(node)
        name = next((child for child in node.children if child.type in _KEYS), node)
        last = list(_key_parts(name))[-1][1] if name is not node else node
        # Only its own header names an element of an array of tables.
        key = here if keys and isinstance(keys[-1], int) else _point(last)
        self._entries[keys] = _Entry(key, here)
        for child in node.children:
            if child.type == "pair":
                self._read_pair(child, keys)

    def _read_pair(self, node: Any, keys: Keys) -> None:
        key_node = node.children[0]
        # A comment after the value is a child of the pair, too.
        value_node = next((c for c in node.children[1:] if c.type in _VALUES), node.children[-1])
        for part, part_node in _key_parts(key_node):
            keys = (*keys, part)
            here = _point(part_node)
            self._entries.setdefault(keys, _Entry(here, here))
        self._entries[keys] = _Entry(self._entries[keys].key, _point(value_node))
        self._spans[keys] = (value_node.start_byte, value_node.end_byte)
        self._read_value(value_node, keys)

    def _read_value(self, node: Any, keys: Keys) -> None:
        if node.type == "inline_table":
            for child in node.children:
                if child.type == "pair":
                    self._read_pair(child, keys)
        elif node.type == "array":
            elements = (child for child in node.children if child.type in _VALUES)
            for index, child in enumerate(elements):
                here = _point(child)
                self._entries[(*keys, index)] = _Entry(here, here)
                self._read_value(child, (*keys, index))

    def _header(self, node: Any) -> list[tuple[str, Any]]:
        name = next((child for child in node.children if child.type in _KEYS), None)
        return list(_key_parts(name)) if name is not None else []

    def _resolve(self, parts: list[tuple[str, Any]]) -> Keys:
        """Path of a header; a name that is an array of tables means its last element."""
        keys: Keys = ()
        for part, node in parts:
            keys = (*keys, part)
            here = _point(node)
            self._entries.setdefault(keys, _Entry(here, here))
            if keys in self._lengths:
                keys = (*keys, self._lengths[keys] - 1)
        return keys

    def _next_element(self, parts: list[tuple[str, Any]]) -> Keys:
        keys = (*self._resolve(parts[:-1]), *(part for part, _ in parts[-1:]))
        if parts:
            here = _point(parts[-1][1])
            self._entries.setdefault(keys, _Entry(here, here))
        index = self._lengths.get(keys, 0)
        self._lengths[keys] = index + 1
        return (*keys, index)

    def _position(self, point: _Point) -> Position:
        # tree-sitter counts bytes, editors count characters. Convert only requested positions: a
        # line may be as long as the file.
        before = self._lines[point.row][: point.byte].decode(errors="replace")
        return Position(point.row + 1, len(before) + 1)


def _point(node: Any) -> _Point:
    row, byte = node.start_point
    return _Point(row, byte)


_KEYS = frozenset({"bare_key", "quoted_key", "dotted_key"})
_VALUES = frozenset(
    {"string", "integer", "float", "boolean", "array", "inline_table"}
    | {"local_date", "local_time", "local_date_time", "offset_date_time"}
)


def _parse(encoded: bytes) -> Any:
    import tree_sitter
    import tree_sitter_toml

    language = tree_sitter.Language(tree_sitter_toml.language())
    return tree_sitter.Parser(language).parse(encoded).root_node


def _key_parts(node: Any) -> Iterator[tuple[str, Any]]:
    """Each part of a key with its node: a.b."c d" has three."""
    if node.type == "dotted_key":
        for child in node.children:
            if child.type in _KEYS:
                yield from _key_parts(child)
    elif node.type == "quoted_key":
        yield next(iter(tomllib.loads(f"{node.text.decode()} = 0"))), node
    else:
        yield node.text.decode(), node
