"""`campaign migrate`: protocols and benches of an older schema, brought forward."""

from __future__ import annotations

import json
import os
import re
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from campaign.cli.output import print_line, print_note
from campaign.errors import ExitCode, ProtocolError, UsageError
from campaign.protocol.files import NEWEST, Kind, Source, UnreadableError, read_source, read_text
from campaign.protocol.migrations import Change, kind_of, migrate


def migrate_files(files: Sequence[Path], output: Path | None, *, check: bool) -> ExitCode:
    """Rewrite each file in the present schema, or only say what that would change.

    DONE when nothing is left to do; TRIALS_FAILED (1) when a person has to decide something, or
    when `check` finds anything. Nothing is written of a file that a person has to look at, and
    nothing at all when one of them cannot be read (UsageError, ProtocolError).
    """
    if output is not None and (len(files) != 1 or output.exists()):
        why = "is there already" if output.exists() else "is one file; migrate one at a time"
        raise UsageError(f"--output {output}: {why}")
    left = False
    found = [(file, migrated(file)) for file in files]
    for file, (kind, text, changes) in found:
        by_hand = any(change.by_hand for change in changes)
        left |= by_hand or (check and bool(changes))
        for change in changes:
            _say(file, change, planned=check or by_hand)
        if not changes:
            print_line(f"{file}: {kind} schema {NEWEST[kind]}, nothing to change")
        if by_hand:
            print_note(f"{file}: not written: decide that first, then migrate again", "yellow")
        elif not check and (changes or output is not None):
            _write(output or file, text)
            print_line(f"{output or file}: {kind} schema {NEWEST[kind]} now")
    # When every file is written: a bench may be given together with its protocols.
    for file in [file for file, (kind, *_) in found if kind == "protocol"]:
        if older := _older_benches(file):
            names = ", ".join(older)
            print_note(f"{file}: names benches of an older schema; migrate them, too: {names}")
    return ExitCode.TRIALS_FAILED if left else ExitCode.DONE


def migrated(file: Path) -> tuple[Kind, str, list[Change]]:
    """What kind of file it is, its text in the present schema, and what had to change."""
    try:
        source = read_source(file, file.name)
        written = read_text(file)
    except UnreadableError as error:
        raise UsageError(f"{file}: {error}") from None
    if not isinstance(source, list):
        kind = kind_of(source.tree)
        source = read_source(file, file.name, kind)  # which knows other schemas
    if isinstance(source, list):
        raise ProtocolError(source)
    text = written.replace("\r\n", "\n")
    values = tomllib.loads(text)
    changes = migrate(values, kind)
    if not changes or any(change.by_hand for change in changes):
        return kind, written, changes
    try:
        text = _edited(text, kind, {**values, "schema": NEWEST[kind]})
    except _NotEditableError as error:
        return kind, written, [_by_hand(change, str(error)) for change in changes]
    return kind, text.replace("\n", "\r\n") if "\r\n" in written else text, changes


class _NotEditableError(Exception):
    """Why the text of a file cannot be rewritten without losing something of it."""


def _by_hand(change: Change, why: str) -> Change:
    return replace(change, what=f"{change.what}; {why}", by_hand=True)


_COMMENT = re.compile(
    r'"""(?:\\.|[^\\])*?"""+|"(?:\\.|[^"\\\n])*"'
    r"|'''.*?'''+|'[^'\n]*'"
    r"|(?P<comment>#[^\n]*)",
    re.S,
)
"""A string, which may have a # in it, or a comment."""


def _edited(text: str, kind: Kind, values: dict[str, Any]) -> str:
    """`text` with `values` and all of its comments. Raises _NotEditableError.

    Comments are numbered while it is edited, so that each is known again. One behind a value that
    the edit drops gets a line of its own before it.
    """
    comments = [match["comment"] for match in _COMMENT.finditer(text) if match["comment"]]
    numbers = iter(range(len(comments)))
    text = _COMMENT.sub(lambda m: f"#{next(numbers)}" if m["comment"] else m[0], text)
    new = _migrated_text(text, kind)
    if lost := set(range(len(comments))) - set(_numbers(new)):
        new = _migrated_text(_above(text, lost), kind)
    if sorted(_numbers(new)) != list(range(len(comments))):
        raise _NotEditableError("a comment would be lost")
    new = _COMMENT.sub(lambda m: comments[int(m[0][1:])] if m["comment"] else m[0], new)
    if _comparable(tomllib.loads(new)) != _comparable(values):
        raise _NotEditableError(_FORM)
    return new


_FORM = "its keys are written in a form that cannot be edited"


def _migrated_text(text: str, kind: Kind) -> str:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        document = tomlkit.parse(text)
        migrate(document, kind)
        if "schema" in document:
            document["schema"] = NEWEST[kind]
            new = document.as_string()
        else:
            new = f"schema = {NEWEST[kind]}\n{document.as_string()}"
        tomllib.loads(new)
    except (TOMLKitError, LookupError, ValueError, TypeError, AttributeError, AssertionError):
        raise _NotEditableError(_FORM) from None  # what tomllib accepts, and tomlkit does not
    return new


def _numbers(text: str) -> Iterator[int]:
    for match in _COMMENT.finditer(text):
        if match["comment"]:
            yield int(match["comment"][1:])


def _above(text: str, lost: set[int]) -> str:
    """`text` with those comments, each behind a value, on a line before it."""
    lines = []
    for line in text.split("\n"):
        match = re.fullmatch(r"(\s*)(\S.*?)\s*#([0-9]+)", line)
        if match is not None and int(match[3]) in lost:
            lines += [f"{match[1]}#{match[3]}", match[1] + match[2]]
        else:
            lines.append(line)
    return "\n".join(lines)


def _comparable(values: dict[str, Any]) -> str:
    """Equal for equal values, NaN included, whatever the order of keys."""
    return json.dumps(values, sort_keys=True, default=repr)


def _older_benches(file: Path) -> list[str]:
    """The benches of a protocol, as it names them, that have former spellings."""
    older = []
    for name in dict.fromkeys(_bench_names(tomllib.loads(read_text(file)))):
        try:
            bench = read_source(file.parent / name, name)
        except UnreadableError:
            continue  # loading the protocol says so
        if isinstance(bench, Source):
            given = bench.tree.get("schema", 1)
            if isinstance(given, int) and given >= 1 and migrate(bench.tree, "bench"):
                older.append(name)
    return older


def _bench_names(value: Any) -> Iterator[str]:
    """Every bench that is named by its file, wherever in a protocol."""
    if isinstance(value, list):
        for item in value:
            yield from _bench_names(item)
    elif isinstance(value, dict):
        for key, item in value.items():
            if key == "bench" and isinstance(item, str) and re.search(r"[/\\]|\.toml$", item):
                yield item
            else:
                yield from _bench_names(item)


def _say(file: Path, change: Change, *, planned: bool) -> None:
    if change.by_hand:
        print_line(f"{file}: {change.place}: BY HAND: {change.what}")
    else:
        print_line(f"{file}: {change.place}: {'to do: ' if planned else ''}{change.what}")


def _write(file: Path, text: str) -> None:
    """In place of what is there, whole or not at all, with its permissions."""
    try:
        target = file.resolve()  # a link stays a link
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as out:
                out.write(text.encode())
                out.flush()
                os.fsync(out.fileno())
            mode = target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask()
            Path(name).chmod(mode)
            Path(name).replace(target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise UsageError(f"{file}: cannot be written: {error.strerror}") from None


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
