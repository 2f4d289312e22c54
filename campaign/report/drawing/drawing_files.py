"""Files of a drawing: the compact SVG, and its CSV."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from campaign.plain_text import on_a_page
from campaign.report.drawing.figure_csv import figure_csv
from campaign.report.drawing.slim_svg import slim
from campaign.result import Figure


@dataclass(frozen=True)
class DrawingFiles:
    """A finished drawing.

    Attributes:
        svg: a complete SVG document, as short as it can be.
        csv: its numbers; empty for a picture that no analysis made.
    """

    svg: str
    csv: str = ""

    @classmethod
    def of(cls, svg: str, figure: Figure | None = None) -> Self:
        """Of an SVG document as it was drawn, and of what it shows."""
        return cls(slim(svg), "" if figure is None else on_a_page(figure_csv(figure)))
