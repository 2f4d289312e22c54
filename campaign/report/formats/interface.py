"""The interface of a report format: the page as another file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from campaign.report.page.pieces import Piece


def _nothing() -> None:
    """Most formats need nothing but this program."""


@dataclass(frozen=True)
class WrittenPage:
    """A report or another page whose HTML, tables and figures are written already.

    Attributes:
        name: of its files, without suffix: the page is `NAME.html`.
        label: a short name for marks in a text, of letters, digits and dashes.
        pieces: what the page says, in its order.
        folder: where the page, `tables/` and `figures/` lie.
        pdfs: figures as PDF, by their names in the folder, where the format wants them.
        bibtex: an entry for the run; empty without one.
    """

    name: str
    label: str
    pieces: tuple[Piece, ...]
    folder: Path
    pdfs: Mapping[str, bytes]
    bibtex: str = ""


@dataclass(frozen=True)
class Format:
    """A format as `campaign report --format NAME` finds it.

    Attributes:
        write: adds its files to the folder. Raises UsageError; then there is no report at all.
        require: raises UsageError, before anything is done, when the machine lacks what it needs.
        pdf_figures: whether it wants the figures as PDF.
    """

    name: str
    summary: str
    write: Callable[[WrittenPage], None]
    require: Callable[[], None] = _nothing
    pdf_figures: bool = False
