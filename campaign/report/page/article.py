"""A page of pieces: comparisons, trends, identifications."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from campaign.report.page.folder import Folder
from campaign.report.page.pieces import Facts, Heading, Items, Paragraph, Piece


@dataclass(frozen=True)
class Part:
    """A section.

    Attributes:
        contents: what the table of contents calls it; its heading when empty.
    """

    anchor: str
    heading: str
    pieces: tuple[Piece, ...]
    contents: str = ""
    role: Literal["", "test", "problems"] = ""


@dataclass(frozen=True)
class Article:
    """A page, in its order.

    Attributes:
        name: of its files, without suffix.
        kind: what it is, in a word.
        command: what to type for it.
        facts: with a letter where there are several of a kind.
        folder: the figures and tables beside it.
        content: what is said of it to programs alone, as JSON has it.
    """

    name: str
    kind: str
    command: str
    title: str
    lede: str
    facts: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]
    parts: tuple[Part, ...]
    folder: Folder
    content: Mapping[str, Any] = field(default_factory=dict)

    def pieces(self) -> Iterator[Piece]:
        """All of it, one piece after another."""
        yield Heading(1, self.title)
        yield Paragraph(self.lede)
        for letter, pairs in self.facts:
            yield Facts(tuple((f"{letter}: {name}" if letter else name, t) for name, t in pairs))
        for part in self.parts:
            yield Heading(2, part.heading, part.anchor)
            yield from part.pieces


def damage_text(what: str, damaged: Sequence[object]) -> str:
    """That an archive is damaged, and what that costs."""
    places = f"{len(damaged)} place{'s' if len(damaged) > 1 else ''}"
    return f"{what}: the archive is damaged in {places}; what cannot be read takes no part."


def problems_part(what: str, told: Sequence[str]) -> tuple[Part, ...]:
    """What a reader must know first; nothing without problems."""
    if not told:
        return ()
    return (Part("problems", f"Problems with {what}", (Items(tuple(told)),), role="problems"),)
