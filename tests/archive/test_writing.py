"""Streaming in flat memory, previews, and what a backend may not hand over."""

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign.archive.layout.storage import CHUNK, pack
from campaign.archive.reading.archived_metrics import ArchivedMetrics
from campaign.archive.reading.packed_trial_reader import read_packed
from campaign.archive.writing.packed_file import PackedFile, SampleColumns
from campaign.archive.writing.preview import Preview
from campaign.archive.writing.trial_writer import FolderWriter
from campaign.archive.writing.writer import RunWriter
from campaign.errors import BackendError
from campaign.recording import ChannelInfo


def test_memory_is_one_chunk_whatever_is_appended(tmp_path):
    path = tmp_path / "x.trial"
    file = PackedFile(path)
    columns = SampleColumns(["time", "x", "y"], file)
    assert columns._buffer.nbytes == 3 * CHUNK * 8
    rows = [np.zeros(5000)] * 3
    for _ in range(40):
        columns.append(rows)
        assert columns._buffer.nbytes == 3 * CHUNK * 8
    columns.finish()
    assert [len(series.chunks) for series in columns.series] == [7] * 3  # all but the last is there
    assert columns.length == 200_000
    file.close()


def series_of(recording, kit):
    return [recording.time.tobytes(), *(recording[each.name].tobytes() for each in kit.CHANNELS)]


@pytest.mark.parametrize("count", [1, CHUNK - 1, CHUNK, CHUNK + 50, 2 * CHUNK])
@pytest.mark.parametrize("worker", [False, True])
def test_metrics_see_every_sample_of_a_recording(kit, tmp_path, count, worker):
    """In a worker process before the batch is published."""
    trial, (time, block) = kit.trial(1), kit.samples(count)
    alone, _ = kit.begin(tmp_path / "run", [trial])
    (tmp_path / "batch").mkdir()
    writer = FolderWriter(tmp_path / "batch", {1: 1}) if worker else alone
    recorder, seen = kit.recorded(writer, trial, count), []

    def measure(data):
        seen.append(series_of(data.recording(), kit))
        return ArchivedMetrics()

    assert recorder.measure(measure) == ""
    assert seen == [[row.tobytes() for row in (time, *block)]]
    if worker:
        files = (tmp_path / "batch").iterdir
        assert [path.name for path in files()] == ["trial-00001.trial.part"]
        writer.publish()
        ((finished,), (file,)) = writer.take_entries(), files()
        assert finished.file == file.name == "trial-00001.trial"
    else:
        assert [series_of(writer.archived(1).recording(), kit)] == seen
    alone.close()


def test_the_preview_keeps_within_its_points_however_long_the_recording():
    preview = Preview(points=100)
    for block in range(50):
        time = np.arange(block * 64, (block + 1) * 64, dtype=float)
        preview.add(time, np.sin(time))
        assert len(preview.points()[0]) <= 100


@pytest.mark.slow
@given(
    values=st.lists(st.floats(-1e6, 1e6) | st.just(np.nan), min_size=1, max_size=700),
    points=st.sampled_from([8, 20, 100]),
)
@settings(max_examples=60, deadline=None)
def test_the_preview_holds_the_extremes_at_their_times(values, points):
    samples = np.array(values)
    times = np.arange(len(samples)) * 0.5
    preview = Preview(points)
    for start in range(0, len(samples), 64):
        preview.add(times[start : start + 64], samples[start : start + 64])
    at, shown = preview.points()
    assert len(at) <= points
    assert np.all(np.diff(at) >= 0)
    for time, value in zip(at, shown, strict=True):
        assert np.array_equal(samples[int(time * 2)], value, equal_nan=True)
    if not np.all(np.isnan(samples)):
        assert np.nanmax(shown) == np.nanmax(samples)
        assert np.nanmin(shown) == np.nanmin(samples)


@given(st.lists(st.floats(width=64), min_size=1, max_size=300), st.booleans())
@settings(max_examples=60, deadline=None)
def test_hdf5s_own_filters_undo_our_chunks(values, shuffled):
    samples = np.array(values)
    with h5py.File("x.h5", "w", driver="core", backing_store=False) as file:
        made = {"shape": samples.shape, "chunks": samples.shape, "dtype": "<f8"}
        dataset = file.create_dataset("x", shuffle=shuffled, compression="gzip", **made)
        dataset.id.write_direct_chunk((0,), pack(samples, shuffled))
        assert dataset[:].tobytes() == samples.tobytes()


def test_every_dataset_but_samples_carries_its_checksum(tmp_path, kit):
    """Those of samples stand in the record, so that none can be exchanged with its checksum."""
    without = []

    def check(name, item):
        if isinstance(item, h5py.Dataset) and "sha256" not in item.attrs:
            without.append(name)

    with h5py.File(kit.run(tmp_path, [30, None, 20_001])) as file:
        file.visititems(check)
    series = {"time", *(channel.name for channel in kit.CHANNELS)}
    expected = {f"trial_0000{n}/data/{name}" for n in (1, 3) for name in series}
    expected |= {"trial_00003/preview/time", "trial_00003/preview/gyro_rate"}
    assert set(without) == expected | {"run/outcome/file_sha256"}


def test_sealing_copies_chunks_as_they_are(tmp_path, kit):
    writer, _ = kit.begin(tmp_path, 1, [CHUNK + 10])
    name = "trial_00001/data/gyro_rate"
    content = (writer.folder / "trial-00001.trial").read_bytes()
    packed = read_packed(writer.folder / "trial-00001.trial", "trial_00001")
    (series,) = (each for each in packed.groups["data"] if each.name == "gyro_rate")
    before = [(0, content[offset : offset + size]) for offset, size in series.chunks]
    with h5py.File(writer.seal("complete", ended=kit.ENDED)) as file:
        after = [file[name].id.read_direct_chunk((start,)) for start in (0, CHUNK)]
    assert before == after


@pytest.fixture
def recorder(tmp_path, kit):
    return RunWriter.create(tmp_path, kit.header(), [kit.trial(1)]).begin(kit.trial(1))


def test_samples_that_do_not_fit_the_channels_are_a_backend_fault(recorder, kit):
    with pytest.raises(BackendError, match="before the channels"):
        recorder.append(np.zeros(3), np.zeros((3, 3)))
    recorder.start(kit.CHANNELS)
    for times, block in ((3, (2, 3)), (3, (3, 4)), ((3, 1), (3, 3))):
        with pytest.raises(BackendError, match="do not fit"):
            recorder.append(np.zeros(times), np.zeros(block))
    with pytest.raises(BackendError, match="announced twice"):
        recorder.start(kit.CHANNELS)


@pytest.mark.parametrize("names", [(), ("time",), ("a", "a"), ("a b",), ("../a",), ("",), ("a/b",)])
def test_channels_need_names_that_nexus_allows(recorder, names):
    channels = tuple(ChannelInfo(name, "rad", "Label", "deg") for name in names)
    with pytest.raises(BackendError, match="channel"):
        recorder.start(channels)


def test_an_abandoned_trial_leaves_a_line_and_no_file(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 1)
    recorder = kit.started(writer, trials[0], ())
    recorder.abandon(kit.ENDED, "the cable came off")
    assert not list(writer.folder.glob("trial-*"))
    assert "the cable came off" in (writer.folder / "journal.jsonl").read_text()
