"""What makes an archive survive a power cut is an order of calls: it is recorded and held here.

A kill leaves what the system was told, in any order; only a power cut shows that a sync is
missing, and no test can cut the power. So the calls themselves are judged.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.archive.layout.files import PART, write_atomically
from campaign.archive.layout.names import JOURNAL
from campaign.archive.reading.archived_metrics import ArchivedMetrics
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.writing.trial_writer import FolderWriter
from campaign.archive.writing.writer import RunWriter
from campaign.estimate import Estimate
from campaign.reason import Reason
from campaign.recording import ChannelInfo
from campaign.trial import Trial
from tests.archive.conftest import record_trial
from tests.archive.recorded_calls import Call, Calls, recorded
from tests.archives import _header, plan_of

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="names of open files are had from /proc"
)

AT = "2026-11-21T09:37:00Z"


@pytest.fixture
def trials(tmp_path: Path) -> tuple[Trial, ...]:
    return plan_of(tmp_path).trials


def begun(folder: Path, trials: tuple[Trial, ...]) -> RunWriter:
    return RunWriter.create(folder / "results", _header((), folder / "results"), trials)


def end_of(calls: Calls) -> int:
    return len(calls.listed)


def finish(writer: RunWriter | FolderWriter, trial: Trial) -> Any:
    """Record a short trial, from its beginning until `finish` has returned: its recorder."""
    rate = ChannelInfo("gyro_rate", "rad/s", "Rate", "deg/s")
    return record_trial(writer, trial, (np.arange(10) / 10.0, np.zeros((1, 10))), [rate])


def test_a_trial_is_on_the_disk_before_the_journal_says_so(
    tmp_path: Path, trials: tuple[Trial, ...]
) -> None:
    """Content, then the name, then the folder, then the line, synced before `finish` ends."""
    writer = begun(tmp_path, trials)
    folder, journal = writer.folder, writer.folder / JOURNAL
    with recorded() as calls:
        finish(writer, trials[0])
    writer.close()
    final = folder / "trial-00001.trial"
    part = final.with_name(final.name + PART)
    calls.in_order(
        ("fsync", part), ("rename", final), ("fsync", folder), ("write", journal),
        ("fsync", journal),
    )  # fmt: skip
    assert [str(call) for call in calls.listed if call.path == final] == []  # not touched again
    assert calls.synced_before(end_of(calls), journal)
    (line,) = [call.data for call in calls.listed if call.path == journal and call.data]
    assert json.loads(line)["event"] == "trial finished"
    assert line.endswith(b"\n")


def test_trials_of_a_batch_are_on_the_disk_before_their_lines_are_handed_over(
    tmp_path: Path, trials: tuple[Trial, ...]
) -> None:
    """Every content, then every name, then the folder, once; only then `publish` ends."""
    writer = FolderWriter(tmp_path, {trial.number: 1 for trial in trials[:2]})
    with recorded() as calls:
        for trial in trials[:2]:
            finish(writer, trial)
        before = end_of(calls)
        writer.publish()
    assert [call.name for call in calls.listed[:before] if call.name != "write"] == []
    finals = [tmp_path / f"trial-0000{trial.number}.trial" for trial in trials[:2]]
    parts = [final.with_name(final.name + PART) for final in finals]
    assert [(call.name, call.to or call.path) for call in calls.listed[before:]] == [
        *(("fsync", part) for part in parts),
        *(("rename", final) for final in finals),
        ("fsync", tmp_path),
    ]
    assert all(calls.synced_before(end_of(calls), part) for part in parts)
    assert [entry.file for entry in writer.take_entries()] == [final.name for final in finals]  # type: ignore[union-attr]


def test_a_trial_is_reported_before_it_is_measured(
    tmp_path: Path, trials: tuple[Trial, ...]
) -> None:
    """File, name and line are on the disk; what is found is one more line, and no other call."""
    writer = begun(tmp_path, trials)
    journal = writer.folder / JOURNAL
    found = ArchivedMetrics(
        (Estimate("x", 1.0, "", reason=Reason("test", "one sample")),), "campaign"
    )
    before: list[int] = []
    with recorded() as calls:
        recorder = finish(writer, trials[0])

        def measure(archived: ArchivedTrial) -> ArchivedMetrics:
            before.append(end_of(calls))
            return found

        recorder.measure(measure)
    writer.close()
    (start,) = before
    calls.in_order(("rename", writer.folder / "trial-00001.trial"), ("fsync", journal))
    assert calls.synced_before(start, journal)
    told = [json.loads(call.data)["event"] for call in calls.listed[:start] if call.data]
    assert told == ["trial finished"]
    assert [(call.name, call.path) for call in calls.listed[start:]] == [
        ("write", journal), ("fsync", journal),
    ]  # fmt: skip
    assert json.loads(calls.listed[start].data)["event"] == "trial measured"


def test_every_line_of_the_journal_is_synced_before_anybody_is_told(
    tmp_path: Path, trials: tuple[Trial, ...]
) -> None:
    writer = begun(tmp_path, trials)
    journal = writer.folder / JOURNAL
    for _ in range(3):
        with recorded() as calls:
            writer.decision("retry", "the drive was hot", 1)
        names = [call.name for call in calls.listed if call.path == journal]
        assert names == ["write", "fsync"]
    writer.close()


def test_a_resumed_run_says_so_on_the_disk_before_it_goes_on(
    tmp_path: Path, trials: tuple[Trial, ...]
) -> None:
    writer = begun(tmp_path, trials)
    folder, journal = writer.folder, writer.folder / JOURNAL
    writer.close()
    with journal.open("ab") as file:
        file.write(b'{"event": "torn')
    with recorded() as calls:
        resumed = RunWriter.resume(folder, at=AT, host={}, versions={}, command=["campaign"])
    resumed.close()
    calls.in_order(
        ("truncate", journal), ("fsync", journal), ("write", journal), ("fsync", journal)
    )
    assert calls.synced_before(end_of(calls), journal)


def test_a_small_file_is_synced_before_it_has_its_name_and_the_folder_after_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "x.json"
    with recorded() as calls:
        write_atomically(path, "{}")
    part = tmp_path / f"x.json{PART}"
    calls.in_order(("write", part), ("fsync", part), ("rename", path), ("fsync", tmp_path))
    assert end_of(calls) == 4, calls


def test_all_that_a_run_begins_with_is_on_the_disk_before_it_has_its_name(
    tmp_path: Path, trials: tuple[Trial, ...]
) -> None:
    """Afterwards the results folder is synced: the run is there."""
    with recorded() as calls:
        writer = begun(tmp_path, trials)
    writer.close()
    folder = writer.folder
    part = folder.with_name(folder.name + PART)
    named = calls.index("rename", folder)
    calls.index("fsync", folder.parent, named)
    files = sorted(file.name for file in folder.iterdir())
    assert JOURNAL in files
    for name in files:
        written = part / f"{name}{PART}"
        calls.in_order(("write", written), ("fsync", written), ("rename", part / name))
        assert calls.index("fsync", part, calls.index("rename", part / name)) < named
        assert calls.synced_before(named, written)
    assert not [call for call in calls.listed[:named] if call.path.is_relative_to(folder)]


# The recorder itself


def test_the_recorder_sees_every_way_to_write(tmp_path: Path) -> None:
    import os

    path, other = tmp_path / "a", tmp_path / "b"
    with recorded() as calls:
        path.write_text("x")
        with path.open("ab") as file:
            file.write(b"y")
            file.flush()
            os.fsync(file.fileno())
        descriptor = os.open(path, os.O_WRONLY)
        os.write(descriptor, b"z")
        os.ftruncate(descriptor, 1)
        os.close(descriptor)
        path.replace(other)
        other.rename(path)
        path.unlink()
        path.mkdir()
        path.rmdir()
        (tmp_path / "c").write_bytes(b"")
        assert (tmp_path / "c").read_bytes() == b""
    assert [str(call) for call in calls.listed] == [
        "write a", "write a", "fsync a", "write a", "truncate a", "rename a -> b",
        "rename b -> a", "unlink a", "mkdir a", "rmdir a", "write c",
    ]  # fmt: skip
    assert calls.listed[3] == Call("write", path, data=b"z")
    after = end_of(calls)
    path.write_text("not seen")
    assert end_of(calls) == after


def test_a_write_after_the_sync_is_no_synced_file(tmp_path: Path) -> None:
    calls, path = Calls(), tmp_path / "a"
    calls.add("write", path)
    assert not calls.synced_before(1, path)
    calls.add("fsync", path)
    assert calls.synced_before(2, path)
    calls.add("write", path)
    assert not calls.synced_before(3, path)
    with pytest.raises(AssertionError, match="no rename"):
        calls.in_order(("write", path), ("rename", path))
