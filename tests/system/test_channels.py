"""What a bench does not record is said before it moves, and what that costs as well."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from campaign.backends.sim import SimBackend
from campaign.cli.kinds import list_kinds, show_kind
from campaign.cli.plan import show_plan
from campaign.cli.prepare import Request
from campaign.cli.resume import resume_run
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode, UsageError
from campaign.experiments import experiments
from campaign.protocol import load_protocol, make_plan
from campaign.recording import Ending, SafeState
from campaign.resources import protocols_folder
from campaign.trial import Role, Trial
from tests.system.user import SEA, write

ALL = SimBackend.channels(None, SimpleNamespace(truth=""))  # type: ignore[arg-type]
TWO = f"""{SEA}
[[test]]
name = "map"
kind = "velocity_map"
bench = "simulink"
speeds = ["5 deg/s", "10 deg/s"]
max_time = "3 s"
warm_up_cycles = 1
"""


class Bench:
    """A simulated bench without some channels, which it may know only once it is connected."""

    def __init__(self, *without: str, unconnected: bool = True) -> None:
        self.names = ALL - set(without)
        self.known = unconnected
        self.executed = 0
        self.made_safe = 0

    def put_in_place(self, monkeypatch: pytest.MonkeyPatch) -> Bench:
        def enter(backend: SimBackend) -> SimBackend:
            self.known = True
            return backend

        def execute(*arguments: object) -> None:
            self.executed += 1
            raise AssertionError("it moved")

        def make_safe(backend: SimBackend) -> SafeState:
            self.made_safe += 1
            return SafeState.CONFIRMED

        monkeypatch.setattr(SimBackend, "__enter__", enter)
        monkeypatch.setattr(SimBackend, "channels", self.channels)
        monkeypatch.setattr(SimBackend, "execute", execute)
        monkeypatch.setattr(SimBackend, "make_safe", make_safe)
        return self

    def channels(self, trial: Trial) -> frozenset[str] | None:
        return self.names if self.known else None


def planned(folder: Path, text: str) -> tuple[Trial, ...]:
    protocol = load_protocol(write(folder, text), experiments(), shipped=protocols_folder())
    return make_plan(protocol, seed=1).trials


def test_a_trial_says_what_its_analysis_requires_and_can_use(tmp_path: Path):
    plain, compensated, warm_up, *speeds = planned(tmp_path, TWO)
    assert plain.requires == compensated.requires == ("pointing_error",)
    sensors = {"base_rate", "gyro_rate", "relative_angle", "relative_rate"}
    assert set(plain.can_use) == sensors
    assert set(compensated.can_use) == {*sensors, "compensation_torque", "friction_torque"}
    assert warm_up.role is Role.WARM_UP
    assert warm_up.requires == warm_up.can_use == ()
    for trial in speeds:
        assert trial.requires == ("drive_torque", "gyro_rate")
        assert trial.can_use == ("command", "relative_angle")
    bare = plain.model_copy(update={"requires": (), "can_use": ()})
    assert Trial.model_validate(bare.model_dump()).fingerprint == plain.fingerprint


def test_a_check_requires_what_the_trial_does_that_it_repeats(tmp_path: Path):
    checked = TWO.replace("[[test]]", '[check]\ntest = "sea"\nevery = 1\n\n[[test]]', 1)
    checks = [trial for trial in planned(tmp_path, checked) if trial.role is Role.CHECK]
    assert checks
    assert {trial.requires for trial in checks} == {("pointing_error",)}


def test_plan_and_run_refuse_what_the_backend_is_known_not_to_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    bench = Bench("gyro_rate").put_in_place(monkeypatch)
    request = Request(str(write(tmp_path, TWO)))
    with pytest.raises(UsageError) as refused:
        show_plan(request, tmp_path / "results", as_json=False)
    said = str(refused.value)
    for word in (
        "the backend 'sim'",
        "the experiment 'velocity_map'",
        "trial-00004 (map [speed=",  # after the sea and the warm-up, which do not need it
        "gyro_rate (rate of the load in space, as its gyro shows it), for the rate of each point",
        "leave out the test 'map'",
    ):
        assert word in said
    assert refused.value.exit_code is ExitCode.USAGE
    with pytest.raises(UsageError, match="does not record"):
        run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    assert not bench.executed
    assert not (tmp_path / "results").exists()
    show_plan(Request(request.protocol, only=("sea",)), tmp_path / "results", as_json=False)


def test_a_bench_that_tells_only_when_connected_is_refused_before_it_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    bench = Bench("pointing_error", unconnected=False).put_in_place(monkeypatch)
    request = Request(str(write(tmp_path, SEA)))
    show_plan(request, tmp_path / "results", as_json=False)  # it does not know
    with pytest.raises(UsageError, match=r"pointing_error \(integral of.*\n.*was moved"):
        run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    assert (bench.executed, bench.made_safe) == (0, 1)
    assert not (tmp_path / "results").exists()


def test_a_bench_that_does_not_tell_is_taken_at_its_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(SimBackend, "channels", lambda backend, trial: None)
    request = Request(str(write(tmp_path, SEA)))
    code = run_protocol(request, tmp_path / "results", RunOptions(workers=1))
    assert code is ExitCode.DONE


@pytest.mark.slow
def test_resume_asks_for_what_is_left_and_for_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The sea is done and required a pointing error; the map is left and requires none."""
    request = Request(str(write(tmp_path, TWO)))
    results = tmp_path / "results"
    execute = SimBackend.execute

    def stop_in_the_map(backend: SimBackend, trial: Trial, *more: Any) -> Ending:
        if trial.number == 4:
            signal.raise_signal(signal.SIGINT)
        return execute(backend, trial, *more)

    with monkeypatch.context() as patched:
        patched.setattr(SimBackend, "execute", stop_in_the_map)
        run_protocol(request, results, RunOptions(workers=1))
    (path,) = results.glob("*.nxs")
    again = RunOptions(workers=1, yes=True)
    for unconnected in (True, False):
        with monkeypatch.context() as patched:
            bench = Bench("drive_torque", unconnected=unconnected).put_in_place(patched)
            with pytest.raises(UsageError, match=r"trial-0000[45] .* requires drive_torque"):
                resume_run(str(path), results, again)
            assert not bench.executed
    monkeypatch.setattr(SimBackend, "channels", lambda backend, trial: ALL - {"pointing_error"})
    assert resume_run(str(path), results, again) is ExitCode.DONE


def test_a_plan_says_what_an_optional_channel_costs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    request = Request(str(write(tmp_path, TWO)))
    show_plan(request, tmp_path / "results", as_json=False)
    assert "without" not in capsys.readouterr().out
    show_plan(request, tmp_path / "results", as_json=True)
    assert json.loads(capsys.readouterr().out)["without"] == []
    Bench("base_rate", "command", "load_rate").put_in_place(monkeypatch)
    show_plan(request, tmp_path / "results", as_json=False)
    lines = [line for line in capsys.readouterr().out.splitlines() if "without" in line]
    assert lines == [
        "sea: without base_rate: no time stuck, and no figure of the relative rate",
        "map: without command: no command in the figure of one point",
    ]
    show_plan(request, tmp_path / "results", as_json=True)
    tree = json.loads(capsys.readouterr().out)
    assert [(loss["test"], loss["channel"]) for loss in tree["without"]] == [
        ("sea", "base_rate"),
        ("map", "command"),
    ]
    assert tree["trials"][0]["requires"] == ["pointing_error"]


def test_kinds_tell_of_channels(capsys: pytest.CaptureFixture[str]):
    show_kind("stabilization")
    lines = capsys.readouterr().out.splitlines()
    assert "pointing_error\trequired\tfor the stabilization error" in lines
    assert (
        "base_rate\toptional\twithout it: no time stuck, and no figure of the relative rate"
        in lines
    )
    show_kind("channels")
    lines = capsys.readouterr().out.splitlines()
    temperature = next(line for line in lines if line.startswith("temperature"))
    assert temperature.split("\t")[1:5] == ["degC", "degC", "none", "sensor"]
    assert {line.split("\t")[0] for line in lines} >= ALL
    list_kinds()
    assert "channels" in capsys.readouterr().out
    with pytest.raises(UsageError, match="did you mean 'channels'"):
        show_kind("chanels")
