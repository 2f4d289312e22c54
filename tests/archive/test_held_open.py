"""A run whose samples come from one open file, and a run handed to another process."""

import pickle
import shutil
from pathlib import Path

import h5py
import pytest

from campaign.archive.reading import global_heap_check, safe_hdf5
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import list_runs
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError
from tests.archive.test_kept import KEPT

SEALED = "format-3.nxs"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the files that are opened from now on."""
    names: list[str] = []
    file = h5py.File

    def counted(name, *args, **kwargs):
        names.append(str(name))
        return file(name, *args, **kwargs)

    monkeypatch.setattr(safe_hdf5.h5py, "File", counted)
    return names


def read_all(run: RunReader) -> list[bytes]:
    recordings = [trial.recording() for trial in run.trials if trial.ending.outcome == "completed"]
    return [channel.samples.tobytes() for r in recordings for channel in r.channels.values()]


def test_a_file_that_is_held_open_is_opened_once(opened: list[str]) -> None:
    run = open_run(KEPT / SEALED)
    opened.clear()
    every = read_all(run)
    assert len(opened) > 1
    opened.clear()
    with run.held_open():
        assert read_all(run) == every
    assert opened == [str(run.path)]
    opened.clear()
    assert read_all(run) == every  # and it is closed behind the block
    assert len(opened) > 1


def test_a_file_that_is_gone_is_told_by_whoever_reads_it(tmp_path: Path) -> None:
    path = Path(shutil.copy(KEPT / SEALED, tmp_path))
    run = open_run(path)
    path.unlink()
    with run.held_open(), pytest.raises(ArchiveError, match="there is no such file"):
        run.trials[0].recording()


def test_a_folder_is_read_as_ever() -> None:
    run = open_run(KEPT / "format-3.partial")
    with run.held_open():
        assert read_all(run) == read_all(run)


@pytest.mark.parametrize("name", [SEALED, "format-3.partial"])
def test_an_opened_run_is_the_same_in_another_process(name: str) -> None:
    run = open_run(KEPT / name)
    other = pickle.loads(pickle.dumps(run))
    assert (other.header, other.plan, other.journal) == (run.header, run.plan, run.journal)
    assert other.trials == run.trials
    assert read_all(other) == read_all(run)
    assert len(other.full_plan) == len(run.full_plan)
    assert other.planned(1) == run.planned(1)


def test_what_is_known_of_heaps_is_told_another_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(shutil.copy(KEPT / SEALED, tmp_path))
    looked: list[Path] = []
    original = global_heap_check._sound
    monkeypatch.setattr(
        global_heap_check, "_sound", lambda *of: (looked.append(of[0]), original(*of))[1]
    )
    monkeypatch.setattr(global_heap_check, "_known", {})
    run = open_run(path)
    assert looked == [path]
    known = global_heap_check.known_heaps(path)
    global_heap_check._known.clear()  # as in a process that has just begun
    global_heap_check.add_known_heaps(known)
    read_all(run)
    assert looked == [path]
    path.touch()  # it may be another file by now
    read_all(run)
    assert looked == [path, path]


def test_opening_and_listing_scan_no_file_for_heaps(
    sealed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scan reads the whole file; checksums are texts of fixed length, which are in no heap."""
    monkeypatch.setattr(global_heap_check, "_known", {})
    monkeypatch.setattr(global_heap_check, "_sound", None)
    monkeypatch.setattr(safe_hdf5, "_SOUND", {})
    assert open_run(sealed).damaged == ()
    (listed,) = list_runs(sealed.parent)
    assert listed.problem == ""
