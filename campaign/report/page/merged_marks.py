"""Drawings on a page with fewer nodes: marks, ticks and grid lines that look alike are one path.

Files of figures keep each mark by itself. A mark with words of its own stays one, too; so do marks
that may lie on one another where that shows: transparent ones, and those with an edge of another
colour.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

NUMBER = r"-?(?:\d+\.?\d*|\.\d+)"
_MOVE = re.compile(rf"m({NUMBER}) ?({NUMBER}) ?(.*)")
_LINE = re.compile(rf"m{NUMBER} ?{NUMBER} ?(?:[hv]{NUMBER}|{NUMBER} ?{NUMBER})")
_SMALL = re.compile(rf"{_LINE.pattern}|m[^m]{{1,40}}z")
_ATTRIBUTE = re.compile(r'([\w:-]+)="([^"]*)"')
_OF_ONE = re.compile(r"<g( [^>]*)>\n(<title>.*</title>\n)?<(path|use)( [^>]*)/>\n</g>")
_PLAIN = re.compile(
    r'<g style="((?:(?:stroke-width|text-anchor):[\w.]+;?)+)">\n'
    r"((?:<(?:path|use|text)[^\n]*\n)+)</g>\n"
)
_ITEM = re.compile(r"^<(path|use|text)((?: [\w:-]+=\"[^\"]*\")*)", re.M)
Attributes = dict[str, str]


def merged(svg: str) -> str:
    """The same drawing, of the compact SVG that has a line for each element."""
    head, _, body = svg.partition("</defs>")
    if not body:
        return svg
    signs = {a["id"]: a for a in map(_attributes, head.split("\n")) if "id" in a and "d" in a}
    body = _PLAIN.sub(_dissolved, body)
    body = _OF_ONE.sub(partial(_alone, signs), "\n".join(_merged(body.split("\n"), signs)))
    used = set(re.findall(r"#(\w+)", body))
    gone = signs.keys() - used
    kept = (line for line in head.split("\n") if _attributes(line).get("id") not in gone)
    return f"{chr(10).join(kept)}</defs>{body}"


def _dissolved(group: re.Match[str]) -> str:
    """What a group's lines and texts have in common, said by each: marks of two can be merged."""
    common = _style({"style": group[1]})

    def own(item: re.Match[str]) -> str:
        name, attributes = item[1], _attributes(item[2])
        wanted = "text-anchor" if name == "text" else "stroke-width"
        if wanted in common:
            attributes["style"] = _css({wanted: common[wanted]} | _style(attributes))
        return f"<{name}{_told(attributes)}"

    return _ITEM.sub(own, group[2])


def _alone(signs: dict[str, Attributes], group: re.Match[str]) -> str:
    """What is alone in a group, with what the group says."""
    outer, inner, name = _attributes(group[1]), _attributes(group[4]), group[3]
    if outer.keys() & inner.keys() - {"style"} or "transform" in outer.keys() | inner.keys():
        return group[0]
    style = _style(outer) | _style(inner)
    if name == "use" and "clip-path" in outer:  # the clip would move with x and y of `use`
        sign = signs.get(inner.pop("xlink:href")[1:], {})
        place = float(inner.pop("x", 0)), float(inner.pop("y", 0))
        if (moved := _moved(sign.get("d", ""), *place)) is None:
            return group[0]
        name, inner, style = "path", {"d": moved, **inner}, style | _style(sign)
    own = outer | inner
    if style:
        own["style"] = _css(style)
    told = f"<{name}{_told(own)}"
    return f"{told}>{group[2].strip()}</{name}>" if group[2] else f"{told}/>"


def _moved(path: str, x: float, y: float) -> str | None:
    """A path of relative steps, that far away; None for any other."""
    start = _MOVE.fullmatch(path)
    if start is None:
        return None
    steps = start[3] if re.match("[a-z]", start[3]) else f"l{start[3]}"
    return f"M{round(x + float(start[1]), 2):g} {round(y + float(start[2]), 2):g}{steps}"


def _told(attributes: Attributes) -> str:
    return "".join(f' {name}="{value}"' for name, value in attributes.items())


def _css(style: Attributes) -> str:
    return ";".join(f"{name}:{value}" for name, value in sorted(style.items()))


def _attributes(line: str) -> Attributes:
    return dict(_ATTRIBUTE.findall(line))


def _merged(lines: list[str], signs: dict[str, Attributes]) -> Iterator[str]:
    """Each path goes to the first of its look; past lines and words, but past nothing else."""
    found: list[tuple[str, list[str]]] = []
    open_: dict[str, int] = {}
    styles: list[Attributes] = []
    for line in lines:
        if line.startswith("<text") and line.endswith("</text>"):
            found.append((line, []))
            continue
        if line.startswith("<g"):
            styles.append(_style(_attributes(line)))
        elif line == "</g>":
            styles.pop()
        mark = _mark(line, signs, styles)
        if mark is None:
            open_.clear()
            found.append((line, []))
            continue
        if not mark.straight:
            open_ = {each: place for each, place in open_.items() if each == mark.look}
        if mark.look not in open_:
            open_[mark.look] = len(found)
            found.append((mark.look, []))
        found[open_[mark.look]][1].append(mark.path)
    for look, paths in found:
        yield f'<path d="{"".join(paths)}"{look}/>' if paths else look


@dataclass(frozen=True)
class _Mark:
    """A mark or a line as a path, with the attributes that say its look."""

    look: str
    path: str
    straight: bool


def _mark(line: str, signs: dict[str, Attributes], styles: list[Attributes]) -> _Mark | None:
    """The mark or straight line that an element is; None for all else."""
    own = _attributes(line)
    if not line.endswith("/>") or "class" in own or "transform" in own or "id" in own:
        return None
    if line.startswith("<use") and own["xlink:href"][1:] in signs:
        sign = signs[own.pop("xlink:href")[1:]]
        x, y, path = float(own.pop("x", 0)), float(own.pop("y", 0)), sign["d"]
        style = _style(own) | _style(sign)
        straight = bool(_LINE.fullmatch(path))
    elif line.startswith("<path") and _SMALL.fullmatch(own.get("d", "")):
        x = y = 0.0
        path, style = own.pop("d"), _style(own)
        straight = bool(_LINE.fullmatch(path))
    else:
        return None
    moved = _moved(path, x, y)
    all_styles: Attributes = {}
    for each in (*styles, style):
        all_styles |= each
    if moved is None or not (straight or _covers(all_styles)):
        return None
    if style:
        own["style"] = _css(style)
    return _Mark(_told(own), moved, straight)


def _style(attributes: Attributes) -> Attributes:
    pairs = (part.partition(":") for part in attributes.get("style", "").split(";") if part)
    return {name: value for name, _, value in pairs}


def _covers(style: Attributes) -> bool:
    """Whether marks of this style look the same on one another in any order."""
    clear = any(style.get(name, "1") != "1" for name in style if name.endswith("opacity"))
    fill, stroke = style.get("fill", "#000000"), style.get("stroke", "none")
    return not clear and (stroke in ("none", fill) or fill == "none")
