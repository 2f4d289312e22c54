"""The interface of a report format: the page as another file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from campaign.report.page.pieces import Piece


@dataclass(frozen=True)
class WrittenPage:
    """A report or another page whose HTML, tables and figures are already written.

    Attributes:
        name: name of its files, without suffix: the page is `NAME.html`.
        label: short name for labels in a text, of letters, digits and dashes.
        pieces: content of the page, in order.
        folder: folder with the page, `tables/` and `figures/`.
        pdfs: figures as PDF, by path in the folder, if a format requests them.
        bibtex: entry for the run; empty without one.
    """

    name: str
    label: str
    pieces: tuple[Piece, ...]
    folder: Path
    pdfs: Mapping[str, bytes]
    bibtex: str = ""


@dataclass(frozen=True)
class Format:
    """A report format, selected by `campaign report --format NAME`.

    Attributes:
        write: adds its files to the folder. May raise UsageError; then no report is written.
        require: raises UsageError at the start when the machine lacks a requirement.
        pdf_figures: whether it needs the figures as PDF.
    """

    name: str
    summary: str
    write: Callable[[WrittenPage], None]
    require: Callable[[], None] = lambda: None
    pdf_figures: bool = False
