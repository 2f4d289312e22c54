"""`report.json` has every number of the page: looked for where it stands, and rounded alike.

`python -m tests.report.test_report_json` writes the schema anew.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin
from campaign.experiments.interface import Experiment
from campaign.reason import Cause, Reason
from campaign.report.formats.as_json import POINTS, plain, read_report, report_schema
from campaign.result import Column, Finding, Result, Table
from campaign.text import pretty_unit
from campaign.units import convert

ALONE = Cause("single trial", "one of {count} trial")
SCHEMA = Path(__file__).parents[2] / "docs" / "report.schema.json"
POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
NUMBER = re.compile(r"(?<![\w.])(-?\d+(?:\.(\d+))?)(?: × 10(-?\d+))?(?![\w.])")
COMMON = re.compile(r"(\([^()]* ± [^()]*\)|[^ ]+ \([^()]* to [^()]*\)) × 10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)")


def schema_text() -> str:
    return json.dumps(report_schema(), indent=1, ensure_ascii=False) + "\n"


def found(value: float, half: float | None, unit: str, **more: Any) -> Estimate:
    ends = {} if half is None else {"low": value - half, "high": value + half, "level": 0.95}
    return Estimate("quantity", value, unit, **ends, **more)


def with_numbers(made_up: ModuleType) -> dict[str, Experiment]:
    """The made-up experiments; the first finds all kinds of numbers."""

    def analyse(data: Any) -> Result:
        result = made_up.stabilization(data)
        error = found(0.48841e-3, 0.02e-3, "rad", standard_error=1e-5, freedom=7.0)
        lopsided = Estimate("peak", 1.2e-3, "rad", 1.0e-3, 2.0e-3, 0.95)
        cells = (
            error,
            lopsided,
            found(3e-9, 2e-10, "rad"),
            found(1234.5678, 0.5, "rad"),
            found(2.5e-3, None, "rad", reason=ALONE(count=1)),
            Estimate(
                "q", math.nan, "rad", reason=Reason("test", "too few"), origin=Origin.NOT_DETERMINED
            ),
            Estimate("q", 0.4, "rad", kind="at least"),
            -7.25e-4,
            math.inf,
            12,
            None,
        )
        columns = (
            Column("name", "Name", exact=True),
            Column("error", "Error", "rad", "mrad"),
            Column("percent", "Share", "", "percent", exact=True),
            Column("yes", "Yes"),
        )
        rows = tuple(
            {"name": f"row {n} <b>", "error": cell, "percent": 0.1234567 * n, "yes": n > 3}
            for n, cell in enumerate(cells)
        )
        table = Table("many", "Many kinds", columns, rows)
        measured = (
            replace(each, estimate=found(each.value, 0.05 * each.value, each.unit))
            for each in result.findings
        )
        findings = (
            *measured,
            *(
                Finding.of(each, {"compensation": "x", "nan": math.nan})
                for each in (error, lopsided)
            ),
        )
        tables = (*result.tables, table)
        return replace(result, tables=tables, findings=findings)

    first = made_up.EXPERIMENTS["stabilization"]
    return {**made_up.EXPERIMENTS, "stabilization": replace(first, analyse=analyse)}


@pytest.fixture(scope="module")
def folder(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of the made-up run: a test that failed, a table of every kind of number."""
    folder = tmp_path_factory.mktemp("json")
    report = made_up.build(
        made_up.made_up_run(folder, notes="a <script>alert(1)</script> & \u2028 note"),
        folder / "report",
        experiments=with_numbers(made_up),
    )
    return report.path.parent


@pytest.fixture(scope="module")
def told(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "report.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    return Page((folder / "report.html").read_text(encoding="utf-8"))


class Page(HTMLParser):
    """The page's tables, as rows of texts by the anchor they are under, and its sections' texts."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tables: dict[str, list[list[str]]] = {}
        self.words: dict[str, str] = {}
        self._open: list[tuple[str, str]] = []
        self._cell: list[str] | None = None
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in ("meta", "link", "br", "img", "input", "hr"):
            return
        self._open.append((tag, dict(attrs).get("id") or ""))
        if tag == "tr" and self._in("tbody"):
            self.tables.setdefault(self._anchor(), []).append([])
        if tag in ("td", "th") and self._in("tbody"):
            self._cell = []

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th") and self._cell is not None:
            self.tables[self._anchor()][-1].append(" ".join("".join(self._cell).split()))
            self._cell = None
        while self._open and self._open.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self._cell is not None:
            self._cell.append(data)
        for _, anchor in self._open:
            if anchor:
                self.words[anchor] = self.words.get(anchor, "") + data

    def _in(self, tag: str) -> bool:
        return any(each == tag for each, _ in self._open)

    def _anchor(self) -> str:
        return next((anchor for _, anchor in reversed(self._open) if anchor), "")


def shown_numbers(text: str) -> Iterator[tuple[float, float]]:
    """Every number in a text, and half of its last digit; one exponent may be that of all."""
    common = COMMON.fullmatch(text)
    text, shared = (common[1], common[2]) if common else (text, "")
    unit = 10.0 ** int(shared.translate(POWERS) or 0)
    for match in NUMBER.finditer(text.replace("−", "-").translate(POWERS)):
        power = unit * 10.0 ** int(match[3] or 0)
        yield float(match[1]) * power, 0.5 * 10.0 ** -len(match[2] or "") * power


def is_among(text: str, numbers: list[float | None]) -> bool:
    """Whether each number in `text` is one of `numbers`, rounded; and there is one."""
    given = [each for each in numbers if each is not None]
    shown = list(shown_numbers(text))
    return bool(shown) and all(
        any(abs(abs(each) - abs(value)) <= half * 1.0001 + 1e-12 * abs(each) for each in given)
        for value, half in shown
    )


def of_number(number: dict[str, Any], factor: float = 1.0) -> list[float | None]:
    """What a page may show of a number: it, the ends of its interval, half of it."""
    ends = [number[name] for name in ("value", "low", "high")]
    half = None if None in ends[1:] else 0.5 * (ends[2] - ends[1])
    return [None if each is None else each * factor for each in (*ends, half)]


def every_table(told: dict[str, Any]) -> Iterator[dict[str, Any]]:
    if told["scoreboard"]["closeness"]:
        yield told["scoreboard"]["closeness"]
    for test in told["tests"]:
        yield from test["tables"]
        if test["truth"]:
            yield test["truth"]
    yield from told["incidents"]["tables"]


def wrong_cells(table: dict[str, Any], rows: list[list[str]]) -> Iterator[str]:
    """Cells of the page that are not what the table in the JSON says."""
    for row, texts in zip(table["rows"], rows, strict=False):
        for column, text in zip(table["columns"], texts, strict=True):
            cell = row[column["name"]]
            place = f"{table['anchor']} {column['name']}: {text!r} {cell!r}"
            if isinstance(cell, dict):
                open_value = cell["value"] is None
                numbers = of_number(cell, column["factor"])
                if not (text == "–" if open_value else is_among(text, numbers)):
                    yield place
            elif isinstance(cell, bool):
                if text != ("yes" if cell else "no"):
                    yield place
            elif isinstance(cell, int | float):
                if not is_among(text, [cell * column["factor"]]):
                    yield place
            elif column["name"] == "unit":
                if text != pretty_unit(cell):
                    yield place
            elif text != ("–" if cell is None else " ".join(cell.split())):
                yield place


@pytest.mark.slow
def test_each_number_in_a_table_is_in_the_json_and_rounds_alike(page, told):
    tables = {table["anchor"]: table for table in every_table(told)}
    shown = {a for a in page.tables if a.startswith("table-")}
    compared = {c["anchor"] for test in told["tests"] for c in test["comparisons"]}
    assert shown == tables.keys() | compared
    assert sum(len(rows) for rows in page.tables.values()) > 50
    wrong = [w for a in tables for w in wrong_cells(tables[a], page.tables[a])]
    assert wrong == []


def test_the_comparison_itself_finds_a_number_that_is_off(page, told):
    """The test above would pass on anything if this did not fail."""
    (table,) = (t for t in every_table(told) if t["key"] == "many")
    rows = page.tables[table["anchor"]]
    for factor in (1.001, -10.0, 0.0):
        off = [{**column, "factor": column["factor"] * factor} for column in table["columns"]]
        assert list(wrong_cells({**table, "columns": off}, rows))


def test_each_line_of_the_scoreboard_is_in_the_json(page, told):
    lines = told["scoreboard"]["lines"]
    by_table = {c["anchor"]: c["table"] for test in told["tests"] for c in test["comparisons"]}
    assert len(page.tables["scoreboard"]) == len({line["table"] for line in lines}) > 2
    boards = []
    for anchor, table in by_table.items():
        of_table = [line for line in lines if line["table"] == table]
        boards += [
            (line, row[-5:-2]) for line, row in zip(of_table, page.tables[anchor], strict=True)
        ]
    for line, (published, reproduced, deviation) in boards:
        assert is_among(published, [line["published"]]) or line["published"] is None
        numbers = of_number({**line, "value": line["reproduced"]})
        assert reproduced == "–" or is_among(reproduced, numbers), line
        assert deviation == "–" or is_among(deviation, [line["deviation_percent"]]), line
    assert len(boards) == len(lines) > 20
    assert sum("±" in reproduced for _, (_, reproduced, _) in boards) > 2


def test_each_key_number_of_the_page_is_in_the_json(page, told):
    answers = {answer["test"]: answer for answer in told["opening"]["answers"]}
    checked = 0
    for test in told["tests"]:
        words = " ".join(page.words[test["anchor"]].replace("\xa0", " ").split())
        numbers = answers[test["name"]]["numbers"]
        for shown, found in zip(numbers, test["key_numbers"], strict=True):
            assert shown["value"] in words
            unit = shown["value"].rpartition(" ")[2]
            factor = {"mrad": 1e3, "°": 180 / math.pi, "deg/s": 180 / math.pi}
            if found["number"]["value"] is not None and not shown["published"]:
                values = of_number(found["number"], factor.get(unit, 1.0))
                assert is_among(shown["value"], values), shown
            checked += 1
    assert checked > 3


def test_the_facts_of_the_run_are_in_the_json(page, told, folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    for fact in ("sha256", "fingerprint", "command"):
        assert told["provenance"][fact] in text
    assert [str(each["number"]) for each in told["failed"]] == [
        row[0] for row in page.tables["failed"]
    ]
    assert f"{told['run']['executed']} executed, {told['run']['not_completed']} not" in " ".join(
        text.split()
    )
    assert any("no recording reached breakaway" in each for each in told["problems"])
    for test in told["tests"]:
        for said in test["conditions"]:
            assert said["text"] in " ".join(page.words[test["anchor"]].split())


def test_what_is_in_a_file_of_the_folder_is_named_and_says_the_same(told, folder):
    for table in every_table(told):
        with (folder / table["file"]).open(encoding="utf-8") as file:
            rows = list(csv.reader(file))[1:]
        assert len(rows) == len(table["rows"])
        for shown, row in zip(rows, table["rows"], strict=True):
            for place, column in enumerate(table["columns"]):
                cell = row[column["name"]]
                value = cell["value"] if isinstance(cell, dict) else cell
                if isinstance(value, float):
                    assert float(shown[place]) == pytest.approx(value * column["factor"], rel=1e-12)
    for test in told["tests"]:
        assert all((folder / figure["file"]).is_file() for figure in test["figures"])


def test_a_figure_s_trials_are_those_that_the_page_names(told):
    """The fourth did not complete: no measurement of it is drawn."""
    test = next(each for each in told["tests"] if each["figures"])
    assert 4 in test["trials"]
    assert test["figures"][0]["trials"] == [1, 2, 3]


def test_a_factor_is_that_of_the_units(told):
    axes = [
        axis
        for test in told["tests"]
        for figure in test["figures"]
        for panel in figure["panels"]
        for axis in (panel["x"], panel["y"])
    ]
    columns = [column for table in every_table(told) for column in table["columns"]]
    for each in (*axes, *columns):
        assert each["factor"] == convert(1.0, each["unit"], each["display"])
    assert {each["factor"] for each in columns} >= {1.0, 1000.0, 100.0}


def test_a_long_curve_keeps_its_ends_and_peaks(told, made_up):
    result = made_up.stabilization(None)
    (test,) = (each for each in told["tests"] if each["kind"] == "stabilization")
    for figure, kept in zip(result.figures, test["figures"], strict=True):
        for panel, same in zip(figure.panels, kept["panels"], strict=True):
            for curve, short in zip(panel.curves, same["curves"], strict=True):
                assert short["points"] == len(curve.x)
                assert len(short["x"]) == len(short["y"]) <= POINTS
                for values, left in ((curve.x, short["x"]), (curve.y, short["y"])):
                    ends = (min(left), max(left))
                    assert ends == pytest.approx((np.min(values), np.max(values)), rel=1e-6)


def test_there_is_no_nan_and_everything_is_sorted(folder):
    text = (folder / "report.json").read_text(encoding="utf-8")

    def refuse(word: str) -> None:
        raise AssertionError(word)

    tree = json.loads(text, parse_constant=refuse)
    assert json.dumps(tree, sort_keys=True, indent=1, ensure_ascii=False) + "\n" == text
    (test,) = (each for each in tree["tests"] if each["kind"] == "stabilization")
    assert test["findings"][-1]["conditions"] == {"compensation": "x", "nan": None}
    assert plain({"a": [math.inf, np.float64(1.5), np.nan]}) == {"a": [None, 1.5, None]}


def test_it_reads_back_as_what_it_was_and_nothing_else_does(folder):
    text = (folder / "report.json").read_text(encoding="utf-8")
    again = json.dumps(
        read_report(text).model_dump(mode="json"), sort_keys=True, indent=1, ensure_ascii=False
    )
    assert again + "\n" == text
    tree = json.loads(text)
    for change in ({"extra": 1}, {"format": "x"}, {"tests": [{"name": "x"}]}, {"run": None}):
        with pytest.raises(ValueError, match="validation error"):
            read_report(json.dumps({**tree, **change}))


@pytest.mark.slow
def test_the_same_run_gives_the_same_text(made_up, folder, tmp_path):
    again = made_up.build(
        made_up.made_up_run(tmp_path, notes="a <script>alert(1)</script> & \u2028 note"),
        tmp_path / "other",
        experiments=with_numbers(made_up),
    )
    text = again.path.with_name("report.json").read_bytes()
    assert text == (folder / "report.json").read_bytes()


def test_a_reason_is_text_and_data(told: dict[str, Any]):
    cells = [cell for test in told["tests"] for table in test["tables"] for row in table["rows"]
             for cell in row.values() if isinstance(cell, dict)]  # fmt: skip
    (alone,) = (cell for cell in cells if cell["reason_code"] == "single trial")
    assert (alone["reason"], alone["reason_values"]) == ("one of 1 trial", {"count": 1})
    assert any((cell["reason"], cell["reason_code"], cell["reason_values"]) == ("", "", {})
               for cell in cells)  # fmt: skip


def test_the_schema_in_the_docs_is_that_of_the_program():
    assert SCHEMA.read_text(encoding="utf-8") == schema_text(), (
        "python -m tests.report.test_report_json writes it anew"
    )


if __name__ == "__main__":
    SCHEMA.write_text(schema_text(), encoding="utf-8")
