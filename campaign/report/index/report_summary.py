"""Key numbers and picture of an existing report.

The folder is read as anybody's: what is missing, too large or not as expected is as if it were not
there, and nothing of it is believed to be more than text.
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
"""Bytes of a `report.json` beyond which it is left alone."""
LONGEST = 400
"""Letters of a text that are shown."""
SHOWN = 3
"""Key numbers that are shown."""
NOT_TELLING = ("scoreboard", "draws", "incidents-")
"""Beginnings of names of figures that are no analysis' own."""


@dataclass(frozen=True)
class ReportSummary:
    """What a report says; everything may be missing.

    Attributes:
        page: `report.html`, as a path.
        numbers: the first of the test of the opening's figure, else the first of the opening.
        headline: how published values came out.
        sketch: SVG of its most telling figure, small; made from the numbers of `report.json`.
        caption: what that figure is called.
        figure: where there is no sketch, an SVG file of the report.
    """

    page: Path | None = None
    numbers: str = ""
    headline: str = ""
    sketch: str = ""
    caption: str = ""
    figure: Path | None = None


def summary_of_report(folder: Path) -> ReportSummary:
    """What the report in `folder` says; an empty `ReportSummary` where there is none."""
    page = folder / PAGE
    if not page.is_file():
        return ReportSummary()
    tree = _tree(folder / DATA)
    opening = _mapping(tree.get("opening"))
    answers = [_mapping(answer) for answer in _sequence(opening.get("answers"))]
    # Numbers and picture are of one test where it has both.
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
    """A JSON file's table; empty for anything else."""
    try:
        if path.stat().st_size > LARGEST:
            return {}
        return _mapping(json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError):
        return {}


def _first_numbers(answers: Sequence[Mapping[str, Any]]) -> str:
    """`Coulomb friction Tc, positive: 25.3 ± 0.1 N·m`, of the first test that has numbers."""
    numbers = next(filter(None, (_sequence(each.get("numbers")) for each in answers)), ())
    told = []
    for number in map(_mapping, numbers[:SHOWN]):
        name = ", ".join(filter(None, (_text(number.get(key)) for key in ("quantity", "where"))))
        if value := _text(number.get("value")):
            told.append(f"{name}: {value}")
    return f"{'; '.join(told)}." if told else ""


def _figures(
    tree: Mapping[str, Any], wanted: Sequence[tuple[str, str]]
) -> Iterator[Mapping[str, Any]]:
    """The figures of analyses, those that are wanted by test and key first."""
    tests = [_mapping(test) for test in _sequence(tree.get("tests"))]
    there = {
        (_text(test.get("name")), _text(figure.get("key"))): figure
        for test in tests
        for figure in map(_mapping, _sequence(test.get("figures")))
    }
    yield from (there[each] for each in wanted if each in there)
    yield from there.values()


def _wanted(
    telling: Sequence[Any], answers: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[str, str]]:
    """Test and key of the most telling figure, then of what stands for each answer."""
    if len(telling) == 2:
        yield _text(telling[0]), _text(telling[1])
    for answer in answers:
        yield _text(answer.get("test")), _text(answer.get("figure"))


def _drawing(figures: Path, wanted: Sequence[tuple[str, str]]) -> Path | None:
    """The drawing of the most telling figure that is there; else the first of an analysis."""
    for test, key in wanted:
        path = figures / f"{slug(f'{test}-{key}')}.svg"
        if test and key and path.is_file():
            return path
    try:
        there = sorted(path for path in figures.iterdir() if path.suffix == ".svg")
    except OSError:
        return None
    return next((path for path in there if not path.name.startswith(NOT_TELLING)), None)


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _sequence(value: object) -> Sequence[Any]:
    return value if isinstance(value, list) else ()


def _text(value: object) -> str:
    if not isinstance(value, str):
        return ""
    return value if len(value) <= LONGEST else f"{value[: LONGEST - 1]}…"
