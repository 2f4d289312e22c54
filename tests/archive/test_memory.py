"""Memory of a run with many trials: what a writer and a sealing keep of each."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path

from campaign.archive import RunStatus, RunWriter
from campaign.policy import Keeping
from campaign.recording import Ending, Event, Outcome
from tests.archive.conftest import make_header

FEW = 60
LONG = 30_000
"""Characters of a record; the journal's lines have none of them."""


def most(folder: Path, kit, count: int) -> int:
    """Bytes at most while so many trials without samples are recorded and sealed."""
    trials = [kit.trial(number) for number in range(1, count + 1)]
    writer = RunWriter.create(folder, make_header(), trials)
    tracemalloc.start()
    try:
        for trial in trials:
            recorder = writer.begin(trial, Keeping("none"))
            recorder.start(kit.CHANNELS)
            recorder.append(*kit.samples(10, trial.number))
            recorder.event(Event(0.0, "x" * LONG))
            recorder.finish(Ending(Outcome.COMPLETED), kit.STARTED, kit.ENDED)
        writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_no_text_of_a_trial_stays_in_memory(tmp_path: Path, kit, monkeypatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)  # takes most of the time
    few, many = (most(tmp_path / str(count), kit, count) for count in (FEW, 3 * FEW))
    assert (many - few) / (2 * FEW) < LONG / 4
