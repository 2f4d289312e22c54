"""Drawings on a page: what looks alike is one path, and looks as before."""

from __future__ import annotations

import re

import pytest

from campaign.report.page.merged_marks import merged

SIGNS = """<svg viewBox="0 0 9 9">
<defs>
<path id="a" d="m0 0v3.5" style="stroke:#123456"/>
<path id="b" d="m-2 0 4 2v-4z"/>
<path id="c" d="m0 2.25c.6 0 1-.2 1.6-.6z" style="stroke:#ffffff"/>
</defs>
"""


def drawn(*lines: str, group: str = '<g style="fill:#7a6a00">') -> str:
    text = merged("\n".join((f"{SIGNS}{group}", *lines, "</g>", "</svg>")))
    return text.partition("</defs>\n")[2].removesuffix("\n</svg>")


def use(name: str, x: float, y: float = 1) -> str:
    return f'<use xlink:href="#{name}" x="{x}" y="{y}"/>'


def test_marks_of_a_curve_are_one_path_where_they_were() -> None:
    path = '<path style="fill:#7a6a00" d="M1 1l4 2v-4zM3 1.5l4 2v-4z"/>'
    assert drawn(use("b", 3), use("b", 5, 1.5)) == path


def test_ticks_and_grid_lines_are_one_path_each_past_their_words() -> None:
    lines = [
        line
        for x in (10, 20)
        for line in (
            f'<path d="m{x} 5v-148.5" style="stroke:#d9dde1"/>',
            use("a", x),
            f'<text x="{x}" y="9">{x}</text>',
        )
    ]
    assert drawn(*lines).split("\n")[1:-1] == [
        '<path d="M10 5v-148.5M20 5v-148.5" style="stroke:#d9dde1"/>',
        '<path d="M10 1v3.5M20 1v3.5" style="stroke:#123456"/>',
        '<text x="10" y="9">10</text>',
        '<text x="20" y="9">20</text>',
    ]


def test_a_group_for_its_texts_alone_does_not_part_ticks() -> None:
    lines = [
        line
        for x in (10, 20)
        for line in (
            '<g style="stroke-width:0.6;text-anchor:end">',
            f'<path d="m{x} 5v-3.5" style="stroke:#d9dde1"/>',
            f'<text style="fill:#1c1f23" x="{x}" y="9">{x}</text>',
            '<text style="text-anchor:start" x="0" y="9">label</text>',
            "</g>",
        )
    ]
    found = drawn(*lines)
    tick = '<path d="M10 5v-3.5M20 5v-3.5" style="stroke:#d9dde1;stroke-width:0.6"/>'
    assert found.split("\n")[1] == tick
    assert found.count('style="fill:#1c1f23;text-anchor:end"') == 2
    assert found.count('style="text-anchor:start"') == 2
    assert found.count("<g") == 1


CURVE = '<path d="m1 2 3 4 5 6" style="stroke:#000000"/>'


@pytest.mark.parametrize(
    ("lines", "group"),
    [
        ([use("c", 1), use("c", 2)], '<g style="fill:#7a6a00">'),  # an edge of another colour
        ([use("b", 1), use("b", 2)], '<g style="fill:#7a6a00;fill-opacity:0.2">'),
        (['<use xlink:href="#b" x="1" class="st-a"/>'] * 2, "<g>"),
        (['<use xlink:href="#b" x="1">', "<title>one</title>", "</use>"] * 2, "<g>"),
        (['<path d="m1 1v2" transform="rotate(9)"/>'] * 2, "<g>"),
    ],
)
def test_what_would_look_otherwise_stays(lines: list[str], group: str) -> None:
    assert drawn(*lines, group=group).split("\n")[1:-1] == lines


def test_marks_go_past_no_curve() -> None:
    found = drawn(use("b", 3), CURVE, use("b", 5))
    assert re.findall('<path d="(.)', found) == ["M", "m", "M"]


def test_a_sign_alone_takes_the_place_of_its_group() -> None:
    named = '<g class="st-a">\n<title>a</title>\n<path d="m1 2 3 4 5 6" style="fill:none"/>\n</g>'
    assert drawn(*named.split("\n"), use("b", 1), group="<g>").split("\n")[1] == (
        '<path class="st-a" d="m1 2 3 4 5 6" style="fill:none"><title>a</title></path>'
    )


def test_a_clip_stays_where_it_was() -> None:
    """On `use` a clip moves with x and y, and would hide the mark."""
    alone = '<g clip-path="url(#z)">\n' + use("c", 30) + "\n</g>"
    told = drawn(*alone.split("\n"), group="<g>")
    assert "<use" not in told
    assert '<path clip-path="url(#z)" d="M30 3.25c.6' in told


def test_signs_that_nothing_uses_any_more_are_gone() -> None:
    text = merged(f"{SIGNS}{use('b', 1)}\n{use('c', 1)}\n</svg>")
    assert re.findall('id="(.)"', text) == ["c"]
