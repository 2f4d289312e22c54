"""Compact SVG: matplotlib's nested groups as one flat list of shapes.

Coordinates are rounded to a tenth of a point, those of signs to a hundredth; paths use relative
steps. Marks, ticks and grid lines with the same look are merged into one path. Marks with a tooltip
are not merged. Neither are marks whose overlap is visible: transparent ones, and those with an edge
of another color.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from xml.etree import ElementTree as ET

from campaign.report.drawing.short_paths import CURVES, SIGNS, short_number, short_path, whole

SVG, XLINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}"
GROUP, PATH, TEXT, TITLE, HREF = (
    f"{SVG}g",
    f"{SVG}path",
    f"{SVG}text",
    f"{SVG}title",
    f"{XLINK}href",
)
ET.register_namespace("", SVG[1:-1])
ET.register_namespace("xlink", XLINK[1:-1])
HEADER = '<?xml version="1.0" encoding="utf-8"?>\n'
EVERYWHERE = {"stroke-linejoin": "round"}
"""Matplotlib's style sheet for all elements; on a page it would apply to the whole page."""
LARGEST_SIGN = 20.0
"""Maximum coordinate of a sign from its middle (points); those of a band are larger."""
OF_TEXT = frozenset({"font-size", "font-family", "font-weight", "font-style", "text-anchor"})
"""Properties that affect texts only."""
FEW = 5
"""Minimum number of lines of a closed path that is no mark or bar."""
Element = ET.Element
Style = dict[str, str]


@dataclass(frozen=True)
class _Shape:
    """A painted element.

    Attributes:
        style: effective style, with inherited properties.
        clip: reference to its clip path; "" for none.
        told: class and title of its group; empty for none.
        sign: whether it is a small mark that is used in many places.
    """

    element: Element
    style: Style
    clip: str
    told: tuple[str, str] = ("", "")
    sign: bool = False

    @property
    def path(self) -> str:
        return self.element.get("d", "")

    @property
    def is_text(self) -> bool:
        return self.element.tag == TEXT

    @cached_property
    def is_straight(self) -> bool:
        """Whether it is a path of separate straight lines, which hides nothing."""
        return re.fullmatch(r"(M[^A-Za-z]*L[^A-Za-z]*)+", self.path) is not None

    @property
    def look(self) -> tuple[object, ...] | None:
        """Key of shapes that can be merged into one path; None for a shape that cannot."""
        path = self.path
        small = self.sign or self.is_straight or (path.count("L") < FEW and path[-2:] == "z\n")
        alone = any(self.told) or "transform" in self.element.attrib
        if alone or not small or not (self.is_straight or _covers(self.style)):
            return None
        return self.clip, self.sign, _css(self.style)


def slim(svg: str) -> str:
    """Shorten an SVG document of matplotlib without a change of its look; deterministic."""
    root = ET.fromstring(svg)  # noqa: S314 (generated here, no foreign file)
    named = {each.attrib["id"]: each for each in root.iter() if "id" in each.attrib}
    shapes = _merged(_shapes(root, {}, "", ("", ""), named))
    clips = dict.fromkeys(shape.clip for shape in shapes if shape.clip)
    names = {clip: f"c{place}" for place, clip in enumerate(clips)}
    common = _common([shape.style for shape in shapes if shape.is_text])
    page = Element(GROUP, {"style": _css(EVERYWHERE | common)})
    page.extend(_written(shape, names, common) for shape in shapes)
    definitions = Element(f"{SVG}defs")
    definitions.extend(_frame(named[clip[5:-1]], name) for clip, name in names.items())
    root[:] = [definitions, page] if names else [page]
    for parent in (root, definitions, page):
        parent.text = "\n"
        for child in parent:
            child.tail = "\n"
    return f"{HEADER}{ET.tostring(root, encoding='unicode')}\n"


def _common(styles: Sequence[Style]) -> Style:
    """Text properties that all texts share."""
    shared = (
        set(styles[0].items()).intersection(*(each.items() for each in styles[1:]))
        if styles
        else ()
    )
    return {name: value for name, value in shared if name in OF_TEXT}


def _shapes(
    parent: Element,
    style: Style,
    clip: str,
    told: tuple[str, str],
    named: Mapping[str, Element],
) -> Iterator[_Shape]:
    """Painted shapes within an element, in order; `named`: elements by id."""
    for element in parent:
        own = style | _style(element)
        cut = element.get("clip-path", clip)
        if element.tag == GROUP:
            title = element.findtext(TITLE, "")
            word = (element.get("class", ""), title) if title else told
            yield from _shapes(element, own, cut, word, named)
        elif element.tag == f"{SVG}use":
            sign = named[element.attrib[HREF][1:]]
            path, place = sign.get("d", ""), (float(element.get(name, "0")) for name in "xy")
            moved = Element(PATH, {"d": _moved(path, *place)})
            yield _Shape(moved, own | _style(sign), cut, told, _is_sign(path))
        elif element.tag == PATH:
            if element.get("d") and own != {"fill": "none"}:
                yield _Shape(element, own, cut, told)
        elif element.tag in (TEXT, f"{SVG}image"):
            yield _Shape(element, own, cut, told)


@lru_cache(maxsize=256)
def _is_sign(path: str) -> bool:
    """Whether a path is a mark and no band."""
    numbers = map(float, re.findall(r"-?\d+(?:\.\d+)?", path))
    return all(abs(number) <= LARGEST_SIGN for number in numbers)


def _moved(path: str, x: float, y: float) -> str:
    """Translate a path of coordinate pairs."""

    def place(pair: re.Match[str]) -> str:
        return f"{float(pair[1]) + x:.3f} {float(pair[2]) + y:.3f}"

    return re.sub(r"(-?[\d.]+) (-?[\d.]+)", place, path)


def _merged(shapes: Iterable[_Shape]) -> list[_Shape]:
    """Merge each path into the first one with its look, past straight lines and texts only."""
    merged: list[_Shape] = []
    open_: dict[object, _Shape] = {}
    for shape in shapes:
        look = shape.look
        if shape.is_text:
            merged.append(shape)
        elif look is None:
            open_.clear()
            merged.append(shape)
        else:
            if not shape.is_straight:
                open_ = {each: first for each, first in open_.items() if each == look}
            if look in open_:
                first = open_[look].element
                first.set("d", f"{first.attrib['d']}{shape.path}")
            else:
                open_[look] = shape
                merged.append(shape)
    return merged


def _covers(style: Style) -> bool:
    """Whether overlapping marks of this style look the same in any order."""
    clear = any(style.get(name, "1") != "1" for name in style if name.endswith("opacity"))
    fill, stroke = style.get("fill", "#000000"), style.get("stroke", "none")
    return not clear and (stroke in ("none", fill) or fill == "none")


def _written(shape: _Shape, names: Mapping[str, str], common: Style) -> Element:
    """Element of a shape, with rounded coordinates."""
    element, parts = shape.element, SIGNS if shape.sign else CURVES
    attributes: dict[str, str] = {"class": shape.told[0]} if shape.told[0] else {}
    if shape.path:
        attributes["d"] = short_path(shape.path, parts)
    for name in ("x", "y", "width", "height", HREF):
        if name in element.attrib:
            attributes[name] = _rounded(element.attrib[name])
    if turned := _turned(element.get("transform", "")):
        attributes["transform"] = turned
    own = {name: value for name, value in shape.style.items() if common.get(name) != value}
    attributes |= {"style": _css(own)} if own else {}
    clip = {"clip-path": f"url(#{names[shape.clip]})"} if shape.clip else {}
    written = Element(element.tag, attributes if turned else clip | attributes)
    written.text = element.text if shape.is_text else ""
    written.extend(element if shape.is_text else ())
    if shape.told[1]:
        ET.SubElement(written, TITLE).text = shape.told[1]
    if not (turned and clip):
        return written
    frame = Element(GROUP, clip)  # the clip is in coordinates before the rotation
    frame.append(written)
    return frame


def _frame(clip: Element, name: str) -> Element:
    """Clip path under a short name."""
    frame = Element(clip.tag, {"id": name})
    for shape in clip:
        attributes = {key: _rounded(value) for key, value in shape.attrib.items()}
        frame.append(Element(shape.tag, attributes))
    return frame


def _rounded(value: str) -> str:
    number = re.fullmatch(r"-?[\d.]+", value)
    return short_number(whole(value)) if number else value


def _turned(transform: str) -> str:
    """Transform without rotations by zero, rounded."""
    turned = re.sub(r"rotate\(-?0(?:\.0*)?(?: [^)]*)?\)", "", transform).strip()
    if "scale" in turned or "matrix" in turned:
        return turned
    return re.sub(r"-?\d*\.\d+", lambda found: _rounded(found[0]), turned)


def _style(element: Element) -> Style:
    pairs = (part.split(":", 1) for part in element.get("style", "").split(";") if ":" in part)
    return {name.strip(): value.strip() for name, value in pairs}


def _css(style: Style) -> str:
    return ";".join(f"{name}:{value}" for name, value in sorted(style.items()))
