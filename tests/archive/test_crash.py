"""Nothing reported finished is lost, and nothing half-written looks whole."""

import errno
import os
import random
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run, list_runs
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError, UsageError
from campaign.recording import Ending, Outcome

# Writes trials without end or, with "seal", a few and then one file; says what it finished.
CHILD = """
import sys
from pathlib import Path
from campaign.archive.layout.run_status import RunStatus
writer, trials = kit.begin(Path(sys.argv[1]), 399)
print("created", flush=True)
for trial in trials[: int(sys.argv[2])]:
    kit.write_trial(writer, trial, 200 * trial.number)
    print("finished", trial.number, flush=True)
print("sealing", flush=True)
writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
print("sealed", flush=True)
"""


def check_whole(results: Path, kit, reported: list[int]) -> None:
    """Every run that opens holds all that was reported, whole; a part file never opens."""
    for part in results.rglob("*.part"):
        with pytest.raises(ArchiveError):
            open_run(part)
    run = open_run(find_run(results))
    kept = {archived.trial.number: archived for archived in run.trials}
    assert set(reported) <= set(kept)
    for number, archived in kept.items():
        times, block = kit.samples(200 * number, number)
        recording = archived.recording()
        assert recording.time.tobytes() == times.tobytes()
        assert recording["friction_torque"].tobytes() == block[2].tobytes()
    if run.sealed:
        assert verify_run(run.path).sound


@pytest.mark.slow
@pytest.mark.parametrize("attempt", range(6))
def test_a_kill_at_any_moment_loses_no_finished_trial(tmp_path, kit, attempt):
    child = kit.python(CHILD, tmp_path, 399)
    assert child.stdout.readline() == "created\n"
    time.sleep(random.Random(attempt).uniform(0, 0.5))
    child.kill()
    said = child.communicate()[0].split("\n")[:-1]
    check_whole(tmp_path, kit, [int(line.split()[1]) for line in said if "finished" in line])
    summary = list_runs(tmp_path)[0]
    assert (summary.status, summary.problem) == (RunStatus.INCOMPLETE, "")


@pytest.mark.slow
@pytest.mark.parametrize("attempt", range(4))
def test_a_kill_while_sealing_leaves_the_folder_or_the_file(tmp_path, kit, attempt):
    child = kit.python(CHILD, tmp_path, 25)
    while child.stdout.readline() != "sealing\n":
        pass
    time.sleep(random.Random(attempt).uniform(0, 0.15))
    child.kill()
    child.communicate()
    check_whole(tmp_path, kit, list(range(1, 26)))
    assert len(list_runs(tmp_path)) == 1


LIMITED = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))
"""
"""From now on no file grows beyond 400 kB: writes fail as they do on a full disk."""


@pytest.mark.slow
def test_a_file_that_cannot_grow_fails_the_seal_and_keeps_the_trials(tmp_path, kit):
    child = kit.python(f"{LIMITED}{CHILD}", tmp_path, 25)
    said, errors = child.communicate()
    assert "finished 25" in said
    assert "sealed" not in said.split("\n")
    last = errors.strip().split("\n")[-1]
    assert "ArchiveError" in last
    assert "File too large; every finished trial is in" in last
    assert not list(tmp_path.glob("*.nxs*"))
    check_whole(tmp_path, kit, list(range(1, 26)))


def test_a_full_disk_loses_the_running_trial_only(small_disk, kit):
    writer, trials = kit.begin(small_disk / "results", 2, [3000])
    recorder = kit.started(writer, trials[1], ())
    noise = np.random.default_rng(5).normal(size=(3, 500_000))
    with pytest.raises(ArchiveError, match="No space left on device"):
        recorder.append(np.arange(500_000) / 1000.0, noise)
    assert not list(writer.folder.glob("*.part"))
    run = open_run(writer.folder)
    assert [archived.trial.number for archived in run.trials] == [1]
    assert len(run.trials[0].recording().time) == 3000
    path = writer.seal(RunStatus.FAULT, "the disk is full", ended=kit.ENDED)
    assert open_run(path).status is RunStatus.FAULT


def test_a_journal_line_that_cannot_be_written_leaves_no_trace(tmp_path, kit, monkeypatch):
    writer, _ = kit.begin(tmp_path, 2)
    before = (writer.folder / JOURNAL).read_bytes()
    real = os.write

    def half_of_it(descriptor, data):
        real(descriptor, data[:10])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", half_of_it)
    with pytest.raises(ArchiveError, match="No space left on device"):
        kit.record(writer, kit.trial(1), 10)
    monkeypatch.undo()
    assert (writer.folder / JOURNAL).read_bytes() == before
    kit.record(writer, kit.trial(2), 10)
    run = open_run(writer.seal(RunStatus.FAULT, "disk full", ended=kit.ENDED))
    assert [archived.trial.number for archived in run.trials] == [2]


def test_a_sealed_run_wins_over_the_remnant_of_its_folder(tmp_path, kit):
    path = kit.run(tmp_path)
    (tmp_path / f"{path.stem}.partial").mkdir()
    assert find_run(tmp_path) == path
    assert [run.problem for run in list_runs(tmp_path)] == [""]


def test_a_results_folder_under_a_file_is_bad_usage(tmp_path, kit):
    (tmp_path / "file").write_text("not a folder")
    for results in (tmp_path / "file", tmp_path / "file" / "results"):
        with pytest.raises(UsageError, match="--results"):
            RunWriter.create(results, kit.header(), [])


def test_no_run_is_written_over_another(tmp_path, kit):
    writer = RunWriter.create(tmp_path, kit.header(), [])
    with pytest.raises(UsageError, match="another process is writing the run"):
        RunWriter.create(tmp_path, kit.header(), [])
    writer.close()
    with pytest.raises(UsageError, match="already"):
        RunWriter.create(tmp_path, kit.header(), [])
    kit.run(tmp_path, name="another")
    with pytest.raises(UsageError, match="already"):
        RunWriter.create(tmp_path, kit.header("another"), [])


def test_several_threads_write_at_once(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 8)
    barrier = threading.Barrier(4)

    def work(mine):
        recorders = [writer.begin(trial) for trial in mine]
        barrier.wait()
        for recorder, trial in zip(recorders, mine, strict=True):
            recorder.start(kit.CHANNELS)
            times, block = kit.samples(40_000, trial.number)
            for start_index in range(0, 40_000, 3000):
                cut = slice(start_index, start_index + 3000)
                recorder.append(times[cut], block[:, cut])
            recorder.finish(Ending(Outcome.COMPLETED), kit.STARTED, kit.ENDED)

    threads = [threading.Thread(target=work, args=(trials[n::4],)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    run = open_run(writer.seal(RunStatus.COMPLETE, ended=kit.ENDED))
    assert [archived.trial for archived in run.trials] == trials
    for archived in run.trials:
        expected = kit.samples(40_000, archived.trial.number)[1]
        assert archived.recording()["gyro_rate"].tobytes() == expected[1].tobytes()
