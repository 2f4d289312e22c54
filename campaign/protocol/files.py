"""Reading untrusted TOML files."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol

from campaign.errors import Problem
from campaign.protocol.positions import Aim, Keys, Position, Positions

LARGEST_FILE = 4 * 1024 * 1024
"""Maximum file size (bytes); a protocol of handwritten tests has some kilobytes."""
MOST_VALUES = 200_000
"""Maximum values of a protocol with its includes, or of a bench; 100 000 trials have fewer."""
DEEPEST_NESTING = 32
"""Maximum levels of tables and lists; deeper text only serves to exhaust a parser."""

Kind = Literal["protocol", "bench"]
SCHEMA: Mapping[Kind, int] = {"protocol": 2, "bench": 3}
"""The current version, the only readable one; incremented if a key is renamed or removed, or
changes its meaning."""
MARKS: Mapping[Kind, frozenset[str]] = {
    "protocol": frozenset({"test", "include"}),
    "bench": frozenset({"axis", "motor", "limits", "friction"}),
}
"""Keys that only one kind of file has."""
_TAKEN_BY: Mapping[Kind, str] = {
    "protocol": "`campaign plan` takes protocols",
    "bench": "`campaign check` takes benches",
}

LONGEST_PATH = 400
"""Maximum number of characters of a path in a message."""


class UnreadableError(Exception):
    """A file that cannot be read as text, with the reason for the user."""


@dataclass(frozen=True)
class Source:
    """One TOML file.

    Attributes:
        file: as the user named it, for messages.
        name: key among the sources of a protocol, as written there.
        text: verbatim.
        tree: its values.
    """

    file: Path
    name: str
    text: str
    tree: dict[str, Any]

    @cached_property
    def positions(self) -> Positions:
        return Positions(self.text)

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        """A problem at `keys`."""
        return Problem(self.file, *self.positions.find(keys, aim), message)


class Origin(Protocol):
    """The source of a tree of values, which gives each problem its place."""

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem: ...


@dataclass(frozen=True)
class Within:
    """The part of a tree that begins at `prefix`."""

    source: Origin
    prefix: Keys = ()

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        return self.source.problem((*self.prefix, *keys), aim, message)


@dataclass(frozen=True)
class Typed:
    """A value given on the command line, with the option's name."""

    text: str

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        return Problem(Path(self.text), 0, 0, message)


@dataclass(frozen=True)
class PatchedTree:
    """A tree with some values from other places; the latest patch has precedence."""

    base: Origin
    patches: Sequence[tuple[Keys, Origin]]

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        for path, origin in reversed(self.patches):
            if keys[: len(path)] == path:
                return origin.problem(keys[len(path) :], aim, message)
        return self.base.problem(keys, aim, message)


def read_source(file: Path, name: str, kind: Kind | None = None) -> Source | list[Problem]:
    """The TOML file, or the problems of its text. Raises UnreadableError if it has no text.

    `kind`: the required kind of file; the file may state its schema.
    """
    text = read_text(file)
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return [_syntax_problem(file, text, error)]
    except RecursionError:
        return [Problem(file, 0, 0, f"nested deeper than {DEEPEST_NESTING} levels")]
    except ValueError as error:  # a number with thousands of digits
        return [Problem(file, 0, 0, f"not readable as TOML: {error}")]
    if count_values(tree) > MOST_VALUES:
        return [Problem(file, 0, 0, TOO_MANY)]
    if any(len(keys) > DEEPEST_NESTING for keys, _ in _leaves(tree)):
        return [Problem(file, 0, 0, f"nested deeper than {DEEPEST_NESTING} levels")]
    source = Source(file, name, text, tree)
    if kind and (problem := _other_kind(source, kind) or _other_schema(source, kind)):
        return [problem]
    oversized = [
        source.problem(keys, "value", "an integer of more than 64 bits")
        for keys, value in _leaves(tree)
        if isinstance(value, int) and not -(2**63) <= value < 2**63
    ]
    return oversized or source


def _other_kind(source: Source, kind: Kind) -> Problem | None:
    """The problem of a bench in place of a protocol, or of the reverse."""
    other: Kind = "bench" if kind == "protocol" else "protocol"
    if source.tree.keys() & MARKS[kind] or not source.tree.keys() & MARKS[other]:
        return None
    message = f"this is a {other}, and a {kind} is asked for; {_TAKEN_BY[other]}"
    return Problem(source.file, 0, 0, message)


def _other_schema(source: Source, kind: Kind) -> Problem | None:
    """Remove `schema` from the tree; return the problem if it is not the current one."""
    given = source.tree.pop("schema", SCHEMA[kind])
    if type(given) is int and given == SCHEMA[kind]:
        return None
    message = (
        f"this program reads {kind}s of schema {SCHEMA[kind]}, not {given!r}; "
        "use the program of that schema, or write today's keys without this line"
    )
    return source.problem(("schema",), "value", message)


TOO_MANY = (
    f"more than {MOST_VALUES} values, the most that is read; "
    "{ start, stop, num } sweeps many, and a CSV file holds a series"
)


def count_values(tree: Any) -> int:
    """Number of values and tables of a document; counting stops above `MOST_VALUES`."""
    count, stack = 0, [tree]
    while stack and count <= MOST_VALUES:
        value = stack.pop()
        if isinstance(value, dict | list):
            count += len(value)
            inside = value.values() if isinstance(value, dict) else value
            stack.extend(item for item in inside if isinstance(item, dict | list))
    return count


def read_text(file: Path) -> str:
    """Text of a regular UTF-8 file of a reasonable size. Raises UnreadableError."""
    try:
        if file.is_dir():
            raise UnreadableError("a folder, not a TOML file")
        if not file.exists():
            raise UnreadableError("no such file")
        if not file.is_file():
            raise UnreadableError("not a regular file")
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise UnreadableError(f"cannot be read: {reason}") from None
    if len(content) > LARGEST_FILE:
        raise UnreadableError(f"larger than {LARGEST_FILE // 2**20} MiB, the most that is read")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise UnreadableError(f"not UTF-8 text (byte {error.start + 1}, line {line})") from None


def looked_for(file: Path) -> str:
    """The path of a missing file for a message, shortened: names may have any length."""
    text = str(file)
    return f"(looked for {text if len(text) <= LONGEST_PATH else f'{text[:LONGEST_PATH]}...'})"


_AT = re.compile(r"\s*\(at (?:line (\d+), column (\d+)|end of document)\)\s*\Z")


def _syntax_problem(file: Path, text: str, error: tomllib.TOMLDecodeError) -> Problem:
    """Python 3.14 gives the position in attributes, earlier ones in the message only."""
    message = _AT.sub("", getattr(error, "msg", str(error)))
    line, column = getattr(error, "lineno", None), getattr(error, "colno", None)
    match = _AT.search(str(error))
    if line is None and match is not None and match[1]:
        line, column = int(match[1]), int(match[2])
    if line is None or column is None:
        last = text.replace("\r\n", "\n").split("\n")
        line, column = Position(len(last), len(last[-1]) + 1)
    return Problem(file, line, column, f"not valid TOML: {message[:1].lower()}{message[1:]}")


def _leaves(tree: Any) -> Iterator[tuple[Keys, Any]]:
    """Every value that is no table and no list, without recursion."""
    stack: list[tuple[Keys, Any]] = [((), tree)]
    while stack:
        keys, value = stack.pop()
        if isinstance(value, dict):
            items: Iterator[tuple[str | int, Any]] = iter(value.items())
        elif isinstance(value, list):
            items = iter(enumerate(value))
        else:
            yield keys, value
            continue
        if len(keys) > DEEPEST_NESTING:
            yield keys, None
            continue
        stack.extend(((*keys, key), item) for key, item in items)
