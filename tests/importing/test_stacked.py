"""Several recordings in one file: tables below each other, and times that begin anew."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from campaign.importing.defects.clock import restarts
from campaign.importing.formats.delimited import tables
from campaign.importing.guess import guess, mapping_text
from campaign.importing.trial_rows import by_restart
from tests.importing.test_mapping import COLUMNS, ENTRY, TEST, planned, refused, served
from tests.importing.whole import whole

STEPS = 3
ROWS = 60


def step(number: int, unit: str = "mm") -> str:
    """As a test machine writes one: what was set, a heading, units, a gap, rows."""
    lines = ["", f"Step No. {number}", f"Velocity = {10 * number}", "", "T,X,F", f"s,{unit},N", ""]
    lines += [f"{0.01 * k:.2f},{number * k},{0.5 * number:.1f}" for k in range(ROWS)]
    return "\n".join(lines) + "\n"


def machine(path: Path, *steps: str) -> Path:
    path.write_text("Machine 7\nOperator: somebody\n" + "".join(steps))
    return path


def test_tables_below_each_other_are_tables(tmp_path: Path) -> None:
    path = machine(tmp_path / "a.csv", step(1), step(2, "m"), step(3))
    found = tables(path)
    assert [each.name for each in found] == ["block 1", "block 2", "block 3"]
    assert [each.columns[1].unit for each in found] == ["mm", "m", "mm"]
    for number, each in enumerate(found, start=1):
        values = whole(each)
        assert values.shape == (ROWS, 3)
        np.testing.assert_array_equal(values[:, 1], number * np.arange(ROWS))


def test_one_table_is_one_and_its_end_mark_no_other(tmp_path: Path) -> None:
    (only,) = tables(machine(tmp_path / "a.csv", step(1)))
    assert only.name == ""
    assert whole(only).shape == (ROWS, 3)


def test_a_guess_shares_the_columns_of_tables_below_each_other(tmp_path: Path) -> None:
    path = machine(tmp_path / "a.csv", *(step(number) for number in range(1, STEPS + 1)))
    mapping = tomllib.loads(mapping_text(guess([path]), tmp_path))
    (test,) = mapping["test"]
    assert [each["table"] for each in test["recording"]] == ["block 1", "block 2", "block 3"]
    assert len(mapping["columns"]) == 1


def again(*begins: float) -> str:
    """Rows as those of `test_mapping`, whose times (ms) begin anew."""
    rows = [(begin + k, 0.05 * k, 1.0 + 0.001 * k, n) for n, begin in enumerate(begins, 1)
            for k in range(100)]  # fmt: skip
    return "t,pos,i,run\n" + "\n".join(",".join(f"{x:.6g}" for x in row) for row in rows)


def test_each_stretch_of_time_is_a_trial(tmp_path: Path) -> None:
    rows = again(0.0, 5.0, 0.0)
    plan = planned(tmp_path, COLUMNS + TEST + ENTRY + "restarts = true", rows)
    assert [len(served(trial)[0].time) for trial in plan.trials] == [100] * 3
    assert [trial.point["part"] for trial in plan.trials] == [1, 2, 3]
    by_column = planned(tmp_path, COLUMNS + TEST + ENTRY + 'each = "run"', rows)
    for one, other in zip(plan.trials, by_column.trials, strict=True):
        np.testing.assert_array_equal(served(one)[0]["relative_angle"],
                                      served(other)[0]["relative_angle"])  # fmt: skip


def test_time_that_begins_anew_is_no_repetition(tmp_path: Path) -> None:
    """To leave out what is no later would throw most of the file away."""
    told = refused(tmp_path, COLUMNS + TEST + ENTRY, again(0.0, 0.0, 0.0))
    assert "time begins anew in row 101, 201: 3 recordings; in" in told
    assert "restarts = true" in told
    assert "drop repeated" not in told


@pytest.mark.parametrize(
    ("lines", "rows", "says"),
    [
        ('restarts = true\nstart = "1 ms"', (0.0, 0.0), "there are several of it"),
        ('restarts = true\neach = "run"', (0.0, 0.0), "both separate trials"),
        ("restarts = true", (0.0, 100.0), "its time begins once"),
    ],
)
def test_what_does_not_go_with_restarts(
    tmp_path: Path, lines: str, rows: tuple[float, ...], says: str
) -> None:
    assert says in refused(tmp_path, COLUMNS + TEST + ENTRY + lines, again(*rows))


def test_a_guess_says_that_time_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(again(0.0, 0.0, 0.0))
    text = mapping_text(guess([path]), tmp_path)
    assert "# ? restarts = true  # time begins anew 2 times" in text
    assert "goes back" not in text


def test_a_clock_that_is_set_back_begins_nothing() -> None:
    time = np.arange(1000) * 1e-3
    time[600:] -= 0.02
    assert restarts(time) == []
    exchanged = np.arange(1000) * 1e-3
    exchanged[[500, 501]] = exchanged[[501, 500]]
    assert restarts(exchanged) == []
    short = np.concatenate([np.arange(50), np.arange(5), np.arange(70)]) * 1e-3
    assert restarts(short) == [50]
    with pytest.raises(ValueError, match="begins once"):
        by_restart(time, 0)


def test_an_uneven_clock_is_told_with_its_row_of_the_file(tmp_path: Path) -> None:
    """The last row of the second of three, as of what was stopped by hand."""
    rows = again(0.0, 0.0, 0.0).splitlines()
    rows[200] = "98.3,4.95,1.099,2"
    told = refused(tmp_path, COLUMNS + TEST + ENTRY + "restarts = true", "\n".join(rows))
    assert "a.csv from row 101: its times are no even clock" in told
    assert "before row 200" in told
