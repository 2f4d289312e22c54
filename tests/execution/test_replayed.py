"""Recordings under the supervision of a run: judged, and served as they are."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.writing.writer import RunWriter
from campaign.backends.replay import BACKEND, ReplayOptions
from campaign.execution.runner import run_plan
from campaign.execution.stop import StopSwitch
from campaign.execution.supervision import Supervision
from campaign.recording import Channel, Ending, Event, Outcome, Recording
from campaign.trial import Trial
from tests.archives import archived, simulated_run


def replayed(archive: Path, trials: list[Trial], folder: Path) -> tuple[ArchivedTrial, ...]:
    header = RunHeader(name="again", created="2026-11-21T09:36:58Z", trials=len(trials))
    with (
        closing(RunWriter.create(folder, header, trials)) as writer,
        BACKEND.open(ReplayOptions(run=str(archive))) as backend,
    ):
        outcome = run_plan(
            trials, backend, writer, workers=2, display=lambda progress: None, stop=StopSwitch(),
            supervision=Supervision(BACKEND.source, BACKEND.live),
        )  # fmt: skip
    return open_run(outcome.archive).trials


def assert_equal(was: Recording, now: Recording) -> None:
    assert now.time.tobytes() == was.time.tobytes()
    assert tuple(now.channels) == tuple(was.channels)
    for name in was.channels:
        assert now[name].tobytes() == was[name].tobytes()
    assert now.events == was.events
    assert now.ending == was.ending


def test_a_clean_archive_comes_out_as_it_went_in(tmp_path: Path) -> None:
    archive = simulated_run(tmp_path)
    before = open_run(archive).trials
    after = replayed(archive, [each.trial for each in before], tmp_path / "again")
    for was, now in zip(before, after, strict=True):
        assert_equal(was.recording(), now.recording())


def test_what_breaks_a_limit_is_said_and_served(tmp_path: Path) -> None:
    archive = simulated_run(tmp_path)
    [first, _] = open_run(archive).trials
    was = first.recording()
    current = was["motor_current"].copy()
    current[500:] = 5000.0
    channels = {
        name: Channel(c.name, c.unit, c.label, c.display_unit, c.samples, c.measured)
        for name, c in was.channels.items()
    }
    channels["motor_current"] = replace(channels["motor_current"], samples=current)
    bad = Recording(was.time, channels, (), Ending(Outcome.COMPLETED))
    path = archived(tmp_path / "bad", [(first.trial, bad)])
    [now] = replayed(path, [first.trial], tmp_path / "again")
    assert now.ending.outcome is Outcome.COMPLETED
    np.testing.assert_array_equal(now.recording()["motor_current"], current)
    [event] = now.recording().events
    said = f"motor_current reached 5000 A at {was.time[500]:.4g} s; the current limit is 90 A"
    assert event == Event(float(was.time[500]), said)
    assert now.ending.telemetry == {"judged": {"limit": said}}
