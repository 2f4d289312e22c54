"""What a recording says is kept beside it once it is on the disk, and costs it nothing."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_metrics import ArchivedMetrics
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.estimate import Estimate, Systematic
from campaign.policy import SampleRetention
from campaign.reason import Cause, Reason
from campaign.recording import Ending, Outcome
from tests.archive import forging

TOP = Estimate("top", 0.25, "rad/s", 0.21, 0.29, 0.95, "the largest sample", freedom=7.0)
FEW = Cause("few samples", "{samples} samples in {time:g} s")
LAST = Estimate.without_interval("last", -1.5, "N m", FEW(samples=1, time=2.0, all_of_it=True))
FOUND = ArchivedMetrics((TOP, LAST), "campaign 0.1.0")

CRASH = """
import os, signal, sys
from pathlib import Path
writer, trials = kit.begin(Path(sys.argv[1]), 2)
recorder = kit.record_trial(writer, trials[0], 500)
recorder.measure(lambda archived: os.kill(os.getpid(), signal.SIGKILL))
"""


def begun(folder: Path, kit) -> RunWriter:
    return kit.begin(folder, 2)[0]


def finish(writer: RunWriter, kit, number: int = 1):
    return kit.recorded(writer, kit.trial(number), 500)


def test_whoever_measures_reads_what_is_on_the_disk(tmp_path: Path, kit) -> None:
    """The trial, its samples and its place, as anybody has them who opens the run meanwhile."""
    writer = begun(tmp_path, kit)
    seen: list[ArchivedTrial] = []

    def measure(archived: ArchivedTrial) -> ArchivedMetrics:
        (there,) = open_run(writer.folder).trials
        assert (archived.path, archived.entry) == (there.path, there.entry)
        assert archived.trial == there.trial == kit.trial(1)
        rate = archived.recording()["gyro_rate"]
        assert rate.tobytes() == kit.samples(500)[1][1].tobytes()
        assert there.recording()["gyro_rate"].tobytes() == rate.tobytes()
        assert verify_run(writer.folder).sound
        seen.append(archived)
        return ArchivedMetrics()

    assert finish(writer, kit).measure(measure) == ""
    assert seen
    writer.close()


@pytest.mark.slow
def test_a_program_that_dies_while_it_measures_has_lost_no_recording(tmp_path: Path, kit) -> None:
    child = kit.python(CRASH, tmp_path)
    child.communicate()
    assert child.returncode == -signal.SIGKILL
    (folder,) = tmp_path.glob("*.partial")
    assert verify_run(folder).sound
    writer = RunWriter.resume(folder, **kit.RESUMED)
    assert writer.finished == {1: Outcome.COMPLETED}  # so it is not executed again
    (trial,) = open_run(writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)).trials
    assert trial.recording()["gyro_rate"].tobytes() == kit.samples(500)[1][1].tobytes()
    assert trial.estimates == ()


def test_metrics_are_the_same_in_folder_file_and_resumed_run(tmp_path: Path, kit) -> None:
    """Every field, and only of the attempt that was measured."""
    full = Estimate(
        "full", 1e-300, "s", None, 2.0, 0.9, "m", FEW(samples=3, time=0.5),
        standard_error=0.5, freedom=3.5,
        systematic=(Systematic("inertia", 0.1, of_rig=True), Systematic("alignment")),
    )  # fmt: skip
    found = ArchivedMetrics((full, TOP, LAST), "a laboratory's 2.1")
    writer = begun(tmp_path, kit)
    finish(writer, kit, 1).measure(lambda archived: FOUND)
    finish(writer, kit, 1).measure(lambda archived: found)
    finish(writer, kit, 2)

    def check(first: ArchivedTrial) -> None:
        assert first.estimates == found.estimates
        assert first.measured_by == found.by

    check(writer.archived(1))
    folder = open_run(writer.folder)
    check(folder.trials[0])
    assert folder.earlier_attempts[1][0].estimates == FOUND.estimates
    assert folder.trials[1].estimates == ()
    sealed = writer.seal(RunStatus.INTERRUPTED, "a person", ended=kit.ENDED)
    run = open_run(sealed)
    check(run.trials[0])
    assert run.earlier_attempts[1][0].estimates == FOUND.estimates
    assert verify_run(sealed).sound
    resumed = RunWriter.resume(sealed, **kit.RESUMED)
    check(resumed.archived(1))
    again = resumed.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    check(open_run(again).trials[0])
    assert verify_run(again).sound


def test_a_reason_that_an_older_journal_has_in_words_is_read(tmp_path: Path, kit) -> None:
    writer = begun(tmp_path, kit)
    finish(writer, kit).measure(lambda archived: FOUND)
    journal = writer.folder / JOURNAL
    *first, line = journal.read_text(encoding="utf-8").splitlines()
    measured = json.loads(line)
    values = [["samples", 1], ["time", 2.0], ["all_of_it", True]]
    now = {"code": "few samples", "text": "1 samples in 2 s", "values": values}
    assert measured["estimates"][1].pop("reason") == now
    measured["estimates"][1]["reason"] = "one sample"
    journal.write_text("\n".join((*first, json.dumps(measured), "")), encoding="utf-8")
    top, last = open_run(writer.folder).trials[0].estimates
    assert (top, last.reason) == (TOP, Reason("text", "one sample"))
    writer.close()


def test_a_damaged_journal_costs_metrics_and_no_trial(tmp_path: Path, kit) -> None:
    writer = begun(tmp_path, kit)
    finish(writer, kit).measure(lambda archived: FOUND)
    sealed = writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    with h5py.File(sealed, "r+") as file:
        text = forging.text_of(file, "run/journal/data")
        assert '"value":0.25' in text
        forging.put_text(file, "run/journal/data", text.replace('"value":0.25', '"value":0.26'))
    forging.rehash(sealed)
    assert not verify_run(sealed).sound
    (trial,) = open_run(sealed).trials
    assert trial.estimates == ()
    assert len(trial.recording().time) == 500


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ({"record": "ab" * 32}, "has metrics of trial 1, which had not finished"),
        ({}, "has metrics of trial 1 twice"),
    ],
)
def test_metrics_belong_to_one_finished_trial(tmp_path: Path, kit, line, said: str) -> None:
    writer = begun(tmp_path, kit)
    finish(writer, kit).measure(lambda archived: FOUND)
    writer.close()
    assert verify_run(writer.folder).sound
    journal = writer.folder / JOURNAL
    told = json.loads(journal.read_text().splitlines()[-1])
    assert told["event"] == "trial measured"
    with journal.open("a") as file:
        file.write(forging.canonical(told | line) + "\n")
    assert said in "\n".join(str(problem) for problem in verify_run(writer.folder).problems)


def test_what_cannot_be_kept_costs_the_metrics_only(tmp_path: Path, kit) -> None:
    strange = Estimate(
        "x", 1.0, "", reason=Reason("test", "r"), systematic=(Systematic("s", float("inf")),)
    )
    writer = begun(tmp_path, kit)
    before = (writer.folder / JOURNAL).read_bytes()
    recorder = finish(writer, kit)
    after = (writer.folder / JOURNAL).read_bytes()
    said = recorder.measure(lambda archived: ArchivedMetrics((strange,), "x"))
    assert "cannot be kept" in said
    assert (writer.folder / JOURNAL).read_bytes() == after != before
    alien = SimpleNamespace(name="top", value=1.0)  # of a plug-in: no estimate at all
    assert "cannot be kept" in recorder.measure(lambda archived: ArchivedMetrics((alien,), "x"))
    assert (writer.folder / JOURNAL).read_bytes() == after
    assert recorder.measure(lambda archived: ArchivedMetrics(problem="no samples")) == "no samples"
    writer.close()


def test_without_samples_nobody_looks(tmp_path: Path, kit) -> None:
    """Where they were not kept, or the trial failed before there were any."""

    def measure(archived: ArchivedTrial) -> ArchivedMetrics:
        raise AssertionError

    writer = begun(tmp_path, kit)
    failed = writer.begin(kit.trial(1))
    failed.finish(Ending(Outcome.FAULT, "no power"), kit.STARTED, kit.ENDED)
    assert failed.measure(measure) == ""
    writer.close()


@pytest.mark.parametrize("seconds", [5.0, 50.0])  # planned: 5000 samples, more than come
def test_samples_that_are_not_kept_are_measured_before_they_go(
    tmp_path: Path, kit, seconds: float
) -> None:
    time, block = kit.samples(9000)  # more than one chunk
    read = []

    def measure(archived: ArchivedTrial) -> ArchivedMetrics:
        read.append(archived.recording())
        return FOUND

    writer = begun(tmp_path, kit)
    trial = kit.trial(1)
    task = trial.task.model_copy(update={"duration": seconds})
    trial = trial.model_copy(update={"task": task})
    dropped = kit.started(writer, trial, (), kit.CHANNELS, SampleRetention("none"))
    for part in (slice(0, 4000), slice(4000, 9000)):
        dropped.append(time[part], block[:, part])
    dropped.finish(Ending(Outcome.COMPLETED), kit.STARTED, kit.ENDED)
    assert dropped.measure(measure) == ""
    writer.close()
    assert np.array_equal(read[0].time, time, equal_nan=True)
    for channel, row in zip(kit.CHANNELS, block, strict=True):
        assert np.array_equal(read[0][channel.name], row, equal_nan=True)


def test_nothing_is_measured_before_it_is_kept(tmp_path: Path, kit) -> None:
    writer = begun(tmp_path, kit)
    with pytest.raises(RuntimeError, match="before it is finished"):
        writer.begin(kit.trial(1)).measure(lambda archived: FOUND)
    writer.close()
