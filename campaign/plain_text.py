"""Text from elsewhere, fit for a terminal."""

from __future__ import annotations


def printable(text: str, keep: str = "") -> str:
    """`text` with `?` for what a terminal would obey or not show, but for the letters of `keep`."""
    return "".join(letter if letter.isprintable() or letter in keep else "?" for letter in text)
