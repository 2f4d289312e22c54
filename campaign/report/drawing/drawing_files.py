"""Files of a drawing: compact SVG and CSV; minimum width for legible labels."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Self

from campaign.plain_text import on_a_page
from campaign.report.drawing.figure_csv import figure_csv
from campaign.report.drawing.slim_svg import slim
from campaign.result import Figure

LEGIBLE = 9.0
"""Minimum size of the smallest label of a figure (CSS pixels)."""


@dataclass(frozen=True)
class DrawingFiles:
    """A finished drawing.

    Attributes:
        svg: complete compact SVG document.
        csv: its numbers; empty for a picture that is not from an analysis.
    """

    svg: str
    csv: str = ""

    @classmethod
    def of(cls, svg: str, figure: Figure | None = None) -> Self:
        """Convert a drawn SVG document and its figure."""
        return cls(slim(svg), "" if figure is None else on_a_page(figure_csv(figure)))

    @property
    def box(self) -> tuple[float, float]:
        """Width and height in its own units."""
        match = re.search(r'viewBox="\S+ \S+ ([\d.]+) ([\d.]+)"', self.svg)
        return (float(match[1]), float(match[2])) if match else (1.0, 1.0)

    @property
    def least(self) -> int:
        """Width (CSS pixels) at which its smallest label has `LEGIBLE` pixels; 0 without labels."""
        fonts = [float(size) for size in re.findall(r"font-size:\s*([\d.]+)px", self.svg)]
        return math.ceil(LEGIBLE / min(fonts) * self.box[0]) if fonts else 0
