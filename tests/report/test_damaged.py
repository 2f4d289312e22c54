"""A trial whose samples are damaged is left out of its test's analysis, and told of."""

from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np

from campaign.access.analysis import analyse_run
from campaign.archive import RunHeader, RunStatus, RunWriter, open_run
from campaign.experiments.interface import TestData
from campaign.recording import ChannelInfo, Ending, Outcome
from campaign.result import Result
from campaign.trial import Task, Trial

TIME = "2026-11-21T09:36:58Z"


def archived(folder: Path) -> Path:
    """A sealed run of three trials of one test."""
    task = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=100.0)
    trials = [
        Trial(number=number, test="map", kind="velocity_map", seed=number, bench={}, task=task)
        for number in (1, 2, 3)
    ]
    header = RunHeader(name="run", created=TIME, tests=({"name": "map", "kind": "velocity_map"},))
    writer = RunWriter.create(folder, header, trials)
    for trial in trials:
        recorder = writer.begin(trial)
        recorder.start((ChannelInfo("gyro_rate", "rad/s", "Rate", "deg/s"),))
        recorder.append(np.arange(100) / 100.0, np.full((1, 100), float(trial.number)))
        recorder.finish(Ending(Outcome.COMPLETED), TIME, TIME)
    return writer.seal(RunStatus.COMPLETE, ended=TIME)


def test_a_damaged_trial_is_left_out_and_the_others_are_analysed(tmp_path):
    path = archived(tmp_path)
    with h5py.File(path, "r+") as file:
        file["trial_00002/data/gyro_rate"][7] = 0.0
    seen = []

    def analyse(data: TestData) -> Result:
        seen.append([trial.recording()["gyro_rate"][0] for trial in data.trials])
        return Result()

    (test,) = analyse_run(
        open_run(path),
        {"velocity_map": SimpleNamespace(analyse=analyse, perturbs_bench=False, most_samples=None)},
    )
    assert seen == [[1.0, 3.0]]
    assert [trial.trial.number for trial in test.trials] == [1, 3]
    (damage,) = test.damaged
    assert (damage.trial, damage.channel) == ("trial-00002", "gyro_rate")
    assert "does not match its checksum" in damage.reason
    assert test.problem == ""
    assert test.evidence().failed  # what it did not find is not merely "not run"
