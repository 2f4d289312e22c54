"""A drawing in fewer bytes and shapes paints what it painted before."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from types import ModuleType
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from campaign.experiments.interface import TestData
from campaign.report.drawing.canvas import inline
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.figures import draw
from campaign.report.drawing.short_paths import CURVES, SIGNS, short_path
from campaign.report.drawing.slim_svg import slim
from campaign.result import Axis, Curve, Figure, Mark, Panel

ABOUT = 0.0501
"""Half of a tenth, and a rounding error; of signs, which are round, half of a hundredth."""
ABOUT_SIGNS = 0.0051
NOT_INHERITED = {"opacity", "clip-path"}
INITIAL = {
    "fill": "#000000",
    "stroke": "none",
    "stroke-width": "1",
    "stroke-linecap": "butt",
    "stroke-linejoin": "miter",
    "stroke-dasharray": "none",
}
Numbers = tuple[float, ...]


def figures(made_up: ModuleType) -> Iterator[Figure]:
    """Lines, points, bars, bands, log axes, dense scatters and hostile words."""
    data = TestData("t", "t", {}, ())
    yield from made_up.stabilization(data).figures
    yield from made_up.velocity_map(data).figures
    x = np.linspace(1, 9, 60)
    words = "<b>&\"' σ₀ – µrad"
    many = np.random.default_rng(5).normal(size=(2, 3000))
    yield Figure(
        "odd",
        words,
        words,
        words,
        (
            Panel(
                Axis(words),
                Axis("y", scale="log"),
                [
                    Curve(x, x, words, "measured", "points", low=x - 0.5, high=x + 2),
                    Curve(x, x * x, "step", "static", "line+points"),
                    Curve(x, np.where(x < 5, x, np.nan), "gap", "fit", "thin"),
                ],
                words,
                [Mark(words, x=3.0), Mark("level", y=20.0)],
            ),
            Panel(Axis("x"), Axis("y"), [Curve(*many, "dense", "other", "points")]),
            Panel(Axis("x"), Axis("y"), [Curve(x, np.full(60, np.nan), "nothing")]),
        ),
    )


@pytest.mark.slow
def test_what_is_painted_stays(made_up: ModuleType) -> None:
    for figure in figures(made_up):
        before = draw(figure)
        after = slim(before)
        if "<image" not in before:
            sizes = [len(zlib.compress(text.encode())) for text in (before, after)]
            assert sizes[1] < 0.62 * sizes[0], figure.key
        old, new = looks(before), looks(after)
        assert old.keys() == new.keys()
        signs = {how for shape, how, _ in painted(before) if shape == "small"}
        for how, places in old.items():
            about = ABOUT_SIGNS if how in signs else ABOUT
            for was, is_ in zip(places, new[how], strict=True):
                path = how[0] == "path"
                assert follows(was, is_, about) if path else was == pytest.approx(is_, abs=about), (
                    how
                )


@pytest.mark.slow
def test_the_same_drawing_gives_the_same_bytes(made_up: ModuleType) -> None:
    for figure in figures(made_up):
        svg = draw(figure)
        assert slim(svg) == slim(svg)
        assert slim(svg).startswith('<?xml version="1.0" encoding="utf-8"?>\n<svg ')
        page = inline(slim(svg), "figure-3", "t", "a")
        ids = re.findall(r'\bid="([^"]*)"', page)
        assert all(name.startswith("figure-3-") for name in ids)
        used = set(re.findall(r'(?:href="|url\()#([^")]+)', page))
        assert used == set(ids) - {"figure-3-title", "figure-3-alt"}


@pytest.mark.parametrize(("parts", "about"), [(CURVES, ABOUT), (SIGNS, ABOUT_SIGNS)])
def test_paths_of_steps_do_not_drift(parts: int, about: float) -> None:
    """Two thousand random steps end where they should: rounding errors do not add up."""
    places = np.cumsum(np.random.default_rng(7).normal(size=(2000, 2)), axis=0)
    text = "M " + "\nL ".join(f"{x:.6f} {y:.6f}" for x, y in places)
    found = points(short_path(text, parts))
    assert np.abs(found[-2:] - places[-1]).max() < about
    assert follows(tuple(places.ravel()), found, about)


@pytest.mark.parametrize(
    ("path", "short"),
    [
        ("M 0 0\nL 10 0\nL 10 5.5\nz", "m0 0h10v5.5z"),
        ("M 1 1\nL 2 2\nL 2.01 2.02\nL 3 4", "m1 1 1 1 1 2"),  # a step of nothing
        ("M 1 1\nL 2 2\nL 4 4\nL 4 5\nL 4 7", "m1 1 3 3v3"),  # steps that go on
        ("M 1 1\nL 4 1\nL 2 1\nz", "m1 1h3-2z"),  # steps that go back
        ("M 1.26 1\nL 2 2", "m1.3 1 .7 1"),
        ("M 3 4\nL 3 4", "m3 4h0"),  # a dot stays one
        ("M 1 2\nL 3 4\nM 5 6\nL 7 8", "m1 2 2 2m2 2 2 2"),
        ("M 1 2\nM 5 6\nL 7 8", "m1 2m4 4 2 2"),  # a move that follows a move
        ("M 0 1\nC 1.5 2 3 4 5 6", "m0 1c1.5 1 3 3 5 5"),
        ("", ""),
    ],
)
def test_paths_are_short(path: str, short: str) -> None:
    assert short_path(path) == short
    assert follows(points(path), points(short), ABOUT)


SPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
SIGNS_THERE = """<defs>
<path id="a" d="M 0 0&#10;L 0 3.5&#10;" style="stroke: #123456"/>
<path id="b" d="M -2 0&#10;L 2 2&#10;L 2 -2&#10;z&#10;"/>
<path id="c" d="M 0 2.25&#10;C 0.6 2.25 1 2 1.6 1.5&#10;z&#10;" style="stroke: #ffffff"/>
<path id="d" d="M 0 1.256&#10;C 1.123 2 3 4 5 6&#10;"/>
<path id="e" d="M 0 0&#10;L 100.256 1&#10;L 3 4&#10;z&#10;"/>
<clipPath id="z"><rect x="0" y="0" width="9" height="9"/></clipPath>
</defs>"""
CURVE = '<path d="M 1 2&#10;L 3 4&#10;L 5 7" style="fill: none; stroke: #000000"/>'


def drawn(*lines: str, group: str = '<g style="fill: #7a6a00">') -> list[str]:
    """The lines that are drawn of these, behind the signs that they use."""
    text = slim("\n".join((f"<svg {SPACES}>{SIGNS_THERE}{group}", *lines, "</g></svg>")))
    return text.partition("round")[2].split("\n")[1:-3]


def use(name: str, x: float, y: float = 1) -> str:
    return f'<use xlink:href="#{name}" x="{x}" y="{y}"/>'


def test_a_sign_is_drawn_finer_than_a_curve_and_a_band_is_a_curve() -> None:
    sign, band = drawn(use("d", 3.256), CURVE, use("e", 3.256))[::2]
    assert 'd="m3.26 2.26c1.12' in sign
    assert 'd="m3.3 1 100.2 1' in band


def test_marks_of_a_curve_are_one_path_where_they_were() -> None:
    path = '<path d="m1 1 4 2v-4zm2 .5 4 2v-4z" style="fill:#7a6a00" />'
    assert drawn(use("b", 3), use("b", 5, 1.5)) == [path]


def test_ticks_and_grid_lines_are_one_path_each_past_their_words() -> None:
    lines = [
        line
        for x in (10, 20)
        for line in (
            f'<path d="M {x} 150&#10;L {x} 5&#10;" style="stroke: #d9dde1"/>',
            use("a", x),
            f'<g><text x="{x}" y="9">{x}</text></g>',
        )
    ]
    assert drawn(*lines, group="<g>") == [
        '<path d="m10 150v-145m10 145v-145" style="stroke:#d9dde1" />',
        '<path d="m10 1v3.5m10-3.5v3.5" style="stroke:#123456" />',
        '<text x="10" y="9">10</text>',
        '<text x="20" y="9">20</text>',
    ]


@pytest.mark.parametrize(
    ("lines", "group"),
    [
        ([use("c", 1), use("c", 2)], '<g style="fill: #7a6a00">'),  # an edge of another colour
        ([use("b", 1), use("b", 2)], '<g style="fill: #7a6a00; fill-opacity: 0.2">'),
        ([f'<g class="st-a"><title>one</title>{use("b", 1)}</g>'] * 2, "<g>"),
        (['<path d="M 1 1&#10;L 1 2" transform="rotate(9)"/>'] * 2, "<g>"),
        ([use("b", 3), CURVE, use("b", 5)], "<g>"),  # marks go past no curve
    ],
)
def test_what_would_look_otherwise_stays(lines: list[str], group: str) -> None:
    assert len(drawn(*lines, group=group)) == len(lines)


def test_a_mark_with_words_of_its_own_has_them_and_the_clip_of_its_group() -> None:
    named = f'<g class="st-a" clip-path="url(#z)"><title>one</title>{use("c", 30)}</g>'
    (told,) = drawn(named, group="<g>")
    assert told.startswith('<path clip-path="url(#c0)" class="st-a" d="m30 3.25c')
    assert "<title>one</title></path>" in told


def test_what_is_turned_is_clipped_in_the_coordinates_of_its_group() -> None:
    (told,) = drawn('<text transform="rotate(90)">a</text>', group='<g clip-path="url(#z)">')
    assert told.startswith('<g clip-path="url(#c0)"><text transform="rotate(90)"')


def test_what_is_left_out_of_a_path_lies_on_it() -> None:
    """So that the tests above can fail."""
    path = (0.0, 0.0, 1.0, 1.0, 2.0, 2.0)
    assert follows(path, (0.0, 0.0, 2.0, 2.0), ABOUT)
    assert not follows((0.0, 0.0, 1.0, 1.2, 2.0, 2.0), (0.0, 0.0, 2.0, 2.0), ABOUT)
    assert not follows(path, (0.0, 0.0, 1.2, 1.0, 2.0, 2.0), ABOUT)
    assert not follows(path, (0.0, 0.0, 1.0, 1.0), ABOUT)


@pytest.mark.parametrize("path", ["M 0 1\nL 1e-3 2", "M 0 0 A 1 1 0 0 0 2 2", "m 1 1 l 2 2"])
def test_paths_that_matplotlib_does_not_write_stay(path: str) -> None:
    assert short_path(path) == path


def test_the_width_at_which_labels_are_legible() -> None:
    """9 px over the smallest of 7.5 and 8 units, of a drawing that is 500 units wide."""
    svg = '<svg viewBox="0 0 500 200"><text style="font-size: 8px"/><g style="font-size:7.5px"/>'
    assert DrawingFiles(svg).least == 600
    assert DrawingFiles('<svg viewBox="0 0 500 200">').least == 0


# An SVG reader of this test's own: what is painted, with the style that is in force there.


def looks(svg: str) -> dict[tuple[str, ...], list[Numbers]]:
    """By look, where everything is that has it, in the order in which it is painted."""
    found: dict[tuple[str, ...], list[Numbers]] = {}
    for _, how, numbers in painted(svg):
        found.setdefault(how, []).append(numbers)
    return found


def painted(svg: str) -> Iterator[tuple[str, tuple[str, ...], Numbers]]:
    """Shape, looks and coordinates of everything that leaves a trace."""
    root = ET.fromstring(svg)
    named = {e.attrib["id"]: e for e in root.iter() if "id" in e.attrib}
    sheet = re.search(r"\*\{([^}]*)\}", svg)
    yield from _of(root, INITIAL | (_css(sheet[1]) if sheet else {}), (), named)


def _of(
    element: ET.Element,
    style: dict[str, str],
    clips: tuple[Numbers, ...],
    named: dict[str, ET.Element],
) -> Iterator[tuple[str, tuple[str, ...], Numbers]]:
    tag = element.tag.rpartition("}")[2]
    if tag in ("defs", "clipPath", "style", "metadata"):
        return
    style = {k: v for k, v in style.items() if k not in NOT_INHERITED} | _css(
        element.get("style", "")
    )
    if "clip-path" in element.attrib:
        (frame,) = named[element.attrib["clip-path"][5:-1]]
        clips = (*clips, tuple(float(frame.attrib[k]) for k in ("x", "y", "width", "height")))
    at = tuple(float(element.get(k, "0")) for k in ("x", "y"))
    if tag == "use":
        (href,) = (v for k, v in element.items() if k.endswith("href"))
        target = named[href[1:]]
        own = style | _css(target.get("style", ""))
        small = max(map(abs, points(target.attrib["d"]))) <= 20
        for numbers in parts(target.attrib["d"]):
            places = tuple(number + at[k % 2] for k, number in enumerate(numbers))
            for _, how, there in _painted("path", own, clips, places):
                yield "small" if small else "path", how, there
    elif tag == "path":
        for numbers in parts(element.get("d", "")):
            yield from _painted("path", style, clips, numbers)
    elif tag == "text":
        fonts = tuple(style.get(k, "") for k in ("font-size", "font-weight", "text-anchor"))
        turn = re.findall(r"rotate\((-?[\d.]+)", element.get("transform", ""))
        turned = [float(angle) for angle in turn if float(angle)]
        moved = re.findall(r"translate\((\S+) (\S+)\)", element.get("transform", ""))
        at = tuple(map(float, moved[0])) if moved else at
        words = "".join(element.itertext())
        yield f"text {words}", (*fonts, style["fill"], words), (*at, *turned)
    elif tag == "image":
        yield "image", (element.get("transform", ""),), at
    for child in element:
        yield from _of(child, style, clips, named)


def _painted(
    shape: str, style: dict[str, str], clips: tuple[Numbers, ...], numbers: Numbers
) -> Iterator[tuple[str, tuple[str, ...], Numbers]]:
    """Nothing for what has neither a line nor a filling; of a straight line no filling."""
    filling = "none" if shape == "path" and len(numbers) == 4 else style["fill"]
    if (filling, style["stroke"]) == ("none", "none"):
        return
    shown = {"fill": filling, "opacity": "1", "fill-opacity": "1", "stroke": style["stroke"]}
    line = [name for name in style if name.startswith("stroke") and style["stroke"] != "none"]
    shown |= {name: style[name] for name in ("opacity", "fill-opacity", *line) if name in style}
    looks = tuple(f"{name}={value}" for name, value in sorted(shown.items()))
    frames = (f"{end:.1f}" for clip in clips for end in clip)
    yield shape, (shape, *looks, *frames), numbers


def _css(text: str) -> dict[str, str]:
    pairs = (part.split(":", 1) for part in text.split(";") if ":" in part)
    return {name.strip(): value.strip() for name, value in pairs}


def follows(path: Numbers, short: Numbers, about: float) -> bool:
    """Whether a path comes by all places of `short`, in their order, and leaves it nowhere."""
    places, far = np.reshape(path, (-1, 2)), np.sqrt(2) * about
    here: np.ndarray | None = None
    next_ = 0
    for there in np.reshape(short, (-1, 2)):
        close = np.flatnonzero(np.abs(places[next_:] - there).max(axis=1, initial=0.0) <= about)
        if not len(close):
            return False
        passed = places[next_ : next_ + close[0]]
        if len(passed) and (here is None or _distance(passed, here, there).max() > far):
            return False
        here, next_ = there, next_ + int(close[0]) + 1
    rest = places[next_:]
    return not len(rest) or (here is not None and _distance(rest, here, here).max() <= far)


def _distance(places: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """From each place to the line between two; shape (n,)."""
    along = other - one
    length = float(along @ along)
    share = np.clip((places - one) @ along / length, 0.0, 1.0) if length else np.zeros(len(places))
    return np.hypot(*(places - one - np.outer(share, along)).T)


def parts(path: str) -> list[Numbers]:
    """The places that each line of a path comes by; a repeated one once, as it paints nothing."""
    here = start = (0.0, 0.0)
    lines: list[list[tuple[float, float]]] = []
    for command, text in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
        numbers = [float(n) for n in re.findall(r"-?\d*\.?\d+", text)]
        if command in "zZ":
            here = start
            lines[-1].append(here)
            continue
        if command in "mM":
            lines.append([])
        found = lines[-1]
        if command in "hv":
            numbers = [v for n in numbers for v in ((n, 0.0) if command == "h" else (0.0, n))]
        for place, (x, y) in enumerate(zip(numbers[::2], numbers[1::2], strict=True)):
            relative = command.islower()
            origin = here
            if command in "cq":  # of a curve all points are told from where it begins
                origin = found[-1 - place % {"c": 3, "q": 2}[command]]
            here = (origin[0] + x, origin[1] + y) if relative else (x, y)
            if command in "mM" and place == 0:
                start = here
            if not found or command not in "lLhv" or np.hypot(*np.subtract(here, found[-1])) > 0.01:
                found.append(here)
    return [tuple(number for place in found for number in place) for found in lines]


def points(path: str) -> Numbers:
    """The places of all its lines."""
    return tuple(number for line in parts(path) for number in line)
