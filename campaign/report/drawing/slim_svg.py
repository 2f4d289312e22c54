"""Compact SVG: redundancy of matplotlib's output removed.

Coordinates are rounded to a tenth of a point, those of signs to a hundredth, paths go from point
to point, ids that nothing refers to are gone, and what all children of a group have in common
stands at the group.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from xml.etree import ElementTree as ET
from xml.sax.saxutils import escape, quoteattr

from campaign.report.drawing.short_paths import CURVES, SIGNS, short_number, short_path, whole

SVG = "http://www.w3.org/2000/svg"
XLINK = "http://www.w3.org/1999/xlink"
HREF = f"{{{XLINK}}}href"
PREFIXES = {SVG: "", XLINK: "xlink:", "http://www.w3.org/XML/1998/namespace": "xml:"}
HEADER = '<?xml version="1.0" encoding="utf-8"?>\n'
EVERYWHERE = {"stroke-linejoin": "round"}
"""What matplotlib says of all elements in a style sheet, which on a page would be of the page."""

LARGEST_SIGN = 20.0
"""Points from its middle to its ends; what a band is drawn from lies farther away."""
OF_TEXT = frozenset({"font-size", "font-family", "font-weight", "font-style", "text-anchor"})
INHERITED = OF_TEXT | {
    "fill",
    "fill-opacity",
    "stroke",
    "stroke-dasharray",
    "stroke-dashoffset",
    "stroke-linecap",
    "stroke-linejoin",
    "stroke-miterlimit",
    "stroke-opacity",
    "stroke-width",
}
FILLING = frozenset({"fill", "fill-opacity"})
PAINT = FILLING | {"stroke"}

URL = r"url\(#([^)]+)\)"
_ROUNDED = ("x", "y", "width", "height")
Element = ET.Element
Style = dict[str, str]


def slim(svg: str) -> str:
    """An SVG document of matplotlib's, looking the same; the same text always gives the same."""
    root = ET.fromstring(svg)  # noqa: S314 (ours, not somebody's file)
    defined = [child for defs in root.iter(_tag("defs")) for child in defs]
    definitions = Element(_tag("defs"))
    definitions.extend(each for each in defined if each.tag != _tag("style"))
    page = Element(_tag("g"))
    page.extend(_without_defs(root))
    for element in page.iter():
        _shorten(element, CURVES)
    for element in definitions.iter():
        _shorten(element, SIGNS if _is_sign(element) else CURVES)
    _prune(page)
    _merge(page)
    told = _tell_definitions(page, definitions)
    _hoist(page, told)
    style = EVERYWHERE | _style(page)
    page.set("style", _css(style))
    _flatten(page)
    _rename(page, definitions)
    root[:] = [definitions, page] if len(definitions) else [page]
    return HEADER + "".join(_written(root)) + "\n"


def _tag(name: str) -> str:
    return f"{{{SVG}}}{name}"


def _without_defs(parent: Element) -> list[Element]:
    """The children without definitions, at any depth."""
    for each in parent.iter():
        each[:] = [child for child in each if child.tag != _tag("defs")]
    return list(parent)


def _style(element: Element) -> Style:
    pairs = (part.split(":", 1) for part in element.get("style", "").split(";") if ":" in part)
    return {name.strip(): value.strip() for name, value in pairs}


def _css(style: Style) -> str:
    return ";".join(f"{name}:{value}" for name, value in sorted(style.items()))


def _shorten(element: Element, parts: int) -> None:
    """So many parts of a point, paths from point to point, no turns by nothing."""
    if "d" in element.attrib:
        element.set("d", short_path(element.attrib["d"], parts))
    for name in _ROUNDED:
        if re.fullmatch(r"-?[\d.]+", element.get(name, "")):
            element.set(name, short_number(whole(element.attrib[name], parts), parts))
    turned = re.sub(r"rotate\(-?0(?:\.0*)?(?: [^)]*)?\)", "", element.get("transform", "")).strip()
    if "scale" not in turned and "matrix" not in turned:
        turned = re.sub(r"-?\d*\.\d+", lambda m: short_number(whole(m[0], parts), parts), turned)
    _set(element, "transform", turned)
    if "style" in element.attrib:
        element.set("style", _css(_style(element)))


def _is_sign(defined: Element) -> bool:
    """Whether it is one of the small things that stand in many places, and no band."""
    numbers = map(float, re.findall(r"-?\d+(?:\.\d+)?", defined.get("d", "")))
    return all(abs(number) <= LARGEST_SIGN for number in numbers)


def _set(element: Element, name: str, value: str) -> None:
    if value:
        element.set(name, value)
    else:
        element.attrib.pop(name, None)


def _prune(parent: Element) -> None:
    """Take out what paints nothing: empty groups and paths, and frames without a colour."""
    for child in list(parent):
        _prune(child)
        empty = child.tag == _tag("g") and not len(child)
        path = child.tag == _tag("path")
        unseen = path and (not child.get("d") or _style(child) == {"fill": "none"})
        if (empty or unseen) and "class" not in child.attrib:
            parent.remove(child)


def _merge(parent: Element) -> None:
    """A group of one gives what it says to that one."""
    for child in parent:
        _merge(child)
    for place, group in enumerate(parent):
        told = _style(group)
        bare = not group.attrib.keys() - {"id", "style"} and told.keys() <= INHERITED
        if group.tag == _tag("g") and len(group) == 1 and bare:
            (only,) = group
            _set(only, "style", _css(told | _style(only)))
            parent[place] = only


def _tell_definitions(page: Element, definitions: Element) -> dict[str, Style]:
    """Give each sign the style that all of its uses have; what each sign says, by reference."""
    uses: dict[str, list[Element]] = {}
    for use in page.iter(_tag("use")):
        uses.setdefault(use.attrib[HREF], []).append(use)
    told: dict[str, Style] = {}
    for sign in definitions:
        reference = f"#{sign.get('id')}"
        own = _style(sign)
        mine = uses.get(reference, [])
        common = [_style(use) for use in mine]
        if common and all(style == common[0] for style in common):
            own = common[0] | own
            sign.set("style", _css(own))
        for use, style in zip(mine, common, strict=True):  # what the sign says itself wins
            _set(use, "style", _css({k: v for k, v in style.items() if k not in own}))
        told[reference] = own
    return told


def _hoist(element: Element, told: Mapping[str, Style]) -> AbstractSet[str]:
    """Say at a group what most of it has in common; which properties it takes from above.

    A group may say what none of its children takes from above.
    """
    own = _style(element)
    if element.tag != _tag("g"):
        return _from_above(element, own, told)
    open_ = frozenset[str]().union(*[_hoist(child, told) for child in element])
    styles = [_style(child) for child in element]
    for name in sorted(INHERITED - own.keys() - open_):
        values = Counter(style[name] for style in styles if name in style)
        if values:
            own[name] = values.most_common(1)[0][0]
            for style in styles:
                if style.get(name) == own[name]:
                    del style[name]
    for child, style in zip(element, styles, strict=True):
        _set(child, "style", _css(style))
    _set(element, "style", _css(own))
    _hoist_clip(element)
    return open_ - own.keys()


def _from_above(element: Element, own: Style, told: Mapping[str, Style]) -> AbstractSet[str]:
    """The properties that change what an element looks like and that it does not say itself."""
    if element.tag == _tag("use"):
        return INHERITED - OF_TEXT - own.keys() - told.get(element.attrib[HREF], {}).keys()
    if element.tag == _tag("text"):
        return (OF_TEXT | PAINT) - own.keys()
    if element.tag != _tag("path"):
        return INHERITED - OF_TEXT - own.keys()
    straight = len(re.findall("[a-z]", element.get("d", ""))) == 2  # a line has nothing to fill
    drawn = INHERITED - OF_TEXT if "stroke" in own else PAINT
    return drawn - own.keys() - (FILLING if straight else frozenset())


def _hoist_clip(group: Element) -> None:
    """One frame for all that is clipped alike; what is turned is clipped in its own coordinates."""
    clips = {child.get("clip-path") for child in group}
    turned = any("transform" in child.attrib for child in group)
    clip = clips.pop() if len(clips) == 1 else None
    if clip is not None and not turned and "clip-path" not in group.attrib:
        group.set("clip-path", clip)
        for child in group:
            del child.attrib["clip-path"]


def _flatten(parent: Element) -> None:
    """Groups that say nothing give way to what is in them."""
    for child in parent:
        _flatten(child)
    flat: list[Element] = []
    for child in parent:
        bare = child.tag == _tag("g") and not child.attrib.keys() - {"id"}
        flat += list(child) if bare else [child]
    parent[:] = flat


def _rename(*trees: Element) -> None:
    """Short names for what is referred to, in the order of the document; none for the rest."""
    elements = [element for tree in trees for element in tree.iter()]
    used = {name for element in elements for name in _references(element)}
    names = map("".join, itertools.chain.from_iterable(_letters(n) for n in itertools.count(1)))
    new = {e.attrib["id"]: next(names) for e in elements if e.get("id") in used}
    for element in elements:
        _set(element, "id", new.get(element.get("id", ""), ""))
        for name, value in element.attrib.items():
            if name == HREF and value[1:] in new:
                element.set(name, f"#{new[value[1:]]}")
            elif "url(#" in value:
                changed = re.sub(
                    r"url\(#([^)]+)\)", lambda m: f"url(#{new.get(m[1], m[1])})", value
                )
                element.set(name, changed)


def _letters(length: int) -> Iterator[tuple[str, ...]]:
    return itertools.product("abcdefghijklmnopqrstuvwxyz", repeat=length)


def _references(element: Element) -> Iterator[str]:
    for name, value in element.attrib.items():
        if name == HREF and value.startswith("#"):
            yield value[1:]
        yield from re.findall(URL, value)


def _written(element: Element) -> Iterator[str]:
    """Mark-up of an element, a line each for those that hold no text."""
    name = _name(element.tag)
    attributes = "".join(f" {_name(key)}={quoteattr(value)}" for key, value in element.items())
    if name == "svg":
        attributes += f' xmlns="{SVG}" xmlns:xlink="{XLINK}"'
    flowing = name in ("text", "tspan")  # where a line's end would be a space, and a space is one
    text = element.text if element.text and (flowing or element.text.strip()) else ""
    if not len(element) and not text:
        yield f"<{name}{attributes}/>"
        return
    yield f"<{name}{attributes}>{escape(text)}"
    for child in element:
        yield "" if flowing or text else "\n"
        yield from _written(child)
        yield escape(child.tail) if child.tail and (flowing or child.tail.strip()) else ""
    yield f"</{name}>" if flowing or text else f"\n</{name}>"


def _name(tag: str) -> str:
    space, _, name = tag[1:].partition("}") if tag.startswith("{") else ("", "", tag)
    return PREFIXES.get(space, "") + name
