"""A run on a truth: archived apart, repeated, replayed, gone on with, shown, and not analysed."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence, Set
from pathlib import Path

import pytest

from campaign.api import analysis
from campaign.archive.reading.open_run import open_run
from campaign.backends.sim import SimBackend
from campaign.cli.rerun import rerun_trial
from campaign.cli.show import show_archive
from campaign.errors import ExitCode, UsageError
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import TestData
from campaign.report.build import render
from campaign.report.content import document
from campaign.resources import templates_folder
from tests.system.laboratory import BENCH, Laboratory
from tests.system.user import campaign, write

ODD = "31.4159265"
TRUTH = BENCH.replace('static_torque = "32 N m"', f'static_torque = "{ODD} N m"', 1)
MAP = """\
[[test]]
name = "map"
kind = "velocity_map"
bench = "bench.toml"
seed = 5
speeds = ["0.5 deg/s", "1 deg/s", "2 deg/s", "4 deg/s", "8 deg/s", "12 deg/s", "20 deg/s"]
max_time = "4 s"
max_travel = "40 deg"
window_time = "0.5 s"
settle_angle = "0.4 deg"
warm_up_cycles = 0
"""


def stated() -> str:
    """The bench as somebody would state it who knows neither its friction nor its inertia."""
    a, b = BENCH.index("[friction."), BENCH.index("[controller")
    text = BENCH[:a] + BENCH[b:]
    return "friction = {}\n" + text.replace('inertia = "35 kg m^2"', 'inertia = "42 kg m^2"')


class Lab(Laboratory):
    """Of a protocol, its stated bench and its truth."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        super().__init__(folder, patch, MAP, stated())
        self.truth = write(folder, TRUTH, "truth.toml")

    def run(self, backend: str = "sim", *changes: str, truth: str | None = None) -> Path:
        truth = str(self.truth) if truth is None else truth
        code, archive = self.executed(changes=changes, backend=backend, truth=truth)
        assert code is ExitCode.DONE
        return archive

    def interrupted(self) -> Path:
        return self.stopped_in(3, truth=str(self.truth))


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lab:
    return Lab(tmp_path, monkeypatch)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("truth")
    with pytest.MonkeyPatch.context() as patch:
        return Lab(folder, patch).run()


def test_the_archive_has_it_in_one_place(archive: Path) -> None:
    run = open_run(archive)
    truth = run.header.truth
    assert truth.sources == {truth.option: TRUTH}
    (plant,) = truth.plants.values()
    assert plant["friction"]["load"]["static_torque"] == float(ODD)
    assert {trial.trial.truth for trial in run.trials} == truth.plants.keys()
    rest = run.header.model_copy(update={"truth": type(truth)()})
    assert ODD not in rest.model_dump_json()
    assert not any(ODD in repr(trial.trial) for trial in run.trials)


def test_the_samples_are_those_of_the_truth(archive: Path) -> None:
    """The friction of sliding comes out, although the stated bench has none: 26 + 4 w ... N m."""
    run = open_run(archive)
    result = result_of(
        experiments()["velocity_map"], TestData("map", "velocity_map", {}, run.trials)
    )
    coulomb = [f.value for f in result.findings if f.quantity == "coulomb_torque"]
    assert coulomb
    assert all(20.0 < value < 40.0 for value in coulomb)


def test_an_analysis_is_the_same_whether_there_is_a_truth_or_not(archive: Path) -> None:
    run = open_run(archive)
    experiment = experiments()["velocity_map"]

    def analysed(*, told: bool) -> str:
        trials = run.trials
        if not told:
            trials = tuple(
                Told(each.trial.model_copy(update={"truth": ""}), each) for each in trials
            )
        return repr(result_of(experiment, TestData("map", "velocity_map", {}, trials)))

    assert analysed(told=True) == analysed(told=False)


class Told:
    """An archived trial that says nothing of a truth."""

    def __init__(self, trial, archived) -> None:
        self.trial, self._archived = trial, archived

    def __getattr__(self, name: str):
        return getattr(self._archived, name)


def test_no_analysis_can_reach_it(archive: Path) -> None:
    """Whatever hangs on what an analysis is given: none of it holds the number."""
    run = open_run(archive)
    experiment = experiments()["velocity_map"]
    seen: dict[int, object] = {}
    data = TestData("map", "velocity_map", {}, run.trials)
    result_of(experiment, data)  # whatever is read late has been read
    stack: list[object] = [data]
    while stack:
        thing = stack.pop()
        if id(thing) in seen or isinstance(thing, type) or callable(thing):
            continue
        seen[id(thing)] = thing
        assert ODD not in repr(thing)[:1_000_000]
        stack += list(vars(thing).values()) if hasattr(thing, "__dict__") else []
        stack += list(thing.values()) if isinstance(thing, dict) else []
        stack += (
            list(thing) if isinstance(thing, Sequence | Set) and not isinstance(thing, str) else []
        )
    assert len(seen) > 100


@pytest.mark.slow
def test_the_report_opens_it_when_the_analyses_are_done(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    looks, analyses = document.truth_tables, analysis.result_of
    monkeypatch.setattr(
        document, "truth_tables", lambda *given: (order.append("truth"), looks(*given))[1]
    )
    monkeypatch.setattr(
        analysis, "result_of", lambda *given: (order.append("analysis"), analyses(*given))[1]
    )
    html, folder, _ = render(open_run(archive), tmp_path, experiments(), templates_folder())
    assert order == ["analysis", "truth"]
    assert "True and estimated values" in html
    assert "Plan and analysis were given the stated bench" in html
    (text,) = (text for name, text in folder.files.items() if name.endswith("map-truth.csv"))
    rows = [row for row in csv.reader(text.splitlines()) if row[0] == "viscous friction σ2"]
    nominal = [float(row[3]) for row in rows if "nominal" in row[1]]
    assert nominal == pytest.approx([4.0 + 141.176 * 0.001] * 2)  # load, and N times the motor's


def test_a_trial_is_repeated_to_the_bit(archive: Path, capsys) -> None:
    assert rerun_trial(archive.stem, "2", archive.parent) is ExitCode.DONE
    said, path = capsys.readouterr().out.splitlines()
    assert "equal to the bit, 9 channels" in said
    again = open_run(Path(path))
    assert again.header.truth == open_run(archive).header.truth
    assert again.trials[0].trial.fingerprint == open_run(archive).trials[1].trial.fingerprint


def test_it_is_shown(archive: Path, capsys) -> None:
    show_archive(archive.stem, archive.parent, as_json=False)
    assert "simulated in place of the stated bench" in capsys.readouterr().out
    show_archive(archive.stem, archive.parent, as_json=True)
    header = json.loads(capsys.readouterr().out)["header"]
    assert list(header["truth"]) == ["option", "plants"]


@pytest.mark.slow
def test_an_interrupted_run_goes_on_with_its_truth(lab: Lab) -> None:
    whole = open_run(lab.run()).trials
    archive = lab.interrupted()
    assert len(open_run(archive).trials) < len(whole)
    assert lab.resume(archive) is ExitCode.DONE
    for was, now in zip(whole, open_run(archive).trials, strict=True):
        assert now.trial.truth == was.trial.truth
        assert now.recording()["gyro_rate"].tobytes() == was.recording()["gyro_rate"].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("accept", [False, True])
def test_a_resume_refuses_another_truth(lab: Lab, accept: bool) -> None:
    archive = lab.interrupted()
    write(lab.folder, TRUTH.replace(ODD, "30"), "truth.toml")
    with pytest.raises(UsageError, match="started with another truth"):
        lab.resume(archive, accept=accept)
    write(lab.folder, TRUTH, "truth.toml")
    assert lab.resume(archive) is ExitCode.DONE


@pytest.mark.slow
def test_a_truth_that_is_gone_is_in_the_archive(lab: Lab) -> None:
    archive = lab.interrupted()
    lab.truth.unlink()
    assert lab.resume(archive) is ExitCode.DONE
    assert all(trial.trial.truth for trial in open_run(archive).trials)


@pytest.mark.slow
def test_a_replay_answers_the_same_truth_only(lab: Lab) -> None:
    archive = lab.run()
    again = open_run(lab.run("replay", f"backend.run={archive}"))
    was = open_run(archive)
    assert again.header.truth.plants == was.header.truth.plants
    for one, other in zip(was.trials, again.trials, strict=True):
        assert other.recording()["gyro_rate"].tobytes() == one.recording()["gyro_rate"].tobytes()
    for truth in ("", "simulink"):
        with pytest.raises(UsageError, match="differs in truth"):
            lab.run("replay", f"backend.run={archive}", truth=truth)


def test_a_rig_has_its_own_truth(lab: Lab) -> None:
    with pytest.raises(UsageError, match="states a truth, which only a simulation"):
        lab.run("serial", "backend.port=/dev/null")


def test_a_backend_that_was_not_told_refuses(archive: Path) -> None:
    from campaign.backends.sim import SimOptions

    trial = open_run(archive).trials[0].trial
    assert "its truth" in str(SimBackend(SimOptions()).refuses(trial))
    assert SimBackend(SimOptions()).refuses(replace_truth(trial)) is None


def replace_truth(trial):
    return trial.model_copy(update={"truth": ""})


def test_a_mistaken_truth_is_bad_usage(tmp_path: Path) -> None:
    write(tmp_path, MAP)
    write(tmp_path, stated(), "bench.toml")
    write(tmp_path, TRUTH.replace('inertia = "35 kg m^2"', 'inertia = "35 apples"'), "truth.toml")
    done = campaign(tmp_path, "run", "protocol.toml", "--truth", "truth.toml", code=2)
    line = TRUTH[: TRUTH.index('inertia = "35')].count("\n") + 1
    assert f"truth.toml:{line}:" in done.err
    assert not (tmp_path / "results").exists()
