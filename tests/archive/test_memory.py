"""Memory of a run with many trials: what a writer and a sealing keep of each."""

from __future__ import annotations

import hashlib
import os
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import h5py
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing import sealed_file
from campaign.archive.writing.long_text import SHORT
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError
from campaign.policy import SampleRetention
from campaign.recording import Ending, Event, Outcome

FEW = 40
LONG = 40_000
"""Characters of a record; the journal's lines have none of them."""


def begun(folder: Path, kit, count: int) -> RunWriter:
    """A run in which so many trials without samples were recorded."""
    writer, trials = kit.begin(folder, count)
    for trial in trials:
        samples = kit.samples(10, trial.number)
        recorder = kit.started(writer, trial, samples, kit.CHANNELS, SampleRetention("none"))
        recorder.event(Event(0.0, "x" * LONG))
        recorder.finish(Ending(Outcome.COMPLETED), kit.STARTED, kit.ENDED)
    return writer


def most(folder: Path, kit, count: int) -> int:
    """Bytes at most while such a run is recorded and sealed."""
    tracemalloc.start()
    try:
        begun(folder, kit, count).seal(RunStatus.COMPLETE, ended=kit.ENDED)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_no_text_of_a_trial_stays_in_memory(tmp_path: Path, kit, monkeypatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)  # takes most of the time
    few, many = (most(tmp_path / str(count), kit, count) for count in (FEW, 3 * FEW))
    assert (many - few) / (2 * FEW) < LONG / 2


@pytest.mark.slow
def test_texts_written_in_pieces_are_what_the_folder_had(tmp_path: Path, kit, monkeypatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    writer = begun(tmp_path, kit, 5 * FEW)
    notes = {"plan": "plan.jsonl", "plan_trials": "plan-trials.jsonl", "journal": "journal.jsonl"}
    texts = {note: (writer.folder / name).read_text() for note, name in notes.items()}
    assert min(map(len, texts.values())) > SHORT
    path = writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    assert verify_run(path).problems == ()
    with h5py.File(path) as file:
        for note, text in texts.items():
            data = file[f"run/{note}/data"]
            assert data[()].decode().startswith(text)
            assert data.attrs["sha256"].decode() == hashlib.sha256(data[()]).hexdigest()
        assert len(file["run/index/data"][()].splitlines()) == 5 * FEW


@pytest.mark.parametrize(
    ("mode", "place", "told"),
    [
        ("ab", 0, "a text was changed while it was sealed"),
        ("r+b", 100, "does not match its checksum"),
    ],
)
def test_a_text_that_changes_while_it_is_sealed_leaves_the_folder(
    tmp_path: Path, kit, monkeypatch, mode: str, place: int, told: str
) -> None:
    """A longer one would lie on samples that were read back before."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    writer = begun(tmp_path, kit, 5 * FEW)
    plan, read = writer.folder / "plan.jsonl", sealed_file.SealedFile._index

    def changing(file: sealed_file.SealedFile, folder: Path) -> Iterator[bytes]:
        with plan.open(mode) as raw:
            raw.seek(place)
            raw.write(b"{}\n")
        yield from read(file, folder)

    monkeypatch.setattr(sealed_file.SealedFile, "_index", changing)
    with pytest.raises(ArchiveError, match=told):
        writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    assert writer.folder.is_dir()
    assert not writer.folder.with_suffix(".nxs").exists()
