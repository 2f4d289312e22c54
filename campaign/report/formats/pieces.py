"""What a report is written from, piece by piece, where no template makes it: plain text as data."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.report.page.folder import ShownFigure


@dataclass(frozen=True)
class Heading:
    """`level` 1 is the report's title; `anchor` is the page's, where it has one."""

    level: int
    text: str
    anchor: str = ""


@dataclass(frozen=True)
class Paragraph:
    """Sentences; `warns` where a reader must not miss them."""

    text: str
    warns: bool = False


@dataclass(frozen=True)
class Items:
    """Things said one below the other."""

    texts: tuple[str, ...]


@dataclass(frozen=True)
class Facts:
    """Names and what stands for them."""

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

    title: str
    text: str
    language: str = ""


Piece = Heading | Paragraph | Items | Facts | ShownFigure | Grid | Source
