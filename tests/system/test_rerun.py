"""One archived trial is executed again on the simulated bench, and held against the archive."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.cli.prepare import Request
from campaign.cli.rerun import _error, rerun_trial
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode, UsageError
from campaign.execution import provenance
from campaign.execution.recording_difference import changes, differences
from campaign.execution.written_order import in_written_order
from campaign.physics import grid
from campaign.physics.engine_version import ENGINE
from campaign.physics.step_choice import StepChoice
from campaign.recording import ChannelInfo, Ending, MemoryRecorder, Outcome, Recording
from tests.system.laboratory import disturb
from tests.system.user import SEA, write


@pytest.fixture
def archive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    request = Request(str(write(tmp_path, SEA)))
    run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    capsys.readouterr()
    return next((tmp_path / "results").glob("*.nxs"))


@pytest.mark.parametrize("wanted", ["2", "trial-00002", "trial_00002"])
def test_the_same_samples_come_out(archive: Path, capsys: pytest.CaptureFixture[str], wanted: str):
    assert rerun_trial(archive.stem, wanted, archive.parent) is ExitCode.DONE
    said, path = capsys.readouterr().out.splitlines()
    assert "trial-00002" in said
    assert "equal to the bit, 11 channels" in said
    again = open_run(Path(path))
    assert "rerun-trial-00002" in again.name
    assert again.header.notes == f"repeats trial-00002 of {archive.stem}"
    (trial,) = again.trials
    assert trial.trial.fingerprint == open_run(archive).trials[1].trial.fingerprint


def test_another_sample_is_found_and_named(
    archive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    disturb(monkeypatch)
    assert rerun_trial(archive.stem, "1", archive.parent) is ExitCode.TRIALS_FAILED
    first, found, _ = capsys.readouterr().out.splitlines()
    assert first.endswith("different")
    assert found.strip().startswith("gyro_rate [rad/s]: ")
    assert "the first at index 0, by at most 1e-12" in found


@pytest.fixture
def older(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> Path:
    """A run of an engine 1 whose steps were other ones, and whose samples are, too."""
    monkeypatch.setattr(provenance, "ENGINE", 1)
    monkeypatch.setattr(
        grid, "_choice", lambda bench, task: StepChoice(1e-3 / 32, 1e-3 / 32, "older")
    )
    request = Request(str(write(tmp_path, SEA)))
    run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    monkeypatch.undo()
    capsys.readouterr()
    return next((tmp_path / "results").glob("*.nxs"))


def test_a_trial_of_an_older_engine_is_held_against_that_engine_s_error(older: Path, capsys):
    assert rerun_trial(older.stem, "1", older.parent) is ExitCode.DONE
    first, *channels, _ = capsys.readouterr().out.splitlines()
    assert f"simulated by engine 1, repeated by engine {ENGINE}: the same within 10 times" in first
    assert len(channels) == 11
    (rate,) = (line for line in channels if line.strip().startswith("load_rate: "))
    assert 0.0 < float(rate.split("changed by ")[1].split()[0]) < 1e-3


def test_beyond_ten_times_that_error_it_is_different(older: Path, monkeypatch, capsys):
    monkeypatch.setattr("campaign.cli.rerun.ERRORS", {1: 1e-12})
    assert rerun_trial(older.stem, "1", older.parent) is ExitCode.TRIALS_FAILED
    assert ": different in gyro_rate, " in capsys.readouterr().out


def test_an_archive_without_an_engine_is_of_the_first(older: Path, monkeypatch, capsys):
    header = open_run(older).header
    versions = {name: was for name, was in header.versions.items() if name != "engine"}
    monkeypatch.setattr(
        "campaign.cli.rerun.open_run",
        lambda path: replace(
            open_run(path), header=header.model_copy(update={"versions": versions})
        ),
    )
    rerun_trial(older.stem, "1", older.parent)
    assert "simulated by engine 1, " in capsys.readouterr().out


def test_a_change_is_told_of_what_was() -> None:
    was, now = recording(3.0, -3.0, 3.0), recording(3.0, -3.0, 6.0)
    assert changes(was, now) == {"rate": pytest.approx(1 / np.sqrt(3))}
    assert changes(was, was) == {"rate": 0.0}
    assert changes(recording(0.0, 0.0), recording(0.0, 1.0)) == {"rate": np.inf}
    assert changes(recording(1.0, 1.0), recording(1.0)) == {"rate": np.inf}
    assert changes(recording(np.nan, 1.0), recording(np.nan, 1.0)) == {"rate": 0.0}


@pytest.mark.parametrize("wanted", ["99", "sea", "-1"])
def test_a_trial_that_is_not_there_is_said(archive: Path, wanted: str):
    with pytest.raises(UsageError, match="trial"):
        rerun_trial(archive.stem, wanted, archive.parent)


def recording(*samples: float, outcome: Outcome = Outcome.COMPLETED) -> Recording:
    recorder = MemoryRecorder()
    recorder.start((ChannelInfo("rate", "rad/s", "Rate", "deg/s"),))
    recorder.append(np.arange(len(samples), dtype=float), np.array([samples]))
    return recorder.recording(Ending(outcome))


def test_bits_are_compared_not_values():
    nan = float("nan")
    assert differences(recording(0.0, nan), recording(0.0, nan)) == []
    (zero,) = differences(recording(0.0, 1.0), recording(-0.0, 1.0))
    assert zero == "rate [rad/s]: 1 of 2 samples differ, the first at index 0, by at most 0"


def test_lengths_outcomes_and_missing_channels_are_differences():
    long, short = recording(1.0, 2.0), recording(1.0, outcome=Outcome.INTERRUPTED)
    assert differences(short, long) == [
        "outcome: interrupted → completed",
        "samples: 1 → 2; compared are those that both have",
    ]
    assert differences(long, replace(long, channels={})) == ["rate: is only in the archive"]


@pytest.mark.parametrize(("engine", "rate", "torque"), [(2, 1.1e-2, 3e-3), (3, 2e-4, 2e-4)])
def test_older_engines_had_larger_errors_of_dry_friction(engine: int, rate: float, torque: float):
    assert _error(engine, "load_rate", dry=True) == rate
    assert _error(engine, "friction_torque", dry=True) == torque
    assert _error(engine, "load_rate", dry=False) == 2e-4


def test_friction_of_several_interfaces_is_added_in_the_order_of_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The archive sorts the bench's tables; the last bits of their sum are those of the file."""
    protocol = write(tmp_path, SEA.replace('"simulink"', '"platform"'))
    run_protocol(Request(str(protocol)), tmp_path / "results", RunOptions(workers=1))
    (path,) = (tmp_path / "results").glob("*.nxs")
    order = list(open_run(path).trials[0].trial.bench["friction"])
    assert order == sorted(order)
    assert order[0] != "load"
    capsys.readouterr()
    assert rerun_trial(path.stem, "1", path.parent) is ExitCode.DONE
    assert "equal to the bit" in capsys.readouterr().out


def test_what_a_file_does_not_have_stays_behind():
    text = 'name = "a"\n[friction]\nz = 1\na = 2\n'
    tree = {"friction": {"a": 1, "b": 2, "z": 3}, "name": "a"}
    ordered = in_written_order(tree, ["no = TOML =", 'name = "other"', text])
    assert ordered == tree
    assert list(ordered["friction"]) == ["z", "a", "b"]
    assert list(ordered) == ["name", "friction"]
    assert in_written_order(tree, []) is tree
