"""Drawing jobs of the figures of a page.

Looks are the same on the whole page, and curves have published values. Both depend on the whole
document, but not on other drawings. Therefore any process can make drawings in any order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

from campaign.api.analysis import AnalysedTest
from campaign.published.scoreboard import Scoreboard
from campaign.published.values import Published
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.figures import draw, draw_sheet, series_of
from campaign.report.drawing.published_marks import Marks, PublishedBeside, published_text
from campaign.report.drawing.scoreboard_picture import draw_overview
from campaign.report.palette import Look, looks_of_page
from campaign.result import Figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

AXES = 10
"""Time to draw axes, in units of the time of a curve."""

Key = tuple[str, str]
"""Name of a test and key of its figure."""
OVERVIEW: Key = ("", "scoreboard")
"""Key of the scoreboard's picture, which belongs to no test."""


class Drawable(Protocol):
    """Drawing job for any process."""

    @property
    def work(self) -> int:
        """Relative time of the job."""

    def made(self) -> DrawingFiles | None:
        """Make the drawing; None when there is nothing to draw."""


@dataclass(frozen=True)
class Overview:
    """Drawing job of the scoreboard's picture."""

    scoreboard: Scoreboard

    @property
    def work(self) -> int:
        return len(self.scoreboard.lines)

    def made(self) -> DrawingFiles | None:
        svg = draw_overview(self.scoreboard)
        return None if svg is None else DrawingFiles.of(svg)


@dataclass(frozen=True)
class Drawing:
    """Drawing job of a figure with its published values, and with the looks of its page."""

    figure: Figure
    marks: Marks = field(default_factory=dict)
    looks: Mapping[str, Look] | None = None

    @property
    def work(self) -> int:
        # The layout of axes takes most of the time, for any number of curves.
        return sum(AXES + len(panel.curves) for panel in self.figure.panels)

    def svg(self) -> str:
        """Draw as a complete SVG document."""
        return draw(self.figure, self.marks, self.looks)

    def sheet(self) -> Canvas:
        """Draw as a matplotlib figure."""
        return draw_sheet(self.figure, self.marks, self.looks)

    def made(self) -> DrawingFiles:
        return DrawingFiles.of(self.svg(), self.figure)


def drawings_of(tests: Sequence[AnalysedTest], compared: Published) -> dict[Key, Drawing]:
    """Drawing jobs of all tests; a figure that causes an error is missing.

    compared: published values of the run's protocol.
    """
    series: dict[Key, list[str]] = {}
    for test in tests:
        for figure in test.result.figures:
            with suppress(Exception):  # of a plug-in; the layout reports it
                series[test.name, figure.key] = series_of(figure)
    looks = looks_of_page(series.values())
    drawings: dict[Key, Drawing] = {}
    for test in tests:
        beside = PublishedBeside.of(compared, test.reproduces, test.evidence().known)
        for figure in test.result.figures:
            key = test.name, figure.key
            with suppress(Exception):
                own = {name: looks[name] for name in series[key]}
                drawings[key] = _drawing(figure, beside, own)
    return drawings


def _drawing(figure: Figure, beside: PublishedBeside, looks: Mapping[str, Look]) -> Drawing:
    marks = beside.marks(figure)
    caption = f"{figure.caption} {published_text(marks)}".rstrip()
    return Drawing(replace(figure, caption=caption), marks, looks)
