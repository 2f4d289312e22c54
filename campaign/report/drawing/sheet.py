"""A matplotlib figure that a notebook shows by itself."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from campaign.report.drawing.math_type import math_type


class Sheet(Figure):
    """A figure; notebooks show one of matplotlib's own only where pyplot was set up for it."""

    def draw(self, renderer: Any) -> None:
        """With symbols in math type, in whichever format; an SVG document gets them behind."""
        with math_type(renderer):
            super().draw(renderer)

    def _repr_svg_(self) -> str:
        """In a notebook: the drawing, with the bytes of the report's file."""
        from campaign.report.drawing.canvas import style, to_svg
        from campaign.report.drawing.slim_svg import slim

        with style():
            return slim(to_svg(self))
