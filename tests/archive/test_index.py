"""The index makes listings quick, and is never believed where a run may have changed."""

import json
import os

import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.index import INDEX
from campaign.archive.reading.run_list import list_runs
from campaign.archive.writing.writer import RunWriter
from campaign.errors import UsageError


@pytest.fixture
def results(tmp_path, kit):
    """A sealed run and one in progress."""
    header = {"tests": [{"name": "a", "bench": "tiny"}, {"name": "b", "bench": "tiny"}]}
    kit.run(tmp_path, [10, None], name="2026-11-21T09-00-00-map", **header)
    writer, _ = kit.begin(tmp_path, 2, [10], name="2026-11-22T09-00-00-map")
    yield tmp_path
    writer.close()


def not_opened(monkeypatch):
    def summarise(path):
        raise AssertionError(f"{path} was opened")

    monkeypatch.setattr("campaign.archive.reading.summarise.summarise", summarise)


def test_a_second_listing_opens_nothing_and_says_the_same(results, monkeypatch):
    first = list_runs(results)
    assert first[0].benches == ("tiny",)
    assert first[0].tags == ("first",)
    assert first[0].ended == "2026-11-21T09:40:00Z"
    assert [run.status for run in first] == [RunStatus.FAILED_TRIALS, RunStatus.INCOMPLETE]
    not_opened(monkeypatch)
    assert list_runs(results) == first


def test_a_run_that_changed_is_read_again(results, kit):
    before = list_runs(results)
    sealed = before[0].path
    os.utime(sealed, ns=(1, 1))
    sealed.write_bytes(sealed.read_bytes()[:-100])
    other = RunWriter.create(results, kit.header("2026-11-23T09-00-00-map"), [kit.trial(1)])
    assert [bool(run.problem) for run in list_runs(results)] == [True, False, False]
    kit.record(other, kit.trial(1), 5)
    assert [run.trials for run in list_runs(results)][1:] == [1, 1]


@pytest.mark.parametrize(
    "content",
    [b"", b"nonsense", b"[]", b'{"index":1}', b"[" * 90_000, b'{"index":[1,"x"],"runs":{}}'],
)
def test_a_damaged_index_is_made_again(results, content):
    expected = list_runs(results)
    (results / INDEX).write_bytes(content)
    assert list_runs(results) == expected
    assert len(json.loads((results / INDEX).read_bytes())["runs"]) == 2
    (results / INDEX).unlink()
    assert list_runs(results) == expected


@pytest.mark.parametrize(
    "change", [{"status": "fine"}, {"trials": "7"}, {"tags": [1]}, {"name": "other"}, {"more": 1}]
)
def test_an_entry_that_makes_no_sense_is_read_again(results, change):
    expected = list_runs(results)
    tree = json.loads((results / INDEX).read_bytes())
    for entry in tree["runs"].values():
        entry["summary"] |= change
    (results / INDEX).write_text(json.dumps(tree))
    assert list_runs(results) == expected


def test_an_index_that_cannot_be_written_costs_only_time(results):
    (results / INDEX).mkdir()
    assert len(list_runs(results)) == 2
    assert sorted(path.name for path in results.glob("*.part")) == []


def test_runs_that_are_gone_leave_the_index(results):
    list_runs(results)
    (results / "2026-11-21T09-00-00-map.nxs").unlink()
    assert len(list_runs(results)) == 1
    assert len(json.loads((results / INDEX).read_bytes())["runs"]) == 1


def test_a_folder_that_is_not_there_gets_no_index(tmp_path):
    with pytest.raises(UsageError, match="there is no such folder"):
        list_runs(tmp_path / "none")
    assert not (tmp_path / "none").exists()
