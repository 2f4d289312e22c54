"""Damage is told by whoever reads: on screen, by the exit code, and in every file they write."""

from __future__ import annotations

import csv
import json
import random
import shutil
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import campaign
from campaign.archive.layout.journal import Decision
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_one_line
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.sound_samples import readable, without_damaged
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError
from campaign.export import exports
from campaign.export.run_export import export_run
from campaign.recording import Channel, Ending, Outcome, Recording
from tests.drawings import keep_drawings
from tests.system import told_damage as told

FIGURE = "stabilization/position-error"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return told.make_archive(tmp_path_factory.mktemp("made"))


@pytest.fixture
def archive(made: Path, tmp_path: Path) -> Path:
    """An archive of two trials that a test may damage, with its protocol."""
    shutil.copytree(made.parents[1], tmp_path / "lab")
    return tmp_path / "lab" / "results" / made.name


def lose_a_record(archive: Path, number: int = 2) -> None:
    """The trial's group is no longer there; index and journal tell of it."""
    with h5py.File(archive, "r+") as file:
        del file[f"trial_{number:05d}"]


def lose_a_sample(archive: Path, number: int = 2, channel: str = "pointing_error") -> None:
    with h5py.File(archive, "r+") as file:
        file[f"trial_{number:05d}/data/{channel}"][7] += 1e-9


def lose_the_title(archive: Path) -> None:
    with h5py.File(archive, "r+") as file:
        file["run/provenance/title"][()] = b"Z"


def attack(archive: Path, folder: Path, seed: int, count: int, every: int) -> list[str]:
    """Flip one bit after another; every so many times all readers are asked, else the quick."""
    content, rng = archive.read_bytes(), random.Random(seed)
    whole = told.answers(archive, folder / "whole")
    assert {one.code for one in whole.values()} == {0}
    assert not any(one.told for one in whole.values())
    found = []
    for number, place in enumerate(told.places(archive, rng, count)):
        archive.write_bytes(told.flipped(content, place))
        scratch = folder / f"flip-{number}"
        said = told.answers(archive, scratch, quick=number % every != 0)
        shutil.rmtree(scratch)
        wrong = told.silently_wrong(said, whole) + told.wrongly_delivered(said, whole)
        found += [f"bit {place[1]} of byte {place[0]}: {line}" for line in wrong]
    return found


@pytest.mark.slow
def test_a_flipped_bit_changes_nothing_or_is_told(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    keep_drawings(monkeypatch)
    assert attack(archive, tmp_path, 1, 40, 4) == []


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(10, 18))
def test_hundreds_of_flipped_bits_change_nothing_or_are_told(
    archive: Path, tmp_path: Path, seed: int
):
    assert attack(archive, tmp_path, seed, 100, 1) == []


@pytest.mark.slow
def test_a_trial_whose_record_is_damaged_is_told_by_every_reader(archive: Path, tmp_path: Path):
    whole = told.answers(archive, tmp_path / "whole")
    lose_a_record(archive)
    said = told.answers(archive, tmp_path / "damaged")
    assert {name: one.code for name, one in said.items()} == dict.fromkeys(said, 4) | {
        "replay": 3  # the trial itself is a fault, which comes first
    }
    assert all(one.told for one in said.values())
    assert told.wrongly_delivered(said, whole) == []
    for name in ("open", "export", "rerun", "replay"):
        delivered = {key.removesuffix(".csv") for key in said[name].made if "trial-" in key}
        assert delivered == {"trial-00001"}


def test_a_trial_that_is_gone_is_told(archive: Path, tmp_path: Path):
    with h5py.File(archive, "r+") as file:
        del file["trial_00002"]
    done = told.run_campaign("export", archive, "--to", "csv", "--output", tmp_path / "out")
    assert done.exit_code == 4
    assert "trial-00002: /trial_00002: is missing, and the journal says that it finish" in (
        done.stderr
    )


def test_python_warns_and_names_it_or_refuses(archive: Path):
    lose_a_record(archive)
    with pytest.warns(campaign.ArchiveWarning, match=r"in 1 place: trial-00002: /trial_00002") as w:
        run = campaign.open(archive)
    assert w[0].filename == __file__
    (damage,) = run.damaged
    assert damage.trial == "trial-00002"
    assert list(run.trials.index) == [1]
    (line,) = run.trials.attrs["damaged"]
    assert line.startswith("trial-00002: /trial_00002")
    assert run.tests.attrs["damaged"] == run.test("stabilization").trials.attrs["damaged"] == [line]
    with pytest.raises(ArchiveError, match="trial 2 cannot be read: trial-00002: /trial_00002"):
        run.trial(2)
    with pytest.warns(campaign.ArchiveWarning, match="trial-00002"):
        tables = run.test("stabilization").tables
    assert tables["stabilization-error"].attrs["damaged"] == [line]
    with pytest.raises(ArchiveError, match="in 1 place: trial-00002"):
        campaign.open(archive, strict=True)


def test_an_analysis_that_leaves_a_trial_out_says_so(archive: Path):
    run = campaign.open(archive)
    whole = run.test("stabilization").tables["stabilization-error"]
    assert whole.attrs["damaged"] == []
    lose_a_sample(archive)
    run = campaign.open(archive)  # samples are read when they are asked for
    with pytest.raises(ArchiveError, match="checksum"):
        run.trial(2).recording()["pointing_error"]
    test = run.test("stabilization")
    with pytest.warns(campaign.ArchiveWarning, match="trial-00002, pointing_error"):
        found = test.tables["stabilization-error"]
    assert found.iloc[0].equals(whole.iloc[0])
    assert list(found["compensation"]) == ["none"]
    assert found.attrs["damaged"][0].startswith("trial-00002, pointing_error: ")
    with pytest.raises(ArchiveError, match="pointing_error"):
        _ = campaign.open(archive, strict=True).test("stabilization").result


def test_a_warning_names_a_few_and_counts_the_rest():
    damaged = [Damage.at(f"/trial_{n:05d}", "is gone") for n in range(1, 9)]
    text = in_one_line(Path("x.nxs"), damaged)
    assert text.startswith("x.nxs: damaged, missing or not as it was archived, in 8 places: ")
    assert text.endswith("trial-00005: /trial_00005: is gone; and 3 more")


def test_an_export_lists_what_is_damaged_and_every_file_with_metadata_names_it(
    archive: Path, tmp_path: Path
):
    lose_a_sample(archive, channel="gyro_rate")
    for to in ("csv", "mat", "parquet"):
        if to == "parquet":
            pytest.importorskip("pyarrow")
        done = told.run_campaign("export", archive, "--to", to, "--output", tmp_path / to)
        assert done.exit_code == 4
        assert "trial-00002, gyro_rate: /trial_00002/data/gyro_rate: " in done.stderr
        names = sorted(path.name for path in (tmp_path / to).iterdir())
        recordings = [f"trial-00001.{to}", f"trial-00002.{to}"]  # one without the damaged channel
        assert names == ["damaged.csv", *recordings, "trials.csv"]
        with (tmp_path / to / "damaged.csv").open(encoding="utf-8", newline="") as file:
            (row,) = csv.DictReader(file)
        assert list(row) == ["place", "trial", "channel", "reason"]
        assert (row["trial"], row["channel"]) == ("trial-00002", "gyro_rate")
    heads = [(tmp_path / "csv" / f"trial-0000{n}.csv").read_text().split("\n")[0] for n in (1, 2)]
    assert ["gyro_rate" in head for head in heads] == [True, False]
    from pyarrow.parquet import read_schema
    from scipy.io import loadmat

    # trial 1 was written before trial 2 was found damaged
    mat = loadmat(tmp_path / "mat" / "trial-00001.mat", squeeze_me=True)
    assert "trial-00002, gyro_rate" in str(mat["trial"]["damaged"])
    schema = read_schema(tmp_path / "parquet" / "trial-00001.parquet")
    assert "trial-00002, gyro_rate" in json.loads(schema.metadata[b"damaged"])[0]


def test_of_chosen_trials_the_damaged_ones_are_left_out(archive: Path, tmp_path: Path):
    lose_a_record(archive)
    command = ("export", archive, "--to", "csv", "--trial", "1", "--trial", "2")
    done = told.run_campaign(*command, "--output", tmp_path / "out")
    assert done.exit_code == 4
    assert (tmp_path / "out" / "trial-00001.csv").exists()


def test_an_error_that_only_names_the_file_is_still_its_trials(
    archive: Path, monkeypatch: pytest.MonkeyPatch
):
    def broken(trial: ArchivedTrial) -> Recording:
        raise ArchiveError(f"{trial.path}: cannot be read: Input/output error")

    monkeypatch.setattr(ArchivedTrial, "recording", broken)
    run = open_run(archive)
    good, damaged = readable(run.path, run.trials)
    assert good == ()
    assert [damage.trial for damage in damaged] == ["trial-00001", "trial-00002"]


class Lazy(Mapping[str, Channel]):
    """Channels that are checked when they are asked for, one of which is damaged."""

    def __init__(self, run: Path, channels: Mapping[str, Channel], bad: str) -> None:
        self._run, self._channels, self._bad = run, channels, bad

    def __getitem__(self, name: str) -> Channel:
        if name == self._bad:
            raise ArchiveError(f"{self._run}: /trial_00002/data/{name}: is not as it was")
        return self._channels[name]

    def __iter__(self):
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)


def test_of_a_trial_the_good_channels_are_exported(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    names = ("gyro_rate", "motor_current")
    channels = {n: Channel(n, "A", n, "A", np.arange(3.0)) for n in names}
    lazy = Lazy(archive, channels, "gyro_rate")
    late = Recording(np.arange(3.0), lazy, (), Ending(Outcome.COMPLETED))
    monkeypatch.setattr(ArchivedTrial, "recording", lambda trial: late)
    done = export_run(campaign.open(archive), exports()["csv"], tmp_path / "out", numbers=[2])
    assert [(damage.trial, damage.channel) for damage in done.damaged] == [
        ("trial-00002", "gyro_rate")
    ]
    heading = (tmp_path / "out" / "trial-00002.csv").read_text(encoding="utf-8").splitlines()[0]
    assert heading == "time (s),motor_current (A)"


def test_a_channel_that_turns_out_damaged_when_it_is_read_is_never_served(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    read = ArchivedTrial.recording

    def lazily(trial: ArchivedTrial) -> Recording:
        whole = read(trial)
        bad = "gyro_rate" if trial.path == archive and trial.trial.number == 2 else ""
        return replace(whole, channels=Lazy(archive, whole.channels, bad))

    monkeypatch.setattr(ArchivedTrial, "recording", lazily)
    assert replayed(archive, tmp_path / "replay").exit_code == 3
    good, bad = open_run(find_run(tmp_path / "replay")).trials
    assert good.ending.outcome is Outcome.COMPLETED
    assert "/trial_00002/data/gyro_rate" in bad.ending.reason
    lost = told.run_campaign("rerun", archive, "2", "--results", tmp_path / "rerun")
    assert told.code_of(lost) == 4
    assert not (tmp_path / "rerun").exists()  # known before anything was executed
    run = open_run(archive)
    names, trials, damaged = without_damaged(
        run.path, run.trials, lambda trials: [t.recording()["gyro_rate"].size > 0 for t in trials]
    )
    assert names == [True]
    assert [trial.trial.number for trial in trials] == [1]
    assert [(damage.trial, damage.channel) for damage in damaged] == [("trial-00002", "gyro_rate")]


def test_a_run_that_was_killed_is_told_of_alike(archive: Path, tmp_path: Path):
    trials = [trial.trial for trial in open_run(archive).trials]
    header = open_run(archive).header.model_copy(update={"name": "killed"})
    with closing(RunWriter.create(tmp_path, header, trials)) as writer:
        for trial in trials:
            recorder = writer.begin(trial)
            recorder.finish(Ending(Outcome.COMPLETED), "2026-11-21T09:37:00Z", header.created)
    (tmp_path / "killed.partial" / "trial-00002.trial").unlink()
    for command in (("show",), ("export", "--to", "csv")):
        done = told.run_campaign(command[0], "killed", *command[1:], "--results", tmp_path)
        assert done.exit_code == 4
        assert "trial-00002: trial-00002.trial: there is no such file" in done.stderr
    trees = tmp_path / "killed.partial" / "plan-trees.jsonl"
    trees.unlink()
    done = told.run_campaign("resume", "killed", "--results", tmp_path)
    assert told.code_of(done) == 4  # before anything is executed: no run is sealed without it
    assert str(done.exception).startswith(f"{trees}: cannot be read")
    journal = tmp_path / "killed.partial" / "journal.jsonl"
    journal.unlink()
    done = told.run_campaign("report", "killed", "--results", tmp_path)
    assert told.code_of(done) == 4
    assert str(done.exception) == f"{journal}: cannot be read: No such file or directory"
    assert str(journal) in told.run_campaign("list", "--results", tmp_path).stderr


def test_a_report_says_so_above_everything_else(archive: Path, tmp_path: Path):
    lose_a_record(archive, 1)
    lose_a_sample(archive, 2)
    done = told.run_campaign("report", archive, "--output", tmp_path / "report")
    assert done.exit_code == 4
    assert "in 2 places" in done.stderr
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert 0 < page.index('id="damage-heading"') < page.index("<header")
    assert "(trial-00001, trial-00002)" in page
    assert "1 executed, 1 not readable" in page
    assert "not executed" not in page
    assert "trial-00001 is left out: /trial_00001" in page
    listed = (tmp_path / "report" / "tables" / "damaged.csv").read_text(encoding="utf-8")
    assert listed.splitlines()[0] == "place,trial,channel,reason"
    assert len(listed.splitlines()) == 3


@pytest.mark.slow
def test_a_report_names_a_record_that_nothing_else_needs(archive: Path, tmp_path: Path):
    with h5py.File(archive, "r+") as file:
        text = file["trial_00002/record/json"][()]
        file["trial_00002/record/json"][()] = text.replace(b"static", b"stutic")
    for command in (("report", archive), ("report", archive, "--only-figure", FIGURE)):
        done = told.run_campaign(*command, "--output", tmp_path / f"out-{len(command)}")
        assert done.exit_code == 4
        assert "trial-00002: /trial_00002/record/json: does not match its checksum" in done.stderr
    page = (tmp_path / "out-2" / "report.html").read_text(encoding="utf-8")
    assert "damage-heading" in page
    assert "trial-00002 is damaged: " in page  # and not left out: the index has it again


def decisions(run: campaign.archive.RunReader) -> list[str]:
    entries = run.story.all(Decision)
    return [entry.reason for entry in entries if entry.decision == "source damaged"]


def test_a_repetition_of_a_good_trial_says_that_the_run_is_damaged(archive: Path, tmp_path: Path):
    lose_a_record(archive)
    done = told.run_campaign("rerun", archive, "1", "--results", tmp_path)
    assert done.exit_code == 4
    assert "equal to the bit" in done.stdout
    again = open_run(find_run(tmp_path))
    assert again.header.notes.startswith(f"repeats trial-00001 of {archive.stem}; {archive.name}: ")
    assert "trial-00002: /trial_00002" in decisions(again)[0]
    assert again.damaged == ()
    lost = told.run_campaign("rerun", archive, "2", "--results", tmp_path)
    assert told.code_of(lost) == 4
    assert "trial 2 cannot be read: trial-00002: " in str(lost.exception)


def replayed(archive: Path, results: Path):
    protocol = archive.parents[1] / "axis.toml"
    return told.run_campaign(
        "run", protocol, "--backend", "replay", "--from", archive, "--results", results
    )


@pytest.mark.parametrize("lose", [lose_a_record, lose_a_sample])
def test_a_replayed_trial_that_is_damaged_is_a_fault_that_names_it(
    archive: Path, tmp_path: Path, lose
):
    lose(archive)
    assert replayed(archive, tmp_path).exit_code == 3
    good, bad = open_run(find_run(tmp_path)).trials
    assert good.ending.outcome is Outcome.COMPLETED
    assert bad.ending.outcome is Outcome.FAULT
    assert "/trial_00002" in bad.ending.reason
    assert decisions(open_run(find_run(tmp_path))) or lose is lose_a_sample


def test_a_replay_of_a_run_with_another_damage_is_whole_and_says_so(archive: Path, tmp_path: Path):
    lose_the_title(archive)
    done = replayed(archive, tmp_path)
    assert done.exit_code == 4
    assert "/run/provenance/title" in done.stderr
    run = open_run(find_run(tmp_path))
    assert [trial.ending.outcome for trial in run.trials] == [Outcome.COMPLETED] * 2
    assert "/run/provenance/title" in decisions(run)[0]
    planned = told.run_campaign(
        "plan", archive.parents[1] / "axis.toml", "--backend", "replay", "--from", archive
    )
    assert planned.exit_code == 4


def test_a_plan_that_a_damaged_run_cannot_answer_is_not_called_a_mistake(archive: Path, tmp_path):
    lose_a_record(archive)
    with h5py.File(archive, "r+") as file:
        file["run/plan_trials/data"][()] = b"{"
    done = replayed(archive, tmp_path)
    assert told.code_of(done) == 4
    assert "it may have been lost" in str(done.exception)
