"""The digests of the tree, held against the format's description: computed here anew."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign.archive.layout.checksums import BLOCK, SeriesDigest, series_digest, text_digest
from campaign.archive.layout.packed_trial import PackedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.series import file_series
from campaign.archive.writing.packed_file import PackedFile, SampleColumns
from tests.archive.forging import canonical, sha256
from tests.archive.forging import series_digest as described

EDGES = [0, 1, 7, 32_767, 32_768, 32_769, 65_536, 100_003]


def noise(count: int) -> np.ndarray:
    return np.random.default_rng(count).normal(size=count)


@pytest.mark.parametrize("count", EDGES)
def test_the_digest_of_a_series_is_the_one_that_is_described(count):
    assert series_digest(noise(count)) == described(noise(count))


def test_digests_that_were_computed_by_hand():
    """`head -c 0 /dev/null | sha256sum`, and of one sample 1.0: `printf
    '\\0\\0\\0\\0\\0\\0\\xf0\\x3f' | sha256sum | xxd -r -p | sha256sum`."""
    assert series_digest(np.empty(0)) == (
        "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    )
    one = "cb28f8a8e2f299c9c1565edf833538594c9421bf9220a500a385dbe7e5a77d24"
    assert series_digest(np.array([1.0])) == one
    degree = "1ee6c7edad9ee3b7ce8c5acfd82e52ab6afad2c5178539e7ce49760567494905"
    assert text_digest("°") == degree  # printf '°' | sha256sum


@pytest.mark.slow
@given(st.lists(st.integers(0, 40_000), max_size=6))
@settings(max_examples=15, deadline=None)
def test_the_digest_does_not_depend_on_how_the_samples_come(lengths):
    samples, digest, at = noise(sum(lengths)), SeriesDigest(), 0
    for length in lengths:
        digest.update(samples[at : at + length])
        at += length
    assert digest.hexdigest() == described(samples)


def test_it_is_of_little_endian_doubles_however_they_lie_in_memory():
    samples = noise(50)
    assert series_digest(samples.astype(">f8")) == described(samples)
    assert series_digest(np.repeat(samples, 3)[::3]) == described(samples)


def test_every_sample_and_its_place_count():
    samples = noise(2 * BLOCK + 5)
    same = described(samples)
    for place in (0, BLOCK - 1, BLOCK, 2 * BLOCK + 4):
        changed = samples.copy()
        changed[place] = np.nextafter(changed[place], np.inf)
        assert series_digest(changed) != same
    swapped = np.concatenate((samples[BLOCK : 2 * BLOCK], samples[:BLOCK], samples[2 * BLOCK :]))
    assert series_digest(swapped) != same
    assert series_digest(np.array([0.0])) != series_digest(np.array([-0.0]))
    assert series_digest(samples[:-1]) != same


@pytest.mark.parametrize("chunk", [16, 1000, BLOCK])
@pytest.mark.parametrize("count", [0, 40, 33_000])
def test_columns_tell_the_digest_of_what_was_appended(tmp_path, chunk, count):
    samples = noise(count)
    kept = PackedFile(tmp_path / "x.trial")
    columns = SampleColumns(["x"], kept, chunk)
    for start in range(0, count, 999):
        columns.append([samples[start : start + 999]])
    found = columns.finish()[1]
    (series,) = columns.series
    kept.finish(PackedTrial(record="", trees=""))
    with (tmp_path / "x.trial").open("rb") as stored:
        samples_there = file_series(stored, "x", count, series).read(described(samples))
    assert samples_there.tobytes() == samples.tobytes()
    assert found == [described(samples)]


def test_a_sealed_run_has_the_digests_that_are_described(tmp_path, kit):
    """From the leaves to the root, with nothing but h5py, hashlib and json."""
    path = kit.run(tmp_path, [50, None, 40_000])
    with h5py.File(path) as file:
        run = file["run"]
        text = {
            name: item[()].decode() if item.dtype.kind == "S" else str(int(item[()]))
            for name, item in _datasets(run)
        }
        seal = json.loads(text["outcome/seal"])
        outside = {"outcome/seal", "outcome/file_sha256"}
        assert seal["texts"] == {n: sha256(t) for n, t in text.items() if n not in outside}
        assert (seal["format"], seal["run"]) == (3, text["entry_identifier"])
        finished = [
            entry
            for entry in map(json.loads, text["journal/data"].splitlines())
            if entry["event"] == "trial finished"
        ]
        lines = text["index/data"].splitlines()
        assert [entry["record"] for entry in finished] == [sha256(line) for line in lines]
        trees = {}
        for line in map(json.loads, text["trees/data"].splitlines()):
            assert line["sha256"] == sha256(canonical(line["tree"]))
            trees[line["sha256"]] = line["tree"]
        for number, record in enumerate(map(json.loads, lines), start=1):
            group = file[f"trial_{number:05d}"]
            assert group["record/json"][()].decode() == lines[number - 1]
            assert trees[record["trial"]["bench"]] == kit.trial(number).bench
            if number == 2:
                assert "channels" not in record
                continue
            assert record["time"] == described(group["data/time"][:])
            for channel in record["channels"]:
                series = group["data"][channel["name"]]
                assert channel["sha256"] == described(series[:])
                assert channel["unit"] == series.attrs["units"]
        preview = record["preview"]
        assert preview["channel"] == "gyro_rate"
        assert preview["time"] == described(group["preview/time"][:])
        assert preview["values"] == described(group["preview/gyro_rate"][:])
    assert open_run(path).root == sha256(text["outcome/seal"])


def _datasets(group):
    found = []
    group.visititems(
        lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) else None
    )
    return found
