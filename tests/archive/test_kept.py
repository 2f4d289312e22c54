"""Archives that earlier programs wrote, kept as they were: every later program must read them."""

import hashlib
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError
from campaign.estimate import Estimate, Window
from campaign.reason import Reason
from campaign.recording import ChannelInfo, Ending, Fault, Outcome, SafeState
from tests.archive.forging import series_digest

KEPT = Path(__file__).parent / "kept"

# Of every kept file, so that nobody writes them anew: `sha256sum --check` reads it.
HASHES = {
    name: digest for digest, name in map(str.split, (KEPT / "sha256sums").read_text().splitlines())
}


@pytest.mark.parametrize("name", HASHES)
def test_the_kept_files_are_those_that_were_written(name):
    assert hashlib.sha256((KEPT / name).read_bytes()).hexdigest() == HASHES[name]


def kept_3(name: str) -> RunReader:
    """A kept run of format 3, of which nothing is damaged."""
    run = open_run(KEPT / name)
    assert run.damaged == ()
    assert run.problems() == []
    return run


@pytest.mark.parametrize("name", ["format-3.nxs", "format-3.partial"])
def test_a_run_of_format_3_is_read_as_it_was_recorded(name):
    run = kept_3(name)
    assert (run.header.title, run.header.seed) == ("Kept: 20 °/s", 42)
    assert run.header.sources["benches/tiny.toml"] == "# π\r\n"
    first, second, third = run.trials
    assert (first.trial.seed, second.trial.seed, third.trial.seed) == (
        4611686018427387905,
        4611686018427387906,
        4611686018427387907,
    )
    assert first.trial.bench["axis"] == {"inertia": 35.0}
    assert second.trial.bench["name"] == "kept bench"
    assert first.started == "2026-11-22T08:03:00.000+00:00"
    recording = first.recording()
    assert (len(recording.time), recording.time[-1]) == (50, 49 / 1024)
    assert recording["command"][:3].tolist() == [0.0, 0.5, 1.0]
    rate = recording["gyro_rate"]
    assert str(rate[:4].tolist()) == "[nan, inf, -0.0, 3.0]"
    assert rate[-1] == 49.0
    assert recording["friction_torque"][-1] == 73.5
    assert recording.channels["friction_torque"].info == ChannelInfo(
        "friction_torque", "N m", "Friction torque", "N m", measured=False
    )
    [event] = recording.events
    assert (event.time, event.text) == (0.015625, "the load breaks away ↗")
    assert first.windows == (Window("steady", 0.5, 1.75),)
    assert first.estimates == (
        Estimate("coulomb_torque", 0.25, "N m", 0.2, 0.3, 0.95, "bootstrap"),
        Estimate("stribeck_rate", 0.125, "rad/s", reason=Reason("text", "one run only")),
    )
    assert run.planned(4).seed == 4611686018427387908


@pytest.mark.parametrize("name", ["format-3.nxs", "format-3.partial"])
def test_a_run_of_format_3_has_its_attempts_its_long_trials_and_digests_of_what_was_dropped(name):
    run = kept_3(name)
    [failed] = run.earlier_attempts[1]
    assert failed.ending == Ending(
        Outcome.FAULT,
        "no word for 1 s",
        SafeState.NOT_CONFIRMED,
        Fault.LOST_CONNECTION,
        {"latency_ms": {"most": 4.5}, "resends": 3},
    )
    assert failed.recording()["gyro_rate"][-1] == 39.0
    second, third = run.trials[1:]
    assert second.channels()[4].own_rate == 10.0
    recording = second.recording()
    assert len(recording.time) == 20_001
    assert recording["gyro_rate"][[0, 12_344, 12_345, 20_000]].tolist() == [0.75, 0.75, 9.0, 0.75]
    assert third.ending == Ending(Outcome.LIMIT, "rate reached 5 °/s")
    assert third.channel_names() == {"command", "gyro_rate", "friction_torque"}
    with pytest.raises(ArchiveError, match="its samples were not kept: to save room"):
        third.recording()
    command = third.samples.record.channels[0]
    assert command.sha256 == series_digest(np.arange(60) * 0.5)


def test_a_sealed_run_of_format_3_is_what_its_seal_says():
    run = kept_3("format-3.nxs")
    assert (run.status, run.reason) == (RunStatus.FAULT, "the operator said no")
    assert run.ended == "2026-11-22T08:07:00.000+00:00"
    assert verify_run(run.path).sound
    assert run.root == "0af35a0a17f6a6ef298d08a40a8c2f279819bc5fe7eba1a5db02d7d6656a07cd"
    assert run.trials[2].estimates == (
        Estimate("peak_rate", 29.5, "rad/s", reason=Reason("text", "one sample")),
    )
    for event in ('"decision":"retry"', '"step":"Lock the yaw axis"'):
        assert event in run.journal
    found = verify_run(run.path)
    assert found.problems == ()
    assert [remark.trial for remark in found.remarks] == ["trial-00003"]
    with h5py.File(run.path) as file:
        assert sorted(file) == ["run", *(f"trial_0000{n}" for n in ("1", "1_attempt_1", "2"))]
        assert file["trial_00002/definition"][()] == b"NXfriction_trial"
        shown = file["trial_00002/preview/gyro_rate"][:]
        assert (len(shown) <= 20_000, shown.min(), shown.max()) == (True, 0.75, 9.0)


@pytest.mark.parametrize("name", ["format-3.nxs", "format-3.partial"])
def test_a_run_of_format_3_can_be_gone_on_with(tmp_path, name):
    copy = tmp_path / name
    (shutil.copytree if (KEPT / name).is_dir() else shutil.copy)(KEPT / name, copy)
    at = "2026-11-23T08:00:00+00:00"
    writer = RunWriter.resume(copy, at=at, host={}, versions={}, command=())
    assert writer.finished == {1: "completed", 2: "completed", 3: "limit"}
    recorder = writer.begin(open_run(writer.folder).planned(4))
    recorder.finish(Ending(Outcome.FAULT, "no power"), at, at)
    path = writer.seal(RunStatus.FAILED_TRIALS, "no power", ended=at)
    assert verify_run(path).sound
    run = open_run(path)
    assert run.trials[0].recording()["gyro_rate"][-1] == 49.0
    assert [trial.ending.reason for trial in run.trials[2:]] == ["rate reached 5 °/s", "no power"]
    with pytest.raises(ArchiveError, match="its samples were not kept: to save room"):
        run.trials[2].recording()
