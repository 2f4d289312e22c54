"""A trial whose samples are damaged is left out of its test's analysis, and told of."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.api.analysis import AnalysedTest, analyse_run
from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.sound_samples import damaged_records
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.experiments.interface import Experiment, TestData
from campaign.options import Options
from campaign.recording import ChannelInfo, Ending, Outcome
from campaign.result import Result
from campaign.trial import Task, Trial
from tests.archive.forging import put_text, text_of

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


def experiment_of(analyse: Callable[[TestData], Result]) -> Experiment:
    """One with this analysis, whose trials are those of a map."""
    return Experiment(
        "velocity_map", "", Options, trials=lambda options, bench: (), analyse=analyse
    )


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
        {"velocity_map": experiment_of(analyse)},
    )
    assert seen == [[1.0, 3.0]]
    assert [trial.trial.number for trial in test.trials] == [1, 3]
    (damage,) = test.damaged
    assert (damage.trial, damage.channel) == ("trial-00002", "gyro_rate")
    assert "does not match its checksum" in damage.reason
    assert test.problem == ""
    assert test.evidence().failed  # what it did not find is not merely "not run"


def analysed(path: Path, analyse: Callable[[TestData], Result]) -> AnalysedTest:
    (test,) = analyse_run(open_run(path), {"velocity_map": experiment_of(analyse)})
    return test


def read_first(data: TestData) -> Result:
    """An analysis that reads one channel of one trial."""
    _ = data.trials[0].recording()["gyro_rate"]
    return Result()


@pytest.mark.parametrize("channel", ["gyro_rate", "time"])
def test_a_bit_that_an_analysis_reads_is_damage(tmp_path: Path, channel: str):
    path = archived(tmp_path)
    with h5py.File(path) as file:
        chunk = file[f"trial_00001/data/{channel}"].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 4
    path.write_bytes(data)
    test = analysed(path, read_first)
    assert [(each.trial, each.channel) for each in test.damaged] == [("trial-00001", channel)]
    assert [trial.trial.number for trial in test.trials] == [2, 3]


def test_channels_that_changed_places_are_damage(tmp_path: Path):
    path = archived(tmp_path)
    with h5py.File(path, "r+") as file:
        file.move("trial_00001/data/gyro_rate", "held")
        file.move("trial_00002/data/gyro_rate", "trial_00001/data/gyro_rate")
        file.move("held", "trial_00002/data/gyro_rate")
    test = analysed(path, read_first)
    assert [each.trial for each in test.damaged] == ["trial-00001", "trial-00002"]


def test_samples_that_nothing_reads_are_left_to_verify(tmp_path: Path):
    path = archived(tmp_path)
    with h5py.File(path, "r+") as file:
        file["trial_00002/data/gyro_rate"][7] = 0.0
    assert analysed(path, read_first).damaged == ()
    assert [damage.trial for damage in verify_run(path).problems] == ["trial-00002"]


def test_a_record_is_damage_though_no_sample_of_its_trial_is_read(tmp_path: Path):
    path = archived(tmp_path)
    with h5py.File(path, "r+") as file:
        text = text_of(file, "trial_00002/record/json")
        put_text(file, "trial_00002/record/json", text.replace("gyro", "hydro"), honest=True)
    test = analysed(path, read_first)
    (damage,) = test.damaged
    assert (damage.trial, damage.channel) == ("trial-00002", "")
    assert damage.place == "/trial_00002/record/json"
    assert len(test.trials) == 3  # the index has the record again


def test_records_that_changed_places_are_damage(tmp_path: Path):
    path = archived(tmp_path)
    with h5py.File(path, "r+") as file:
        file.move("trial_00001/record", "held")
        file.move("trial_00003/record", "trial_00001/record")
        file.move("held", "trial_00003/record")
    assert [each.trial for each in analysed(path, read_first).damaged] == [
        "trial-00001",
        "trial-00003",
    ]


def test_the_records_of_dropped_samples_are_not_missed(tmp_path: Path):
    run = open_run(archived(tmp_path))
    first, *rest = run.trials
    gone = replace(first, entry="trial_00009", samples=replace(first.samples, not_kept="dropped"))
    assert damaged_records(run, (gone, *rest)) == ()
    lost = replace(first, entry="trial_00009")
    assert [each.trial for each in damaged_records(run, (lost, *rest))] == ["trial-00009"]
