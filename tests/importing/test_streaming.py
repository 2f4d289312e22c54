"""Readers in processes of their own: their blocks arrive, and when they fall a file is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign.importing.interface import Clock, Column, RecordingError
from campaign.importing.subprocess_reader import tables_streamed
from tests.importing.whole import whole

READER = "tests.importing.falling"

pytestmark = pytest.mark.usefixtures("started")


@pytest.fixture
def file(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    return tmp_path / "a.dat"


def test_tables_are_told_and_blocks_arrive(file):
    file.write_text("whole")
    (table,) = tables_streamed(READER, file)
    assert (table.name, table.clock) == ("one", Clock(0.1))
    assert table.columns == (Column("a", "N m", "1"), Column("b", "", "2"))
    assert table.doubts == ("odd",)
    blocks = list(table.read([1]))
    assert [block.shape for block in blocks] == [(10, 1)] * 3
    np.testing.assert_array_equal(whole(table), np.arange(30.0)[:, None] + [0, 100])
    assert whole(table, []).shape == (30, 0)


@pytest.mark.parametrize("does", ["falls", "refuses"])
def test_a_reader_that_falls_refuses_the_file(file, does):
    what = "fell over it" if does == "falls" else "no such luck"
    file.write_text(does)
    with pytest.raises(RecordingError, match=what):
        tables_streamed(READER, file)
    file.write_text(f"{does} later")
    (table,) = tables_streamed(READER, file)
    reading = table.read([0])
    assert len(next(reading)) == len(next(reading)) == 10
    with pytest.raises(RecordingError, match=what):
        next(reading)


def test_a_reader_that_hangs_is_ended(file, monkeypatch):
    monkeypatch.setattr("campaign.importing.subprocess_reader.PATIENCE", 0.5)
    file.write_text("hangs")
    with pytest.raises(RecordingError, match=r"did not go on for 0.5 s"):
        tables_streamed(READER, file)


def test_who_wants_no_more_ends_the_reader(file):
    file.write_text("whole")
    (table,) = tables_streamed(READER, file)
    reading = table.read([0])
    next(reading)
    reading.close()  # type: ignore[attr-defined]
