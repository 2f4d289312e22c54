"""Untrusted text made safe for a terminal or a page."""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Mapping
from typing import Any

REPLACEMENT = "?"
LONGEST = 2000
"""letters of a text that other code hands to the archive."""
DEEPEST = 8
"""levels of a tree, likewise."""


def printable(text: str, keep: str = "") -> str:
    """`text` with `?` for what a terminal would obey or not show, but for the letters of `keep`.

    That is control characters, those that turn the direction of writing, lone surrogates and what
    has no meaning; a space of any width becomes a space.
    """
    if text.isprintable():
        return text
    strange = {letter for letter in set(text) if not (letter.isprintable() or letter in keep)}
    # A long text that has nothing strange is soon through, and would not be letter by letter.
    return (
        text.translate({ord(letter): _instead(letter) for letter in strange}) if strange else text
    )


def on_a_page(text: str) -> str:
    """`text` as a file may hold it that people open: HTML, SVG, CSV. Lines and spaces stay."""
    if text.replace("\n", "").replace("\t", "").isprintable():  # as most are, however long
        return text
    spaces = {letter for letter in set(text) if unicodedata.category(letter) == "Zs"}
    return printable(text, keep="\n\t" + "".join(spaces))


def storable(text: object) -> str:
    """Text from other code as an archive keeps it: on a page, and of bounded length."""
    plain = on_a_page(text if isinstance(text, str) else f"({type(text).__name__}, no text)")
    return plain if len(plain) <= LONGEST else f"{plain[:LONGEST]}..."


def storable_tree(value: object, depth: int = 0) -> Any:
    """`value` as JSON: other types, and what is too deep, by the name of the type."""
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if value is None or (isinstance(value, int) and abs(value) < 2**63):
        return value
    if depth < DEEPEST and isinstance(value, Mapping):
        return {storable(key): storable_tree(each, depth + 1) for key, each in value.items()}
    if depth < DEEPEST and isinstance(value, list | tuple):
        return [storable_tree(each, depth + 1) for each in value]
    return storable(value)


def json_text(tree: Any) -> str:
    """Indented JSON in which every letter that is not printable is escaped: nothing is lost."""
    text = json.dumps(tree, indent=2, ensure_ascii=False, allow_nan=False)
    strange = {letter for letter in set(text) if not letter.isprintable() and letter != "\n"}
    return text.translate({ord(letter): json.dumps(letter)[1:-1] for letter in strange} | _DELETE)


_DELETE = {0x7F: "\\u007f"}  # which `json.dumps` takes for a letter


def _instead(letter: str) -> str:
    return " " if unicodedata.category(letter) == "Zs" else REPLACEMENT
