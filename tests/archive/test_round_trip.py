"""What goes into an archive comes out of it, to the bit, for us and for everybody else."""

import shutil
import subprocess
import time

import h5py
import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.storage import CHUNK
from campaign.archive.reading.open_run import open_run
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.preview import PREVIEW_POINTS
from campaign.recording import Ending, Outcome, SafeState
from campaign.trial import Role


def equal_bits(a, b):
    return np.asarray(a, "<f8").tobytes() == np.asarray(b, "<f8").tobytes()


@pytest.mark.parametrize("count", [0, 1, 7, CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK + 7])
def test_a_recording_comes_back_to_the_bit(tmp_path, kit, count):
    run = open_run(kit.run(tmp_path, [count], block=999))
    recording = run.trials[0].recording()
    times, block = kit.samples(count, 1)
    assert equal_bits(recording.time, times)
    assert list(recording.channels) == ["command", "gyro_rate", "friction_torque"]
    for info, row in zip(kit.CHANNELS, block, strict=True):
        channel = recording.channels[info.name]
        assert equal_bits(channel.samples, row)
        described = info.with_samples(channel.samples)
        assert (channel.unit, channel.label) == (described.unit, described.label)
        assert (channel.display_unit, channel.measured) == (info.display_unit, info.measured)
    assert [(e.time, e.text) for e in recording.events] == [(0.25, "the load breaks away ↗")]
    assert recording.ending == Ending(Outcome.COMPLETED)


def test_the_header_and_the_trials_come_back(tmp_path, kit):
    run = open_run(kit.run(tmp_path, [20, None, 30]))
    assert run.header == kit.header().model_copy(update={"trials": 3})
    assert [archived.trial for archived in run.trials] == [kit.trial(n) for n in (1, 2, 3)]
    assert (run.status, run.reason) == (RunStatus.FAILED_TRIALS, "no power")
    assert run.safe_state is SafeState.CONFIRMED
    assert (run.ended, run.trials[0].started) == ("2026-11-21T09:40:00Z", kit.STARTED)
    assert [planned.label for planned in run.plan] == [kit.trial(n).label for n in (1, 2, 3)]
    assert run.plan[0].role is Role.MEASUREMENT
    assert run.trials_of("map") == run.trials
    assert run.trials_of("another") == ()


def test_a_trial_that_recorded_nothing_is_kept_with_its_reason(tmp_path, kit):
    run = open_run(kit.run(tmp_path, [None]))
    assert run.trials[0].ending == Ending(Outcome.FAULT, "no power")
    assert run.trials[0].recording().channels == {}
    assert len(run.trials[0].recording().time) == 0


def test_nothing_but_the_file_is_left_when_it_is_sealed(tmp_path, kit):
    path = kit.run(tmp_path)
    assert list(tmp_path.iterdir()) == [path]


def test_an_unfinished_run_opens_with_what_was_finished(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 2, [40])
    writer.begin(trials[1]).start(kit.CHANNELS)
    run = open_run(writer.folder)
    assert run.status is RunStatus.INCOMPLETE
    assert run.safe_state is SafeState.NOT_CONFIRMED
    assert [archived.trial.number for archived in run.trials] == [1]
    assert len(run.plan) == 2
    assert equal_bits(run.trials[0].recording().time, kit.samples(40)[0])


def test_an_interrupted_run_is_sealed_without_its_open_trial(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 2, [40])
    writer.begin(trials[1]).start(kit.CHANNELS)
    path = writer.seal(RunStatus.INTERRUPTED, "Ctrl-C", SafeState.NOT_CONFIRMED, ended=kit.ENDED)
    run = open_run(path)
    assert (run.status, run.reason) == (RunStatus.INTERRUPTED, "Ctrl-C")
    assert run.safe_state is SafeState.NOT_CONFIRMED
    assert [archived.trial.number for archived in run.trials] == [1]
    assert '"event":"trial abandoned"' in run.journal


def test_equal_runs_make_equal_bytes_at_any_time_and_in_any_blocks(tmp_path, kit):
    first = kit.run(tmp_path / "a", [50, 2 * CHUNK + 3], block=1000)
    time.sleep(1.1)  # HDF5 notes times in whole seconds, where it notes them
    second = kit.run(tmp_path / "b", [50, 2 * CHUNK + 3], block=4321)
    assert first.read_bytes() == second.read_bytes()


def test_the_file_knows_whether_it_was_changed(sealed):
    assert verify_run(sealed).sound
    with h5py.File(sealed, "r+"):
        pass  # a viewer that opens for writing and writes nothing
    assert verify_run(sealed).sound
    with h5py.File(sealed) as file:
        place = file["trial_00001/data/gyro_rate"].id.get_chunk_info(0).byte_offset
    content = bytearray(sealed.read_bytes())
    content[place + 10] ^= 1
    sealed.write_bytes(content)
    assert not verify_run(sealed).sound


def test_the_default_plot_is_found_by_following_the_file(sealed):
    with h5py.File(sealed) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        signal = data[data.attrs["signal"]]
        axis = data[data.attrs["axes"][0]]
        assert entry.name == "/trial_00001"
        assert signal.attrs["units"] == "rad/s"
        assert signal.attrs["long_name"] == "Load rate (rad/s)"
        assert axis.attrs["units"] == "s"
        assert signal.dims[0][0] == axis
        for name in data.attrs["auxiliary_signals"]:
            assert data[name].dims[0][0] == axis
            assert data[name].shape == axis.shape


def test_sources_lie_in_the_file_verbatim(sealed, kit):
    with h5py.File(sealed) as file:
        notes = [file["run"][name] for name in file["run"] if name.startswith("source")]
        found = {n["file_name"][()].decode(): n["data"][()].decode() for n in notes}
        assert found == kit.header().sources
        assert {note["type"][()] for note in notes} == {b"application/toml"}


def sealed_samples(results, kit, times, block):
    writer, trials = kit.begin(results, 1)
    kit.recorded(writer, trials[0], (times, np.stack(block)))
    return writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)


def test_values_of_a_converter_are_stored_whole_and_others_shuffled(tmp_path, kit):
    """Few values that come again and again are smaller unshuffled; noise and waves are not."""
    times = np.arange(6000) / 1000.0
    noise = np.random.default_rng(3).normal(size=6000)
    counts = np.round(300 * noise) * (np.pi / 2**23)
    with h5py.File(sealed_samples(tmp_path, kit, times, (np.sin(times), counts, noise))) as file:
        data = file["trial_00001/data"]
        shuffled = [data[name].shuffle for name in ("command", "gyro_rate", "friction_torque")]
        assert shuffled == [True, False, True]
        assert data["gyro_rate"].id.get_storage_size() < 6000 * 4
        assert equal_bits(data["gyro_rate"][:], counts)


def test_a_long_recording_opens_on_a_preview_that_misses_no_peak(tmp_path, kit):
    count = 5 * CHUNK
    block = np.zeros((3, count))
    block[1, [12_345, 70_001]] = [9.0, -7.0]
    with h5py.File(sealed_samples(tmp_path, kit, np.arange(count) / 1000.0, block)) as file:
        entry = file[file.attrs["default"]]
        plotted = entry[entry.attrs["default"]]
        assert (plotted.attrs["signal"], *plotted.attrs["axes"]) == ("gyro_rate", "time")
        assert entry.attrs["default"] == "preview"
        shown, at = entry["preview/gyro_rate"][:], entry["preview/time"][:]
        assert entry["preview/gyro_rate"].dims[0][0] == entry["preview/time"]
        assert len(entry["data/gyro_rate"]) == count
    assert 10_000 <= len(at) == len(shown) <= PREVIEW_POINTS
    assert np.all(np.diff(at) >= 0)
    assert (shown.max(), at[shown.argmax()]) == (9.0, 12.345)
    assert (shown.min(), at[shown.argmin()]) == (-7.0, 70.001)


@pytest.mark.skipif(shutil.which("h5dump") is None, reason="h5dump is not installed")
def test_h5dump_reads_every_dataset(sealed):
    dumped = subprocess.run(["h5dump", sealed], capture_output=True, text=True, check=False)
    assert dumped.returncode == 0
    assert dumped.stderr == ""
    assert dumped.stdout.count('DATASET "gyro_rate"') == 2
