"""Files of a drawing: the compact SVG, and its CSV; how wide its labels want it."""

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
"""CSS pixels that the smallest label of a figure has at least."""


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

    @property
    def box(self) -> tuple[float, float]:
        """Width and height in its own units."""
        found = re.search(r'viewBox="\S+ \S+ ([\d.]+) ([\d.]+)"', self.svg)
        return (float(found[1]), float(found[2])) if found else (1.0, 1.0)

    @property
    def least(self) -> int:
        """CSS pixels that it must be wide for its smallest label to be `LEGIBLE`; 0 without any."""
        fonts = [float(size) for size in re.findall(r"font-size:\s*([\d.]+)px", self.svg)]
        return math.ceil(LEGIBLE / min(fonts) * self.box[0]) if fonts else 0
