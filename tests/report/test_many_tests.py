"""Of many tests a page opens with answers that have an interval, and has all in full below."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from campaign.archive.reading.run_reader import RunReader
from campaign.estimate import Estimate, Origin
from campaign.experiments.interface import Experiment, TestData
from campaign.reason import NONE, Reason
from campaign.report.content.document import document_of
from campaign.report.content.first_screen import MANY, FirstScreen
from campaign.report.formats import chosen_formats
from campaign.result import Axis, Curve, Figure, Finding, Panel, Result

pytestmark = pytest.mark.usefixtures("drawings_kept")

EXACT = Reason("test", "nothing scatters")


ONE_TRIAL = Reason("one trial", "the interval is of that one trial")
ONE_DAY = Reason("one day", "the interval is of that one day")
REMARKED = {"measured_0": ONE_TRIAL, "measured_1": ONE_TRIAL, "measured_2": ONE_DAY}
"""Of numbers with an interval: what is not in it."""


def number(
    name: str, half: float | None = None, *, given: bool = False, reason: Reason = NONE
) -> Finding:
    ends = (None, None) if half is None else (2.0 - half, 2.0 + half)
    origin = Origin.GIVEN if given else Origin.MEASURED
    reason = EXACT if half is None else reason
    told = Estimate(name, 2.0, "m", *ends, 0.95, reason=reason, origin=origin)
    return Finding.of(told, {"parameter": name})


FOUND = {
    # Nothing is known of how far these are true: no interval, or one narrower than any digit.
    **{f"exact_{n}": (number("x"), number("y", 1e-9), number("z", 0.1, given=True))
       for n in range(3)},
    **{f"measured_{n}": (number("x", 0.1, reason=REMARKED.get(f"measured_{n}", NONE)),)
       for n in range(MANY - 1)},
    "tells_little": (number("x"), number("y", 0.1)),
    "tells_more": (number("x", 0.1), number("y", 0.1)),
}  # fmt: skip


def analyse(data: TestData) -> Result:
    name = data.name.replace("-", "_")
    x = np.arange(5.0)
    ends = {"low": x - 1, "high": x + 1} if name.startswith("exact") else {}
    axis, curve = Axis("Rate", "rad/s"), Curve(x, x, "measured", "measured", "points", **ends)
    return Result(
        figures=(
            Figure("a", f"Figure {name}", "A caption.", "A line.", (Panel(axis, axis, [curve]),)),
        ),
        findings=FOUND[name],
    )


@pytest.fixture(scope="module")
def run(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> RunReader:
    """Of a kind each, but for the last two, which are of one."""
    made = made_up.made_up_run(tmp_path_factory.mktemp("many"), tests=dict.fromkeys(FOUND, ()))
    *others, last = made.header.tests
    header = made.header.model_copy(update={"tests": (*others, {**last, "kind": "tells_little"})})
    return replace(made, header=header)


@pytest.fixture(scope="module")
def kinds(made_up: ModuleType) -> dict[str, Experiment]:
    return {
        kind: Experiment(kind, kind, made_up.ShakeOptions, lambda options, bench: (), analyse)
        for kind in FOUND
    }


@pytest.fixture(scope="module")
def opening(run: RunReader, kinds: dict[str, Experiment]) -> FirstScreen:
    return document_of(run, kinds).opening


def test_what_has_an_interval_stands_on_top_one_test_of_a_kind(opening: FirstScreen) -> None:
    measured = [f"measured-{n}" for n in range(MANY - 1)]
    assert list(opening.main) == [*measured, "tells-more"], "of one kind the one that tells more"
    assert [each.test for each in opening.shown] == list(opening.main)
    shown = sum(len(FOUND[name.replace("-", "_")]) for name in opening.main)
    every = sum(map(len, FOUND.values()))
    assert opening.left_out == f"{shown} of {every}; the report's sections have all."


def test_the_figure_on_top_is_of_a_test_that_stands_there(opening: FirstScreen) -> None:
    """Though others draw intervals, and these do not."""
    assert opening.telling == ("tells-more", "a")


def test_few_tests_stand_there_all(
    made_up: ModuleType, tmp_path: Path, kinds: dict[str, Experiment]
) -> None:
    few = made_up.made_up_run(tmp_path, tests=dict.fromkeys(list(FOUND)[:MANY], ()))
    assert document_of(few, kinds).opening.main == ()


def test_the_page_opens_with_the_main_tests_and_each_test_has_all_of_its_own(
    made_up: ModuleType, tmp_path: Path, run: RunReader, kinds: dict[str, Experiment]
) -> None:
    report = made_up.build(run, tmp_path / "out", experiments=kinds)
    html = report.path.read_text(encoding="utf-8")
    top, below = html.split('<section id="opening"')[1].split("</section>", 1)
    on_top = ("tells_more", *(f"measured_{n}" for n in range(MANY - 1)))
    assert top.count('<th scope="row">') == sum(len(FOUND[name]) for name in on_top)
    sections = re.findall(r'<section id="[^"]*" class="test">.*?</section>', below, re.DOTALL)
    for name, section in zip(FOUND, sections, strict=True):
        numbers = section.split('<dl class="key">')[1].split("</dl>")[0]
        assert numbers.count("<dt>") == len(FOUND[name])


@pytest.mark.slow
def test_what_is_not_in_an_interval_on_top_is_told_there(
    made_up: ModuleType, tmp_path: Path, run: RunReader, kinds: dict[str, Experiment]
) -> None:
    """Each remark once, with the tests that it is of."""
    report = made_up.build(
        run, tmp_path / "out", experiments=kinds, formats=chosen_formats(("markdown", "latex"))
    )
    texts = [report.path, *(report.path.with_suffix(suffix) for suffix in (".md", ".tex"))]
    for text in (path.read_text(encoding="utf-8") for path in texts):
        top = text[text.index("Findings") :]
        top = re.split(r"</section>|\n## |\\(?:sub)*section", top)[0]
        assert top.count(f"{str(ONE_TRIAL)[1:]}.") == 1
        assert top.count(f"{str(ONE_DAY)[1:]}.") == 1
        assert str(EXACT) not in top, "of tests that are not there"
        assert top.count("and brackets behind a number") == 1


def test_without_intervals_nothing_is_said_of_them(
    made_up: ModuleType, tmp_path: Path, kinds: dict[str, Experiment]
) -> None:
    exact = made_up.made_up_run(tmp_path, tests={"exact_0": ()})
    assert document_of(exact, kinds).opening.intervals == ""
