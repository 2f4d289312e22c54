"""Naming, listing and finding runs."""

import subprocess
import sys
from datetime import UTC, datetime

import pytest
from pydantic import ValidationError

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run, list_runs
from campaign.archive.writing.run_names import new_run_name
from campaign.archive.writing.writer import RunWriter
from campaign.errors import UsageError
from campaign.trial import Ending, Outcome

NOW = datetime(2026, 11, 21, 9, 36, 58, tzinfo=UTC)


def test_names_are_sortable_and_unique(tmp_path, kit):
    assert new_run_name(tmp_path / "none", "quickstart", NOW) == "2026-11-21T09-36-58-quickstart"
    names = []
    for _ in range(3):
        names.append(new_run_name(tmp_path, "quickstart", NOW))
        RunWriter.create(tmp_path, kit.header(names[-1]), [])
    assert names[1:] == [f"{names[0]}-2", f"{names[0]}-3"]
    assert new_run_name(tmp_path, "my test/ö", NOW) == "2026-11-21T09-36-58-my-test"


@pytest.mark.parametrize("name", ["", "../x", "a/b", ".hidden", "a\nb", "x" * 300])
def test_a_run_cannot_have_a_name_that_is_no_file_name(kit, name):
    with pytest.raises(ValidationError):
        kit.header(name)


@pytest.mark.parametrize("created", ["yesterday", "2026-11-21T09:36:58"])
def test_a_timestamp_has_a_time_zone(created):
    with pytest.raises(ValidationError):
        RunHeader(name="x", created=created)


@pytest.fixture
def results(tmp_path, kit):
    for name in ("2026-11-21T09-00-00-map", "2026-11-22T09-00-00-map", "mine"):
        kit.run(tmp_path, [10, None], name=name)
    return tmp_path


def test_a_list_tells_how_each_run_went(results, kit):
    kit.begin(results, 1, [10], name="2026-11-23T09-00-00-map")
    (results / "2026-11-22T09-00-00-map-report").mkdir()
    listed = list_runs(results)
    days = [f"2026-11-2{day}T09-00-00-map" for day in (1, 2, 3)]
    assert [run.name for run in listed] == ["mine", *days]
    assert (listed[1].status, listed[1].trials, listed[1].failed) == ("failed trials", 2, 1)
    assert (listed[3].status, listed[3].trials, listed[3].planned) == (RunStatus.INCOMPLETE, 1, 1)
    assert listed[1].bytes == listed[1].path.stat().st_size
    assert (listed[1].protocol, listed[1].created) == ("tiny", kit.CREATED)


def test_a_trial_that_somebody_stopped_has_not_failed(tmp_path, kit):
    """In the folder of a run as well as in its sealed file."""
    writer, trials = kit.begin(tmp_path, 3, [10, None])
    writer.begin(trials[2]).finish(Ending(Outcome.INTERRUPTED, "Ctrl-C"), kit.STARTED, kit.ENDED)

    def counted():
        (run,) = list_runs(tmp_path)
        return run.trials, run.failed, run.interrupted

    assert counted() == (3, 1, 1)
    writer.seal(RunStatus.INTERRUPTED, "stopped by Ctrl-C", ended=kit.ENDED)
    assert counted() == (3, 1, 1)


def test_a_run_is_found_by_path_name_or_beginning(results, monkeypatch):
    expected = results / "2026-11-21T09-00-00-map.nxs"
    for name in (str(expected), str(results / expected.stem), expected.name, expected.stem):
        assert find_run(results, name) == expected
    assert find_run(results, "2026-11-21") == expected
    assert find_run(results) == results / "2026-11-22T09-00-00-map.nxs"
    monkeypatch.chdir(results)
    assert open_run(find_run(results, "mine.nxs")).name == "mine"


def test_what_cannot_be_found_names_what_there_is(results):
    with pytest.raises(UsageError, match=r"begins several runs: 2026-11-21.*, 2026-11-22"):
        find_run(results, "2026")
    with pytest.raises(UsageError, match="no run 'map'; there are mine, 2026-11-21"):
        find_run(results, "map")
    (results / "none").mkdir()
    with pytest.raises(UsageError, match="there are no runs"):
        find_run(results / "none")
    with pytest.raises(UsageError, match="gone: there is no such folder; name the one that holds"):
        find_run(results / "gone")


@pytest.mark.parametrize("content", [b"t,x\n0,1\n", b"", b"MATLAB 7.3 MAT-file" + bytes(500)])
def test_what_another_program_recorded_is_to_be_imported(tmp_path, content):
    recorded = tmp_path / "my log.csv"
    recorded.write_bytes(content)
    with pytest.raises(UsageError, match=r"is not a run\. .*import --guess '.*my log\.csv' > "):
        find_run(tmp_path, str(recorded))
    (tmp_path / "cut.nxs").write_bytes(content)
    assert find_run(tmp_path, str(tmp_path / "cut.nxs")) == tmp_path / "cut.nxs"


LIST = """
import sys
sys.argv = ["campaign", "list", "--results", sys.argv[1]]
from campaign.cli.main import main
try:
    main()
except SystemExit:
    pass
from campaign.entry_points import installed
print(sorted({"h5py", "numpy"} & set(sys.modules)), installed.cache_info().misses)
"""


def test_a_listing_with_an_index_imports_no_numpy_and_no_hdf5_and_searches_no_packages(
    tmp_path, kit
):
    kit.run(tmp_path, [10])
    list_runs(tmp_path)
    command = [sys.executable, "-c", LIST, str(tmp_path)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(lines) == 3, lines
    assert lines[-1] == "[] 0"
