"""Symbols of labels are math in every format, and names stay names."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pypdf
import pytest

from campaign.report.content.symbols import SYMBOLS
from campaign.report.drawing.figures import draw, draw_sheet
from campaign.report.drawing.math_type import LEAST, SHARE, in_mathtext, in_svg, pieces
from campaign.report.drawing.slim_svg import slim
from campaign.result import Axis, Curve, Figure, Mark, Panel

X = np.linspace(-3.0, 3.0, 7)
SHOWN = Figure(
    "key",
    "Title",
    "Caption.",
    "Alt.",
    (
        Panel(
            Axis("σ0", "N m/rad", places=((-2.0, "T_c\nnot reached"), (2.0, "T_s"))),
            Axis("Cost $5, v_s", "m/s"),
            [Curve(X, X, "δ = 2", "fit"), Curve(X, -X, "-1 by name-2", "measured")],
            "Over T_f",
            [Mark("at q̇_s", x=0.5)],
        ),
    ),
)


def spans(svg: str) -> list[tuple[str, str]]:
    """Each text, and the italic and lowered parts of it in brackets and braces."""
    found = []
    for text in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"):
        written = text.text or ""
        for span in text:
            style = span.get("style", "")
            form = "[{}]" if "italic" in style else "{{{}}}" if "font-size" in style else "{}"
            written += form.format(span.text) + (span.tail or "")
        found.append(("".join(text.itertext()), written))
    return found


def test_an_svg_document_has_symbols_in_the_middle_of_its_texts() -> None:
    found = dict(spans(slim(draw(SHOWN))))
    assert found["σ0"] == "[σ]{0}"
    assert found["Ts"] == "[T]{s}"
    assert found["Cost $5, vs (m/s)"] == "Cost $5, [v]{s} (m/s)"
    assert found["δ = 2"] == "[δ] = 2"
    assert found["Over Tf"] == "Over [T]{f}"
    assert found["at q̇s"] == "at [q̇]{s}"
    assert found["−1 by name-2"] == "−1 by name-2"
    assert not [text for text in found if re.search(r"(?<!\w)-\d", text)]


def test_what_follows_an_index_is_on_the_line_again() -> None:
    shifts = [float(dy) for dy in re.findall(r'dy="(-?[\d.]+)em"', in_svg("<text>T_c v</text>"))]
    down, up = shifts
    assert up == pytest.approx(-SHARE * down)


def test_a_pdf_has_symbols_in_italics_and_smaller_indices() -> None:
    out = io.BytesIO()
    draw_sheet(SHOWN).savefig(out, format="pdf")
    seen: dict[str, set[tuple[str, float]]] = {}

    def keep(text: str, _: object, matrix: list[float], font: Any, size: float) -> None:
        for letter in text if font else "":
            seen.setdefault(letter, set()).add((font["/BaseFont"].rpartition("+")[2], size))

    pypdf.PdfReader(io.BytesIO(out.getvalue())).pages[0].extract_text(visitor_text=keep)
    assert {font for letter in "σδT" for font, _ in seen[letter]} == {"DejaVuSans-Oblique"}
    sizes = {size for each in seen.values() for _, size in each}
    assert min(sizes) >= 6.0
    assert max(sizes) <= 9.0
    assert LEAST * 0.7 >= 6.0


@pytest.mark.parametrize("symbol", [each for each in SYMBOLS if len(each.symbol) > 1])
def test_every_symbol_of_the_source_document_is_one(symbol) -> None:
    for each in symbol.symbol.split(", "):
        assert [(before, bool(name)) for before, name, _ in pieces(each)] == [
            ("", True),
            ("", False),
        ]


@pytest.mark.parametrize(
    "text",
    [
        "10 N·m at 6.8 deg/s",
        "Torque (N·m·s/rad)",
        "Resistance (Ω)",
        "Angle (µrad)",
        "bench_1 of T_shirts",
        "2026-11-29, run-3",
        "Voltage vst Test",
        "2π",
        r"$\frac{<script>&",
    ],
)
def test_names_and_units_are_no_symbols(text: str) -> None:
    assert in_mathtext(text) == (text, False)


def test_money_stays_money_beside_a_symbol() -> None:
    assert in_mathtext("$5 of σ0") == (r"\$5 of $\mathit{σ}_{\mathrm{0}}$", True)


def test_a_sheet_draws_as_before_when_it_was_drawn() -> None:
    sheet = draw_sheet(SHOWN)
    first, second = io.BytesIO(), io.BytesIO()
    for out in (first, second):
        sheet.savefig(out, format="png")
    assert first.getvalue() == second.getvalue()
    assert [text.get_text() for text in sheet.legends[0].get_texts()] == ["δ = 2", "-1 by name-2"]
