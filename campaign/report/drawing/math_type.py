"""Symbols of labels in math type, and true minus signs.

Experiments write `σ0` or `T_c` in plain text. A symbol becomes italic and its index upright
(ISO 80000-1) in all formats: in an SVG document by spans of the text, in others by matplotlib's
mathtext.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.backend_bases import RendererBase

SHARE = 0.75
"""Size of an index relative to its text: 6 pt at 8 pt, the minimum of Elsevier's guide."""
LEAST = 8.6
"""Minimum size (points) of a text with an index in mathtext, whose fixed share is 0.7."""
DOWN = 0.2
"""Distance of an index below the baseline of its text (em)."""

_SYMBOL = re.compile(
    r"(?<![^\W\d_])(?:"
    r"(?P<greek>[α-ορσ-ωΔ])(?P<digits>[0-9]|[₀-₉]|_[a-z0-9]+)?(?![^\W\d_]|\d)"
    r"|(?P<index>[A-Za-z]̇?)_(?P<word>[a-z0-9]{1,3}|[₀-₉])(?!\w)"
    r"|(?P<short>[TKv])(?P<tail>(?<=T)[csf]|(?<=v)s|(?<=K)[0₀te])(?!\w)"
    r"|(?P<alone>J′?'?|\b[sv](?=\()|(?<=\()v(?=\))|(?<=[0-9₀-₉] )v\b|\bN(?= K[0₀])|(?<=/)T(?=\|)))"
)
_MINUS = re.compile(r"(?<![\w.)])-(?=\d)")
_LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")


def pieces(text: str) -> Iterator[tuple[str, str, str]]:
    """(text before, symbol, index) for each symbol; then the remaining text with neither."""
    text = _MINUS.sub("−", text)
    here = 0
    for match in _SYMBOL.finditer(text):
        symbol = match["greek"] or match["index"] or match["short"] or match["alone"]
        index = match["digits"] or match["word"] or match["tail"] or ""
        yield text[here : match.start()], symbol, index.removeprefix("_").translate(_LOWERED)
        here = match.end()
    yield text[here:], "", ""


def in_mathtext(text: str) -> tuple[str, bool]:
    """Label for matplotlib, and whether matplotlib must parse it as math."""
    parts = list(pieces(text))
    if len(parts) == 1:
        return parts[0][0], False
    return "".join(_mathtext(*each) for each in parts), True


def _mathtext(words: str, symbol: str, index: str) -> str:
    words = words.replace("$", r"\$")
    if not symbol:
        return words
    dotted = rf"\dot{{{symbol[0]}}}" if symbol.endswith("̇") else symbol
    return words + rf"$\mathit{{{dotted}}}" + (rf"_{{\mathrm{{{index}}}}}$" if index else "$")


def in_svg(svg: str) -> str:
    """Set the symbols of a matplotlib SVG document in math type; its texts must be text."""
    return re.sub(r"(?<=>)([^<>]+)(?=</text>)", lambda text: _spans(text[1]), svg)


def _spans(text: str) -> str:
    written, lowered = "", False
    for words, symbol, index in pieces(text):
        for style, part in (("", words), ("font-style: italic; font-weight: normal", symbol)):
            back = f' dy="-{SHARE * DOWN:g}em"' if lowered and part else ""
            look = f' style="{style}"' if style else ""
            written += f"<tspan{back}{look}>{part}</tspan>" if part and (back or look) else part
            lowered = lowered and not part
        if index:
            size = f"font-size: {100 * SHARE:g}%; font-weight: normal"
            written += f'<tspan dy="{DOWN:g}em" style="{size}">{index}</tspan>'
            lowered = True
    return written


@contextmanager
def math_type(renderer: RendererBase) -> Iterator[None]:
    """Let `renderer` set symbols in math type within the block, except in an SVG document."""
    from matplotlib.backends.backend_svg import RendererSVG

    if isinstance(getattr(renderer, "_renderer", renderer), RendererSVG):
        yield
        return
    plain: Callable[..., None] = renderer.draw_text
    measured = renderer.get_text_width_height_descent

    def draw_text(
        gc: Any, x: float, y: float, s: str, prop: Any, angle: float, ismath: Any, mtext: Any
    ) -> None:
        shown, parsed = in_mathtext(s)
        if parsed:
            turned = math.radians(angle)
            spare = measured(s, prop, ismath=False)[0]
            prop = prop.copy()
            prop.set_size(max(prop.get_size_in_points(), LEAST))
            spare -= measured(shown, prop, ismath=True)[0]
            placed = mtext.get_horizontalalignment() if mtext else "left"  # one line of several
            spare *= {"left": 0.0, "center": 0.5, "right": 1.0}[placed]
            x += spare * math.cos(turned)
            y += spare * math.sin(turned) * (-1.0 if renderer.flipy() else 1.0)
        plain(gc, x, y, shown, prop, angle, ismath=parsed, mtext=mtext)

    renderer.draw_text = draw_text  # type: ignore[assignment, method-assign]
    try:
        yield
    finally:
        renderer.draw_text = plain  # type: ignore[method-assign]
