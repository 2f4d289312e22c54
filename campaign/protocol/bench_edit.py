"""Editing the `[known]` table of a bench file; all else stays unchanged."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from campaign.errors import UsageError
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import fingerprint
from campaign.protocol.positions import Positions
from campaign.protocol.problems import find_faults

_HEADER = re.compile(r"^[ \t]*\[[ \t]*known[ \t]*[\].]", re.M)
"""Header of the table `known`, or of a table within it."""


def with_known(text: str, entries: Mapping[str, Any], name: str) -> str:
    """The text of a bench with `entries` and the resulting fingerprint in its table `known`.

    Args:
        entries: plain values, tables and lists; a table is merged into the existing one.
        name: of the file, for messages.

    Raises UsageError if the keys of the file have a form that cannot be edited.
    """
    from tomlkit.exceptions import TOMLKitError

    try:
        changed = _edited(text, entries)
        bench = _bench(changed)
        if isinstance(bench, str):
            raise UsageError(f"{name}: with what is to be written it is no bench: {bench}")
        stated = fingerprint(bench).model_dump(mode="json")
        changed = _edited(changed, {"fingerprint": stated})
        again = _bench(changed)
        stands = isinstance(again, Bench) and again.known.fingerprint == fingerprint(bench)
    except (TOMLKitError, LookupError, ValueError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{name}: its keys are written in a form that cannot be edited; write [known] as a "
            "table of its own"
        ) from error
    if not stands:
        raise UsageError(f"{name}: its fingerprint cannot be written; write it by hand: {stated}")
    return changed


def _bench(text: str) -> Bench | str:
    """The bench in a text, or its problems; ValueError for invalid TOML."""
    tree = tomllib.loads(text)
    tree.pop("schema", None)  # a key of the file, not of the bench
    valid = find_faults(Bench, tree)
    return "; ".join(message for _, _, message in valid) if isinstance(valid, list) else valid


def _edited(text: str, entries: Mapping[str, Any]) -> str:
    """`text` with entries of `known`, each at its existing place, else in the table."""
    import tomlkit

    newline = "\r\n" if "\r\n" in text else "\n"
    document = tomlkit.parse(text.replace("\r\n", "\n"))
    if "known" in document:
        _put(document["known"], entries, in_line=_HEADER.search(text) is None)
        return document.as_string().replace("\n", newline)
    return _with_table(document.as_string(), entries).replace("\n", newline)


def _put(known: Any, entries: Mapping[str, Any], *, in_line: bool = False) -> None:
    """Set entries of `known`; `in_line`: it has no header, and nor can the tables in it."""
    import tomlkit

    for key, value in entries.items():
        if key == "correlations":
            known[key] = tomlkit.array()
            known[key].extend(value)
            known[key].multiline(not in_line)
            continue
        if key != "values":
            known[key] = _inline(value)
            continue
        if key not in known:
            known[key] = tomlkit.inline_table() if in_line else tomlkit.table()
        for path, one in value.items():
            known[key][path] = _inline(one)


def _inline(value: Any) -> Any:
    """A table as an inline table; other values unchanged."""
    import tomlkit

    if not isinstance(value, Mapping):
        return value
    table = tomlkit.inline_table()
    for key, item in value.items():
        table[key] = _inline(item)
    return table


def _with_table(text: str, entries: Mapping[str, Any]) -> str:
    """`text` with a table `known` before its first table and the comment above that."""
    import tomlkit

    document = tomlkit.document()
    document["known"] = tomlkit.table()
    _put(document["known"], entries)
    first = Positions(text).first_table
    content = text.encode()
    before, after = content[:first].decode(), "" if first is None else content[first:].decode()
    lines = before.splitlines(keepends=True)
    place = len(lines)
    while place and lines[place - 1].startswith("#"):
        place -= 1
    gap = "" if not place or lines[place - 1].strip() == "" else "\n"
    block = document.as_string().strip("\n")
    return f"{''.join(lines[:place])}{gap}{block}\n\n{''.join(lines[place:])}{after}"
