"""Pieces of a page, common to all formats."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from campaign.report.page.folder import Download, ShownFigure, ShownTable


@dataclass(frozen=True)
class Heading:
    """`level` 1 is the title; `anchor` is the page's, where it has one."""

    form: ClassVar = "heading"
    level: int
    text: str
    anchor: str = ""


@dataclass(frozen=True)
class Paragraph:
    """Sentences; `role` is what they are to a reader."""

    form: ClassVar = "paragraph"
    text: str
    role: Literal["", "lead", "note", "warning"] = ""


@dataclass(frozen=True)
class Items:
    """Things said one below the other."""

    form: ClassVar = "items"
    texts: tuple[str, ...]


@dataclass(frozen=True)
class Facts:
    """Names and what stands for them."""

    form: ClassVar = "facts"
    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Grid:
    """A table as text.

    Attributes:
        number: the page's; None for a table that has none.
        right: per column, whether its cells stand to the right.
        notes: sentences below it.
        file: all of it, as CSV in the folder; empty without.
    """

    form: ClassVar = "grid"
    number: int | None
    anchor: str
    title: str
    headers: tuple[str, ...]
    right: tuple[bool, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    file: str = ""


@dataclass(frozen=True)
class Source:
    """A text that is shown as it stands, letter by letter."""

    form: ClassVar = "source"
    title: str
    text: str
    language: str = ""


@dataclass(frozen=True)
class Files:
    """Files beside the page, each behind what is said of it."""

    form: ClassVar = "files"
    told: tuple[tuple[str, Download], ...]


@dataclass(frozen=True)
class FoldedSection:
    """What a reader unfolds; formats that cannot fold show it."""

    form: ClassVar = "folded"
    summary: str
    pieces: tuple[Piece, ...]


Piece = (
    Heading
    | Paragraph
    | Items
    | Facts
    | ShownFigure
    | ShownTable
    | Grid
    | Source
    | Files
    | FoldedSection
)


def grid_of(shown: ShownTable) -> Grid:
    """A table of the page as text."""
    content = shown.content
    left_out = [f"{content.left_out} more rows are in the file."] if content.left_out else []
    return Grid(
        shown.number,
        shown.anchor,
        f"{shown.title}.{published(shown.published, 'Table')}",
        content.headers,
        tuple(cell.number for cell in content.rows[0]) if content.rows else (),
        tuple(tuple(cell.text for cell in row) for row in content.rows),
        (*filter(None, (shown.note,)), *content.notes, *left_out),
        shown.download.file,
    )


def all_plain(pieces: Iterable[Piece]) -> tuple[Piece, ...]:
    """Pieces as formats write them that know neither folds nor downloads."""
    return tuple(each for piece in pieces for each in plain(piece))


def plain(piece: Piece) -> tuple[Piece, ...]:
    """A piece as such formats write it."""
    match piece:
        case ShownTable():
            return (grid_of(piece),)
        case Files():
            told = (f"{text} {download.file}" for text, download in piece.told)
            return (Paragraph("; ".join(told) + "."),)
        case FoldedSection():
            return Paragraph(f"{piece.summary}:"), *all_plain(piece.pieces)
        case _:
            return (piece,)


def caption(shown: ShownFigure) -> str:
    """A figure's caption, with what to compare it with."""
    return f"{shown.caption}{published(shown.published, 'Figure')}"


def published(numbers: Sequence[str], what: str) -> str:
    """Which tables or figures of the source to compare with; empty without any."""
    if not numbers:
        return ""
    return f" Compare {what}{'s' * (len(numbers) > 1)} {', '.join(numbers)} of the source."
