"""What a format is: it writes what the page shows as another file into the report's folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from campaign.report.page.damage_notice import Notice
    from campaign.report.page.layout import Layout


def _nothing() -> None:
    """Most formats need nothing but this program."""


@dataclass(frozen=True)
class Written:
    """A report whose page, tables and figures are written already.

    Attributes:
        layout: what the page shows.
        damage: that the archive is damaged, where it is.
        folder: where `report.html`, `tables/` and `figures/` lie.
    """

    layout: Layout
    damage: Notice | None
    folder: Path


@dataclass(frozen=True)
class Format:
    """A format as `campaign report --format NAME` finds it.

    Attributes:
        write: adds its files to the folder. Raises UsageError; then there is no report at all.
        require: raises UsageError, before anything is done, when the machine lacks what it needs.
        pdf_figures: whether it wants the figures as PDF: `layout.folder.pdfs`.
    """

    name: str
    summary: str
    write: Callable[[Written], None]
    require: Callable[[], None] = _nothing
    pdf_figures: bool = False
