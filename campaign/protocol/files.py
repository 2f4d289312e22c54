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
"""bytes; a protocol of hand-written tests has some kilobytes."""
MOST_VALUES = 200_000
"""of a protocol with its includes, of a bench; 100 000 trials have fewer."""
DEEPEST_NESTING = 32
"""levels of tables and lists; deeper text only serves to exhaust a parser."""

Kind = Literal["protocol", "bench"]
SCHEMA: Mapping[Kind, int] = {"protocol": 2, "bench": 3}
"""The present one, which alone is read; raised when a key is renamed, removed or means something
else."""
MARKS: Mapping[Kind, frozenset[str]] = {
    "protocol": frozenset({"test", "include"}),
    "bench": frozenset({"axis", "motor", "limits", "friction"}),
}
"""Keys that one kind of file has and the other has not."""
_TAKEN_BY: Mapping[Kind, str] = {
    "protocol": "`campaign plan` takes protocols",
    "bench": "`campaign check` takes benches",
}

LONGEST_PATH = 400
"""letters of a path that are shown."""


class UnreadableError(Exception):
    """Why a file cannot be read as text, for the user."""


@dataclass(frozen=True)
class Source:
    """One TOML file.

    Attributes:
        file: as the user named it, for messages.
        name: among the sources of a protocol, as written there.
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
        """A problem with what stands at `keys`."""
        return Problem(self.file, *self.positions.find(keys, aim), message)


class Origin(Protocol):
    """Where a tree of values comes from: a place for each of its problems."""

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem: ...


@dataclass(frozen=True)
class Within:
    """The part of a tree that begins at `prefix`."""

    source: Origin
    prefix: Keys = ()

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        return self.source.problem((*self.prefix, *keys), aim, message)


@dataclass(frozen=True)
class At:
    """One place that stands for whatever is wrong with a value put there, e.g. a swept one."""

    source: Source
    keys: Keys
    aim: Aim = "value"

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        return self.source.problem((*self.keys, *keys), aim if keys else self.aim, message)


@dataclass(frozen=True)
class Typed:
    """A value given on the command line, with the option's name."""

    text: str

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        return Problem(Path(self.text), 0, 0, message)


@dataclass(frozen=True)
class PatchedTree:
    """A tree of which some values come from elsewhere; the latest patch wins."""

    base: Origin
    patches: Sequence[tuple[Keys, Origin]]

    def problem(self, keys: Keys, aim: Aim, message: str) -> Problem:
        for path, origin in reversed(self.patches):
            if keys[: len(path)] == path:
                return origin.problem(keys[len(path) :], aim, message)
        return self.base.problem(keys, aim, message)


def read_source(file: Path, name: str, kind: Kind | None = None) -> Source | list[Problem]:
    """The TOML file, or what is wrong with its text; UnreadableError when there is no text.

    `kind`: what the file must be; it may say which schema it has.
    """
    text = read_text(file)
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return [_syntax_problem(file, text, error)]
    except RecursionError:
        return [Problem(file, 0, 0, f"nested deeper than {DEEPEST_NESTING} levels")]
    except ValueError as error:  # a number of thousands of digits
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
    """The problem of a bench in place of a protocol, or the other way round."""
    other: Kind = "bench" if kind == "protocol" else "protocol"
    if source.tree.keys() & MARKS[kind] or not source.tree.keys() & MARKS[other]:
        return None
    told = f"this is a {other}, and a {kind} is asked for; {_TAKEN_BY[other]}"
    return Problem(source.file, 0, 0, told)


def _other_schema(source: Source, kind: Kind) -> Problem | None:
    """Take `schema` out of the tree; the problem of one that is not the present one."""
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
    """Values and tables of a document; as many as make it too many, where there are more."""
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
    """Where a file was looked for, in a line: a name in a protocol may be of any length."""
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
