"""A protocol with stages, from plan to report: run, stopped, gone on with, replayed."""

from __future__ import annotations

import json
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

import campaign as program
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.verification.verify_run import verify_run
from campaign.cli import session
from campaign.errors import ExitCode, UsageError
from campaign.estimate import Estimate
from campaign.execution.trial_metrics import TrialMeasurement
from campaign.experiments import experiments
from campaign.experiments.frequency_response import experiment as frequency_response
from campaign.experiments.interface import TrialData
from tests.system.laboratory import BENCH, Laboratory
from tests.system.test_stage_kills import FOLLOWING, PLANNED, PROTOCOL
from tests.system.user import campaign, write

ALL = PLANNED + FOLLOWING
OWN_BENCH = PROTOCOL.replace('"simulink"', '"bench.toml"')


class Lab(Laboratory):
    """Of a protocol with stages and its own bench."""

    def run(self, workers: int = 1) -> RunReader:
        return open_run(self.executed(workers=workers)[1])

    def stopped(self, number: int) -> RunReader:
        run = open_run(self.stopped_in(number))
        assert run.status == "interrupted"
        return run

    def resumed(self, run: RunReader, *, accept: bool = False) -> RunReader:
        assert self.resume(run.path, accept=accept) is ExitCode.DONE
        return open_run(run.path)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lab:
    return Lab(tmp_path, monkeypatch, OWN_BENCH)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> RunReader:
    """A run that nobody stopped, by one worker; to be read only."""
    return Lab(tmp_path_factory.mktemp("whole"), pytest.MonkeyPatch(), OWN_BENCH).run()


def samples(run: RunReader) -> dict[int, tuple[str, bytes]]:
    return {
        each.trial.number: (each.trial.fingerprint, each.recording()["gyro_rate"].tobytes())
        for each in run.trials
    }


@pytest.mark.slow
def test_two_workers_find_number_and_record_what_one_does(lab: Lab, whole: RunReader):
    two = lab.run(workers=2)
    assert len(whole.trials) == ALL
    assert samples(whole) == samples(two)
    assert [stage.point for stage in two.stages] == [stage.point for stage in whole.stages]


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 14])
def test_a_run_that_is_stopped_goes_on_to_the_same_samples(lab: Lab, whole: RunReader, number: int):
    stopped = lab.stopped(number)
    assert len(stopped.plan) > len(stopped.trials) or len(stopped.plan) == PLANNED
    resumed = lab.resumed(stopped)
    assert samples(resumed) == samples(whole)
    assert verify_run(resumed.path).problems == ()


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 14])
def test_a_protocol_that_is_gone_leaves_its_stages_in_the_archive(
    lab: Lab, whole: RunReader, number: int
):
    stopped = lab.stopped(number)
    lab.protocol.unlink()
    assert samples(lab.resumed(stopped)) == samples(whole)


def test_what_followed_on_one_bench_does_not_move_a_changed_one(lab: Lab):
    stopped = lab.stopped(14)
    write(lab.folder, BENCH.replace('angle = "', 'angle = "1', 1), "bench.toml")
    before = stopped.path.read_bytes()
    with pytest.raises(UsageError, match=r"follows from what was found before sweep was changed"):
        lab.resumed(stopped, accept=True)
    assert stopped.path.read_bytes() == before


@pytest.mark.slow
def test_a_change_before_anything_followed_is_accepted(lab: Lab):
    stopped = lab.stopped(1)
    assert stopped.stages == ()
    write(lab.folder, BENCH.replace('angle = "', 'angle = "1', 1), "bench.toml")
    resumed = lab.resumed(stopped, accept=True)
    assert len(resumed.trials) == ALL
    limits = [each.trial.bench["limits"]["angle"] for each in resumed.trials[-FOLLOWING:]]
    changed = resumed.trials[0].trial
    assert set(limits) == {changed.bench["limits"]["angle"]}
    assert limits[0] > stopped.planned(1).bench["limits"]["angle"]


@pytest.mark.slow
def test_a_user_sees_the_stages_before_during_and_after(lab: Lab):
    folder = lab.folder
    planned = campaign(folder, "plan", "protocol.toml").out
    assert "stage 2, refinement: at most 56 trials," in planned
    assert "at 2 points: bandwidth and margins are read between frequencies" in planned
    assert "later stages add at most 56 trials," in planned
    tree = json.loads(campaign(folder, "plan", "protocol.toml", "--json").out)
    assert tree["following"]["trials"] == 56
    assert [stage["point"]["compensation"] for stage in tree["tests"][0]["stages"]] == [
        "none", "lugre",
    ]  # fmt: skip
    ran = campaign(folder, "run", "protocol.toml", "--report", "--workers", "1")
    assert "sweep at compensation = none, stage 2 (refinement): 14 trials follow" in ran.err
    assert f"complete: {ALL} trials done" in ran.err
    shown = campaign(folder, "show").out
    assert "trial-00011 to trial-00024" in shown
    stages = json.loads(campaign(folder, "show", "--json").out)["stages"]
    assert [stage["trials"] for stage in stages] == [list(range(11, 25)), list(range(25, 39))]
    assert f"\t{ALL}\t" in campaign(folder, "list").out
    page = next((folder / "results").glob("*-report/report.html")).read_text(encoding="utf-8")
    assert "not executed" not in page


def test_they_are_trials_for_whoever_opens_the_run(whole: RunReader):
    assert f"{ALL} of {ALL} trials executed" in repr(program.open(str(whole.path)))
    swept = [float(str(each.trial.point["frequency"])) for each in whole.trials_of("sweep")]
    assert len(set(swept)) == 5 + FOLLOWING
    # Seven within 12 % of the -3 dB crossing of each, and seven around 0 dB.
    for first, last in ((PLANNED, PLANNED + 14), (PLANNED + 14, ALL)):
        assert swept[last - 1] / swept[first] > 1.12 / 0.88


@pytest.mark.slow
def test_a_replay_finds_the_same_trials_and_serves_them(lab: Lab, whole: RunReader):
    again = campaign(
        lab.folder, "run", "protocol.toml", "--backend", "replay", "--from", str(whole.path),
        "--results", "replayed",
    )  # fmt: skip
    assert f"complete: {ALL} trials done" in again.err
    replayed = open_run(find_run(lab.folder / "replayed"))
    assert samples(replayed) == samples(whole)


def test_a_stage_measures_in_a_limited_time(lab: Lab):
    """What hung when its trial ended does not hang while the bench waits for the stage."""
    threads, never = [], threading.Event()

    def hangs(data: TrialData) -> Sequence[Estimate]:
        threads.append(threading.current_thread().name)
        if threads[-1] == "measuring":  # elsewhere the whole test would hang
            never.wait(600)
        return ()

    kind = replace(experiments()["frequency_response"], measure=hangs)
    with experiments().including(kind), lab.patch.context() as patch:
        patch.setattr(frequency_response, "_measure", hangs)
        patch.setattr(session, "TrialMeasurement", partial(TrialMeasurement, limit=0.02))
        run = lab.run()
    assert run.status != "interrupted"
    assert set(threads) == {"measuring"}
    assert len(threads) >= 2 * PLANNED, "when a trial ended, and for the stage"
