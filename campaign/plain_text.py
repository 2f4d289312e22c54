"""Conversion of untrusted text for a terminal or a page."""

from __future__ import annotations

import json
import math
import unicodedata
from collections.abc import Mapping
from typing import Any, cast

REPLACEMENT = "?"
LONGEST = 2000
"""Maximum number of characters of a text from other code in the archive."""
DEEPEST = 8
"""Maximum depth of a tree from other code in the archive."""


def printable(text: str, keep: str = "") -> str:
    """`text` with `?` for characters that a terminal obeys or cannot show, except those of `keep`.

    These are control characters, changes of the writing direction, lone surrogates and unassigned
    characters. A space of any width becomes a plain space.
    """
    if text.isprintable():
        return text
    strange = {letter for letter in set(text) if not (letter.isprintable() or letter in keep)}
    # Faster for long texts than a check of each character.
    return (
        text.translate({ord(letter): _instead(letter) for letter in strange}) if strange else text
    )


def on_a_page(text: str) -> str:
    """`text` made safe for a file such as HTML, SVG, CSV. Line breaks and spaces are kept."""
    if text.replace("\n", "").replace("\t", "").isprintable():  # fast path of most texts
        return text
    spaces = {letter for letter in set(text) if unicodedata.category(letter) == "Zs"}
    return printable(text, keep="\n\t" + "".join(spaces))


def storable(text: object) -> str:
    """Text from other code for the archive: safe for a page, and of bounded length."""
    plain = on_a_page(text if isinstance(text, str) else f"({type(text).__name__}, no text)")
    return plain if len(plain) <= LONGEST else f"{plain[:LONGEST]}..."


def storable_tree(value: object, depth: int = 0) -> Any:
    """`value` as JSON, also of numpy; other types and deeper levels become their type's name."""
    if type(value).__module__ == "numpy":
        value = cast(Any, value).tolist()
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
    """Indented JSON without loss: unprintable characters are escaped."""
    text = json.dumps(tree, indent=2, ensure_ascii=False, allow_nan=False)
    strange = {letter for letter in set(text) if not letter.isprintable() and letter != "\n"}
    return text.translate({ord(letter): json.dumps(letter)[1:-1] for letter in strange} | _DELETE)


_DELETE = {0x7F: "\\u007f"}  # `json.dumps` does not escape it


def _instead(letter: str) -> str:
    return " " if unicodedata.category(letter) == "Zs" else REPLACEMENT
