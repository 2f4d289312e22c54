"""Matplotlib figure that a notebook displays without pyplot."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from campaign.report.drawing.math_type import math_type


class Sheet(Figure):
    """A figure with an SVG for notebooks, which show plain matplotlib figures only with pyplot."""

    def draw(self, renderer: Any) -> None:
        """Draw with symbols in math type; an SVG document gets them afterwards (`to_svg`)."""
        with math_type(renderer):
            super().draw(renderer)

    def _repr_svg_(self) -> str:
        """SVG for a notebook, identical to the report's file."""
        from campaign.report.drawing.canvas import style, to_svg
        from campaign.report.drawing.slim_svg import slim

        with style():
            return slim(to_svg(self))
