"""The file of one trial: as docs/developers/archive-format.md says, else refused."""

from __future__ import annotations

import hashlib
import json
import zlib
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.folder import read_trial_file
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.packed_trial_reader import read_packed
from campaign.archive.writing import trial_writer
from campaign.archive.writing.packed_file import copy_packed
from campaign.archive.writing.sealed_file import SealedFile
from campaign.archive.writing.trial_writer import FolderWriter
from campaign.errors import ArchiveError

COUNT = 70_000  # two chunks and a part of one, and a preview


@pytest.fixture
def writer(tmp_path, kit):
    writer, _ = kit.begin(tmp_path, 1, [COUNT])
    yield writer
    writer.close()


@pytest.fixture
def path(writer) -> Path:
    return writer.folder / "trial-00001.trial"


def parts(content: bytes) -> tuple[bytes, dict]:
    """What stands before the description, and that; read as the document says."""
    start = int.from_bytes(content[-8:], "little")
    return content[:start], json.loads(content[start:-8])


def put(path: Path, before: bytes, told: dict) -> None:
    path.write_bytes(before + json.dumps(told).encode() + len(before).to_bytes(8, "little"))


def read(path: Path, writer) -> ArchivedTrial:
    return read_trial_file(path, writer._last[1])


def test_a_program_that_knows_the_document_reads_every_sample(path, writer, kit):
    content = path.read_bytes()
    before, told = parts(content)
    assert before.startswith(b"campaign trial 1\n")
    record = json.loads(told["record"])
    assert record["samples"] == COUNT
    time, block = kit.samples(COUNT)
    names = ["time", *(channel["name"] for channel in record["channels"])]
    for name, expected in zip(names, (time, *block), strict=True):
        (series,) = (each for each in told["groups"]["data"] if each["name"] == name)
        found = []
        for offset, size in series["chunks"]:
            raw = np.frombuffer(zlib.decompress(content[offset : offset + size]), np.uint8)
            planes = raw.reshape(8, -1).T if series["shuffled"] else raw
            found.append(np.ascontiguousarray(planes).view("<f8").ravel())
            assert len(found[-1]) == series["chunk"]
        samples = np.concatenate(found)
        assert samples[:COUNT].tobytes() == expected.tobytes()
        assert not samples[COUNT:].any()


def test_a_copy_has_the_same_trial(path, writer, tmp_path):
    copy = tmp_path / "trial-00001.trial"
    copy_packed(path, read_packed(path, "trial_00001"), copy)
    sizes = [
        [size for each in read_packed(one, "trial_00001").groups["data"] for _, size in each.chunks]
        for one in (path, copy)
    ]
    assert sizes[0] == sizes[1]
    assert list(read(copy, writer).problems()) == []


@pytest.mark.parametrize("left", [0, 5, 17, 20, 1000, -1, -8, -9])
def test_a_file_that_was_cut_off_is_refused(path, writer, left):
    path.write_bytes(path.read_bytes()[:left])
    with pytest.raises(ArchiveError, match=r"trial-00001\.trial"):
        read(path, writer)


@pytest.mark.parametrize("start", [0, 16, 1 << 40, (1 << 64) - 1])
def test_a_description_that_lies_elsewhere_is_refused(path, writer, start):
    path.write_bytes(path.read_bytes()[:-8] + start.to_bytes(8, "little"))
    with pytest.raises(ArchiveError, match=r"trial-00001\.trial: its end is damaged"):
        read(path, writer)


def lose_series(told: dict) -> None:
    del told["groups"]["data"][1]


def lose_tree(told: dict) -> None:
    told["trees"] = told["trees"].splitlines()[0] + "\n"


def lose_chunk(told: dict) -> None:
    del told["groups"]["data"][1]["chunks"][1]


def exchange(told: dict) -> None:
    first, second = told["groups"]["data"][1:3]
    first["name"], second["name"] = second["name"], first["name"]


def repeat_chunk(told: dict) -> None:
    told["groups"]["data"][1]["chunks"].append([17, 0])


def smaller(told: dict) -> None:
    told["groups"]["data"][1]["chunk"] = 1


def plain(told: dict) -> None:
    told["groups"]["data"][1]["shuffled"] = not told["groups"]["data"][1]["shuffled"]


@pytest.mark.parametrize(
    "change", [lose_series, lose_chunk, exchange, repeat_chunk, smaller, plain]
)
def test_samples_that_are_not_the_recorded_ones_are_named_and_the_others_are_read(
    path, writer, kit, change
):
    before, told = parts(path.read_bytes())
    change(told)
    put(path, before, told)
    found = list(read(path, writer).problems())
    names = {channel.name for channel in kit.CHANNELS[: 2 if change is exchange else 1]}
    assert {each.split(": ")[1] for each in found} == {
        f"/trial_00001/data/{name}" for name in names
    }
    (trial,) = open_run(writer.folder).trials
    with pytest.raises(ArchiveError, match="/trial_00001/data/command: "):
        trial.recording()["command"]
    assert len(trial.recording()[kit.CHANNELS[2].name]) == COUNT


@pytest.mark.parametrize(
    "change",
    [
        lambda told: told.pop("record"),
        lambda told: told.update(record="{}"),
        lambda told: told.update(trees=told["trees"].replace("35.0", "36.0")),
        lambda told: told["groups"]["data"][0].update(chunk=0),
        lambda told: told["groups"]["data"][0].update(chunk=1 << 30),
        lambda told: told["groups"]["data"][0].update(chunks=[[-1, 4]]),
        lambda told: told["groups"]["data"][1]["chunks"].append([1 << 60, 1 << 60]),
        lambda told: told["groups"]["data"][1]["chunks"].append([17, 1 << 60]),
        lambda told: told["groups"]["data"][1].update(chunks=told["groups"]["data"][0]["chunks"]),
        lambda told: told["groups"]["data"][1]["chunks"].append([3, 8]),
        lose_tree,
    ],
)
def test_a_description_that_is_none_is_refused(path, writer, change):
    before, told = parts(path.read_bytes())
    change(told)
    put(path, before, told)
    with pytest.raises(ArchiveError, match=r"trial-00001\.trial"):
        read(path, writer)


def test_trees_that_are_nested_too_deeply_are_refused(path, writer):
    before, told = parts(path.read_bytes())
    tree = '{"a":' * 100_000 + "1" + "}" * 100_000
    told["trees"] += f'{{"sha256":"{hashlib.sha256(tree.encode()).hexdigest()}","tree":{tree}}}\n'
    put(path, before, told)
    with pytest.raises(ArchiveError, match="is nested too deeply"):
        read(path, writer)


def test_series_of_one_trial_may_have_chunks_of_different_lengths(tmp_path, kit, writer, path):
    """No trial file of this program has; sealing reads what the file says."""
    before, told = parts(path.read_bytes())
    record = json.loads(told["record"])
    first = told["groups"]["data"][1]
    samples = kit.samples(COUNT)[1][0]
    padded = np.concatenate((samples, np.zeros(-COUNT % 10_000)))
    first.update(chunk=10_000, shuffled=False, chunks=[])
    for chunk in padded.reshape(-1, 10_000):
        packed = zlib.compress(chunk.astype("<f8").tobytes())
        first["chunks"].append([len(before), len(packed)])
        before += packed
    assert record["channels"][0]["name"] == first["name"]
    put(path, before, told)
    journal = writer.folder / "journal.jsonl"
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    journal.write_text(journal.read_text().replace(writer._last[1].sha256, digest))
    sealer = SealedFile(tmp_path / "sealed.part")
    sealer.copy(writer.folder, read_journal(journal).attempts[0], "trial_00001")
    assert sealer._file["trial_00001/data"][first["name"]][:].tobytes() == samples.tobytes()
    sealer.discard()


@pytest.mark.parametrize("change", [lose_series, lose_tree])
def test_a_trial_without_one_of_its_parts_is_not_sealed(tmp_path, writer, path, change):
    before, told = parts(path.read_bytes())
    change(told)
    put(path, before, told)
    finished = writer._last[1].model_copy(
        update={"sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    )
    sealer = SealedFile(tmp_path / "sealed.part")
    with pytest.raises(ArchiveError, match=r"trial-00001\.trial"):
        sealer.copy(writer.folder, finished, "trial_00001")
    sealer.discard()


def test_a_batch_that_cannot_be_published_leaves_no_file(tmp_path, kit, monkeypatch):
    writer = FolderWriter(tmp_path, {1: 1, 2: 1})
    for number in (1, 2):
        kit.recorded(writer, kit.trial(number), 10)

    def full(files):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(trial_writer, "publish_all", full)
    with pytest.raises(ArchiveError, match="2 trials are not archived, those before are"):
        writer.publish()
    assert list(tmp_path.iterdir()) == []
