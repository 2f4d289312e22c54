"""Archives that earlier programs wrote, kept as they were: every later program must read them."""

import hashlib
from pathlib import Path

import pytest

from campaign.archive import RunStatus, open_run
from campaign.errors import ArchiveError
from campaign.trial import Fault, Outcome, Role, SafeState

KEPT = Path(__file__).parent / "kept"

# Of every kept file, so that nobody writes them anew: `sha256sum --check` reads it.
HASHES = {
    name: digest for digest, name in map(str.split, (KEPT / "sha256sums").read_text().splitlines())
}

CHANNELS = [
    "command",
    "base_rate",
    "gyro_rate",
    "relative_rate",
    "relative_angle",
    "motor_current",
    "drive_torque",
    "pointing_error",
    "compensation_torque",
    "friction_torque",
    "load_rate",
]


@pytest.mark.parametrize("name", HASHES)
def test_the_kept_files_are_those_that_were_written(name):
    assert hashlib.sha256((KEPT / name).read_bytes()).hexdigest() == HASHES[name]


@pytest.mark.parametrize("name", ["format-1.nxs", "format-1.partial", "format-2.nxs"])
def test_samples_and_seeds_are_read_as_they_were_recorded(name):
    run = open_run(KEPT / name)
    assert run.damaged == ()
    assert run.problems() == []
    first, second = run.trials[:2]
    assert (first.trial.seed, second.trial.seed) == (331273022365607889, 4186516175884836055)
    assert first.trial.point == {"compensation": "none"}
    assert first.trial.role is Role.MEASUREMENT
    recording = first.recording()
    assert list(recording.channels) == CHANNELS
    assert len(recording.time) == 1000
    assert recording["gyro_rate"][-1] == -0.005490271759023409
    assert second.recording()["gyro_rate"][-1] == 2.2903620161759976e-05
    assert first.ending.outcome is Outcome.COMPLETED
    assert run.header.protocol_name == "kept"
    assert [planned.number for planned in run.plan] == [1, 2, 3]


def test_what_format_1_did_not_have_has_its_default():
    run = open_run(KEPT / "format-1.nxs")
    assert (run.status, run.safe_state) == (RunStatus.COMPLETE, SafeState.CONFIRMED)
    assert run.ended == "2026-11-21T12:41:44.176+00:00"
    assert (run.header.seed, run.header.protocol_path) == (None, "")
    assert {(t.ending.fault, len(t.ending.telemetry)) for t in run.trials} == {(None, 0)}
    assert run.trials[2].trial.setup == ()
    assert run.earlier_attempts == {}
    assert run.unchanged()
    assert run.planned(3) == run.trials[2].trial
    [event] = run.trials[2].recording().events
    assert (event.time, event.text) == (0.598, "the rate that ends the trial was reached")


def test_a_killed_run_of_format_1_knows_what_it_executed():
    run = open_run(KEPT / "format-1.partial")
    assert run.status is RunStatus.INCOMPLETE
    assert [archived.trial.number for archived in run.trials] == [1, 2]
    assert run.planned(2) == run.trials[1].trial
    with pytest.raises(ArchiveError, match="format 1 holds only those that were executed"):
        run.planned(3)


def test_a_sealed_run_of_format_2_has_its_attempts_and_its_whole_plan():
    run = open_run(KEPT / "format-2.nxs")
    assert (run.status, run.reason) == (RunStatus.FAULT, "the operator said no")
    assert run.unchanged()
    assert (run.header.seed, run.header.protocol_path) == (42, "/lab/kept.toml")
    [interrupted], [lost] = (run.earlier_attempts[number] for number in (1, 2))
    assert (interrupted.ending.outcome, interrupted.ending.reason) == ("interrupted", "Ctrl-C")
    assert lost.ending.fault is Fault.LOST_CONNECTION
    assert lost.ending.telemetry == {"latency_ms": {"most": 4.5}, "resends": 3}
    assert lost.recording()["gyro_rate"][-1] == 2.2903620161759976e-05
    third = run.planned(3)
    assert (third.seed, third.setup) == (6756009798499356967, ("Lock the yaw axis",))
    assert third.set_by_operator == ("bench.axis.inertia",)
    assert third.fingerprint == run.plan[2].fingerprint
    for event in ('"run resumed"', '"decision":"retry"', '"step":"Lock the yaw axis"'):
        assert event in run.journal


def test_a_killed_run_of_format_2_has_its_attempts_and_its_whole_plan():
    run = open_run(KEPT / "format-2.partial")
    assert run.status is RunStatus.INCOMPLETE
    assert run.damaged == ()
    assert run.problems() == []
    assert [archived.ending.outcome for archived in run.trials] == ["completed", "fault"]
    assert run.trials[0].path.name == "trial-00001-2.nxs"
    assert run.trials[0].recording()["gyro_rate"][-1] == -0.005490271759023409
    assert [attempt.ending.reason for attempt in run.earlier_attempts[1]] == ["Ctrl-C"]
    assert run.planned(3).seed == 6756009798499356967
    assert run.journal.endswith("\n")
