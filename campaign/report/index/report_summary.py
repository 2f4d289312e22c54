"""Key numbers and picture of an existing report.

The folder is untrusted: missing, too large and unexpected content is ignored, and all content is
treated as plain text.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.report.index.sketch import sketch
from campaign.report.page.names import slug

PAGE = "report.html"
DATA = "report.json"
LARGEST = 1 << 25
"""Maximum size of a `report.json` (bytes); a larger one is ignored."""
LONGEST = 400
"""Maximum number of shown letters of a text."""
SHOWN = 3
"""Number of shown key numbers."""
NOT_TELLING = ("scoreboard", "draws", "incidents-")
"""Prefixes of the names of figures that are not from an analysis."""


@dataclass(frozen=True)
class ReportSummary:
    """Summary of a report; everything may be missing.

    Attributes:
        page: path of `report.html`.
        numbers: first key numbers of the leading figure's test, else of the first screen.
        headline: sentence on the reproduced published values.
        sketch: small SVG of the leading figure, from the numbers of `report.json`.
        caption: title of that figure.
        figure: SVG file of the report, without a sketch.
    """

    page: Path | None = None
    numbers: str = ""
    headline: str = ""
    sketch: str = ""
    caption: str = ""
    figure: Path | None = None


def summary_of_report(folder: Path) -> ReportSummary:
    """Summary of the report in `folder`; an empty `ReportSummary` without one."""
    page = folder / PAGE
    if not page.is_file():
        return ReportSummary()
    tree = _tree(folder / DATA)
    opening = _mapping(tree.get("opening"))
    answers = [_mapping(answer) for answer in _sequence(opening.get("answers"))]
    # Numbers and picture are of the same test, if it has both.
    telling = _sequence(opening.get("telling"))
    test = next(map(_text, telling), "")
    answers.sort(key=lambda answer: not test or answer.get("test") != test)
    wanted = list(_wanted(telling, answers))
    shown = next(_figures(tree, wanted), {})
    small = sketch(shown)
    return ReportSummary(
        page,
        _first_numbers(answers),
        _text(opening.get("compared")),
        small,
        _text(shown.get("title")) if small else "",
        None if small else _drawing(folder / "figures", wanted),
    )


def _tree(path: Path) -> Mapping[str, Any]:
    """Table of a JSON file; empty for anything else."""
    try:
        if path.stat().st_size > LARGEST:
            return {}
        return _mapping(json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError):
        return {}


def _first_numbers(answers: Sequence[Mapping[str, Any]]) -> str:
    """Key numbers of the first test with any: `Coulomb friction Tc, positive: 25.3 ± 0.1 N·m`."""
    numbers = next(filter(None, (_sequence(each.get("numbers")) for each in answers)), ())
    texts = []
    for number in map(_mapping, numbers[:SHOWN]):
        name = ", ".join(filter(None, (_text(number.get(key)) for key in ("quantity", "where"))))
        if value := _text(number.get("value")):
            texts.append(f"{name}: {value}")
    return f"{'; '.join(texts)}." if texts else ""


def _figures(
    tree: Mapping[str, Any], wanted: Sequence[tuple[str, str]]
) -> Iterator[Mapping[str, Any]]:
    """Figures of analyses, first those of `wanted` (test and key)."""
    tests = [_mapping(test) for test in _sequence(tree.get("tests"))]
    figures = {
        (_text(test.get("name")), _text(figure.get("key"))): figure
        for test in tests
        for figure in map(_mapping, _sequence(test.get("figures")))
    }
    yield from (figures[each] for each in wanted if each in figures)
    yield from figures.values()


def _wanted(
    telling: Sequence[Any], answers: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[str, str]]:
    """Test and key of the leading figure, then of the figure of each answer."""
    if len(telling) == 2:
        yield _text(telling[0]), _text(telling[1])
    for answer in answers:
        yield _text(answer.get("test")), _text(answer.get("figure"))


def _drawing(figures: Path, wanted: Sequence[tuple[str, str]]) -> Path | None:
    """First existing drawing of `wanted`; else the first drawing of an analysis."""
    for test, key in wanted:
        path = figures / f"{slug(f'{test}-{key}')}.svg"
        if test and key and path.is_file():
            return path
    try:
        drawings = sorted(path for path in figures.iterdir() if path.suffix == ".svg")
    except OSError:
        return None
    return next((path for path in drawings if not path.name.startswith(NOT_TELLING)), None)


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _sequence(value: object) -> Sequence[Any]:
    return value if isinstance(value, list) else ()


def _text(value: object) -> str:
    if not isinstance(value, str):
        return ""
    return value if len(value) <= LONGEST else f"{value[: LONGEST - 1]}…"
