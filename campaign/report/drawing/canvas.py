"""Sheets in the report's style, and their output as reproducible SVG.

Text remains text in the page's font. The page can replace the colours by its dark ones; a separate
file is for white paper.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

from campaign.report.drawing.cached_axes import settled
from campaign.report.drawing.math_type import in_svg
from campaign.report.drawing.pdf import keep_as_pdf
from campaign.report.palette import HAIRLINE, INK, MUTED, variables

if TYPE_CHECKING:
    from matplotlib.backends.backend_svg import RendererSVG
    from matplotlib.figure import Figure as Canvas

WIDTH = 180.0 / 25.4
"""Width of both columns of a journal (inches)."""
TITLE = 9.0
"""Size of a title (points)."""
TITLE_PAD = 7.0
"""Distance between the axes and their title (points)."""
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "campaign",
    "pdf.fonttype": 42,  # journals refuse Type 3
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.parse_math": False,  # a label is plain text, with any signs
    "axes.titlesize": TITLE,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": TITLE_PAD,
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK.light,
    "axes.edgecolor": MUTED.light,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-5, 6),
    "axes.xmargin": 0.02,
    "grid.color": HAIRLINE.light,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED.light,
    "ytick.color": MUTED.light,
    "xtick.labelcolor": INK.light,
    "ytick.labelcolor": INK.light,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "text.color": INK.light,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "lines.linewidth": 1.4,
    "lines.scale_dashes": True,
    "axes.titley": 1.0,  # fixed, because its search takes as long as drawing
    "savefig.transparent": True,
    "savefig.dpi": 200,
}
PADS: dict[str, Any] = {"w_pad": 3.0 / 72, "h_pad": 4.3 / 72, "wspace": 0.0, "hspace": 0.0}
"""Free space around axes with their labels, and around the legend (inches)."""
METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


@contextmanager
def style() -> Iterator[None]:
    """Use the report's style within the block, independent of the user's style."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


@contextmanager
def canvas(width: float, height: float) -> Iterator[Canvas]:
    """Empty matplotlib figure (inches) in the report's style."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from campaign.report.drawing.sheet import Sheet

    with style():
        sheet = Sheet(figsize=(width, height), dpi=72)  # the resolution of an SVG document
        FigureCanvasSVG(sheet).get_renderer = _measuring  # type: ignore[attr-defined]
        sheet.set_layout_engine(ConstrainedLayoutEngine(**PADS))
        yield sheet


@cache
def _measuring() -> RendererSVG:
    """Renderer that measures the texts of all sheets, and caches common texts.

    Otherwise each measurement would start a new document. Its size does not affect texts.
    """
    from matplotlib.backends.backend_svg import RendererSVG

    return RendererSVG(72.0, 72.0, io.StringIO(), image_dpi=72)  # type: ignore[no-untyped-call]


def to_svg(sheet: Canvas) -> str:
    """SVG document of a canvas; the same drawing results in the same bytes.

    Coordinates are truncated to a hundredth of a point; `slim` rounds those of curves further.
    """
    place_axes(sheet)
    out = io.StringIO()
    with settled(sheet.axes):
        sheet.savefig(out, format="svg", metadata=METADATA)
    keep_as_pdf(sheet)
    text = re.sub(r"[ \t]+$", "", out.getvalue(), flags=re.MULTILINE)
    text = re.sub(r'\b(d|x|y|points)="[^"]*"', lambda found: _DIGITS.sub(r"\1", found[0]), text)
    return in_svg(text)


def place_axes(sheet: Canvas) -> None:
    """Place the axes and remove the layout engine: it would draw everything twice on saving.

    The layout "none" leaves a placeholder engine; only None removes it.
    """
    engine = sheet.get_layout_engine()
    if engine is not None:
        engine.execute(sheet)
        sheet.set_layout_engine(None)


_DIGITS = re.compile(r"(\d\.\d\d)\d+")


def inline(svg: str, prefix: str, title: str, alt: str) -> str:
    """Convert an SVG document for use within a page: ids, the page's colours, alternative text.

    `prefix` must be unique on the page and valid in an id.
    """
    from markupsafe import escape

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>\s*", "", body, flags=re.DOTALL)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = body.replace('href="#', f'href="#{prefix}-').replace("url(#", f"url(#{prefix}-")
    body = _with_variables(body)
    head = (
        f'<svg role="img" aria-labelledby="{prefix}-title {prefix}-alt" class="plot"'
        f" {_view_box(body)} >"
        f'<title id="{prefix}-title">{escape(title)}</title>'
        f'<desc id="{prefix}-alt">{escape(alt)}</desc>'
    )
    return head + body[body.index(">") + 1 :]


def _with_variables(svg: str) -> str:
    """Replace each palette colour by its CSS variable, with the colour as the fallback."""
    by_colour: dict[str, str] = {}
    for name, (light, _) in variables().items():
        by_colour.setdefault(light, name)
    pattern = "|".join(re.escape(colour) for colour in sorted(by_colour))
    return re.sub(
        rf"(?<=[ :])({pattern})(?=[;\"])", lambda m: f"var(--{by_colour[m[1]]}, {m[1]})", svg
    )


def _view_box(svg: str) -> str:
    match = re.search(r'viewBox="[-0-9. ]+"', svg[: svg.index(">")])
    return match[0] if match else ""
