"""Pieces of a page, common to all formats."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from campaign.report.page.folder import Download, ShownFigure, ShownTable


@dataclass(frozen=True)
class Heading:
    """A heading; `level` 1 is the title; `anchor`: anchor on the page, or ""."""

    form: ClassVar = "heading"
    level: int
    text: str
    anchor: str = ""


@dataclass(frozen=True)
class Paragraph:
    """Sentences with their role on the page."""

    form: ClassVar = "paragraph"
    text: str
    role: Literal["", "lead", "note", "warning"] = ""


@dataclass(frozen=True)
class Items:
    """A list of texts."""

    form: ClassVar = "items"
    texts: tuple[str, ...]


@dataclass(frozen=True)
class Facts:
    """Pairs of name and value."""

    form: ClassVar = "facts"
    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Grid:
    """A table as text.

    Attributes:
        number: number on the page; None without one.
        right: whether cells are right-aligned, by column.
        notes: sentences below the table.
        file: CSV file of the whole table in the folder; empty without one.
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
    """A verbatim text."""

    form: ClassVar = "source"
    title: str
    text: str
    language: str = ""


@dataclass(frozen=True)
class Files:
    """Files beside the page, each with the text before it."""

    form: ClassVar = "files"
    told: tuple[tuple[str, Download], ...]


@dataclass(frozen=True)
class FoldedSection:
    """A section that is folded at first; formats without folds show it."""

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
    """Convert a table of the page to text."""
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
    """Convert pieces for formats without folds and downloads."""
    return tuple(each for piece in pieces for each in plain(piece))


def plain(piece: Piece) -> tuple[Piece, ...]:
    """Convert a piece for formats without folds and downloads."""
    match piece:
        case ShownTable():
            return (grid_of(piece),)
        case Files():
            texts = (f"{text} {download.file}" for text, download in piece.told)
            return (Paragraph("; ".join(texts) + "."),)
        case FoldedSection():
            return Paragraph(f"{piece.summary}:"), *all_plain(piece.pieces)
        case _:
            return (piece,)


def caption(shown: ShownFigure) -> str:
    """Caption of a figure, with the published figures to compare."""
    return f"{shown.caption}{published(shown.published, 'Figure')}"


def published(numbers: Sequence[str], what: str) -> str:
    """Sentence on the tables or figures of the source to compare; empty without any."""
    if not numbers:
        return ""
    return f" Compare {what}{'s' * (len(numbers) > 1)} {', '.join(numbers)} of the source."
