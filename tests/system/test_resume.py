"""A run that did not come to its end is gone on with, as if nothing had happened."""

from __future__ import annotations

import re
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.archive.layout.journal import Decision, RunResumed
from campaign.archive.layout.names import PLAN
from campaign.archive.reading.open_run import open_run
from campaign.archive.writing.unseal_run import unseal
from campaign.backends.serial import SerialOptions
from campaign.backends.sim import SimBackend
from campaign.cli.resume import remake
from campaign.cli.run import Remarks
from campaign.errors import ArchiveError, ExitCode, UsageError
from campaign.recording import Ending, Fault, Outcome
from tests.archive.test_resuming import content, documented_differences
from tests.system.laboratory import BENCH, Laboratory
from tests.system.user import SEA, begun, campaign, write

OWN_BENCH = SEA.replace('bench = "simulink"', 'bench = "bench.toml"\nseed = 5\nrepeat = 2')


ASKED = {"seed": 7, "remarks": Remarks("me", "a note", ("tag",))}


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Laboratory:
    return Laboratory(tmp_path, monkeypatch, OWN_BENCH)


def interrupted(lab: Laboratory) -> Path:
    """Stopped in the third of four trials; the signal comes while it is being executed."""
    archive = lab.stopped_in(3, Ending(Outcome.INTERRUPTED, "stopped"), **ASKED)
    assert open_run(archive).status == "interrupted"
    return archive


@pytest.mark.slow
def test_a_resumed_run_equals_an_uninterrupted_one_in_all_but_what_is_documented(lab: Laboratory):
    archive = interrupted(lab)
    assert lab.resume(archive) is ExitCode.DONE
    _, whole = lab.executed("other", **ASKED)
    ours, theirs = content(archive), content(whole)
    missing = object()
    differing = {
        path
        for path in ours.keys() | theirs.keys()
        if str(ours.get(path, missing)) != str(theirs.get(path, missing))
    }
    allowed = documented_differences()
    assert {path for path in differing if not allowed.fullmatch(path)} == set()
    assert "/trial_00003_attempt_1/data/gyro_rate" in differing


def test_a_run_whose_plan_is_damaged_is_not_resumed(lab: Laboratory):
    folder = unseal(interrupted(lab))
    plan = folder / PLAN
    plan.write_text("".join(plan.read_text("utf-8").splitlines(keepends=True)[:3]), "utf-8")
    with pytest.raises(ArchiveError, match="its plan has 3 of 4 trials: it is damaged"):
        lab.resume(folder)


@pytest.mark.slow
def test_finished_trials_are_not_repeated_and_an_interrupted_one_is(lab: Laboratory):
    archive = interrupted(lab)
    executed = []
    execute = SimBackend.execute
    lab.patch.setattr(
        SimBackend, "execute", lambda *a: (executed.append(a[1].number), execute(*a))[1]
    )
    lab.resume(archive)
    assert executed == [3, 4]
    with pytest.raises(UsageError, match="is complete"):
        lab.resume(archive)


@pytest.mark.slow
def test_white_space_and_comments_are_no_change(lab: Laboratory):
    archive = interrupted(lab)
    write(lab.folder, "# mine\n\n" + OWN_BENCH.replace(" = ", "   =  ") + "\n")
    write(lab.folder, "# mine\n" + BENCH, "bench.toml")
    assert lab.resume(archive) is ExitCode.DONE


def change_protocol(lab: Laboratory) -> None:
    write(lab.folder, OWN_BENCH.replace("settle_cycles = 1", "settle_cycles = 2"))


def change_bench(lab: Laboratory) -> None:
    limits = lab.bench.read_text(encoding="utf-8")
    assert 'angle = "' in limits
    write(lab.folder, limits.replace('angle = "', 'angle = "1', 1), "bench.toml")


def change_version(lab: Laboratory) -> None:
    real = lab.patch
    from campaign.execution import provenance

    versions = {**provenance.versions(), "numba": "0.1"}
    real.setattr(provenance, "versions", lambda: versions)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "field"),
    [
        (change_protocol, r"sea\.settle_cycles: 1(\.0)? → 2"),
        (change_bench, r"sea\.bench\.limits\.angle: .* → "),
        (change_version, r"versions\.numba: .* → 0\.1"),
    ],
)
def test_what_has_changed_is_named_by_field_and_refused_unless_accepted(
    lab: Laboratory, change, field
):
    archive = interrupted(lab)
    before = archive.read_bytes()
    change(lab)
    with pytest.raises(UsageError, match=field) as refused:
        lab.resume(archive)
    assert refused.value.exit_code is ExitCode.USAGE
    assert "--accept-changes" in str(refused.value)
    assert archive.read_bytes() == before, "a refused resume touches nothing"
    assert lab.resume(archive, accept=True) is ExitCode.DONE
    story = open_run(archive).story
    (resumed,) = [entry for entry in story.entries if isinstance(entry, RunResumed)]
    assert len(resumed.changes) == 1


def test_another_list_of_trials_is_another_run_whatever_is_accepted(lab: Laboratory):
    archive = interrupted(lab)
    write(lab.folder, OWN_BENCH.replace('"lugre"]', '"lugre", "static"]'))
    with pytest.raises(UsageError, match="start a new run") as refused:
        lab.resume(archive, accept=True)
    assert "matrix.compensation" in str(refused.value)


@pytest.mark.slow
def test_a_protocol_that_is_gone_is_said_and_the_archived_plan_is_executed(lab: Laboratory, capsys):
    archive = interrupted(lab)
    planned = [trial.fingerprint for trial in open_run(archive).plan]
    lab.protocol.unlink()
    lab.bench.unlink()
    assert lab.resume(archive) is ExitCode.DONE
    assert "continuing with the archived plan" in capsys.readouterr().err
    assert [each.trial.fingerprint for each in open_run(archive).trials] == planned


@pytest.mark.slow
@pytest.mark.parametrize(("policy", "repeated"), [("skip", False), ("abort", True)])
def test_a_fault_is_repeated_when_it_ended_the_run_and_not_when_it_was_skipped(
    lab: Laboratory, policy: str, repeated: bool
):
    lab.protocol = write(lab.folder, f'faults = {{ reset = "{policy}" }}\n{OWN_BENCH}')
    fault = Ending(Outcome.FAULT, "it started anew", fault=Fault.RESET)
    archive = lab.stopped_in(2, fault, **ASKED)
    status = open_run(archive).status
    if repeated:
        assert status == "fault"
        assert lab.resume(archive) is ExitCode.DONE
    else:
        assert status == "failed trials"
        with pytest.raises(UsageError, match="failed trials"):
            lab.resume(archive)
    story = open_run(archive).story
    decisions = [entry.decision for entry in story.entries if isinstance(entry, Decision)]
    assert decisions == [policy]


def test_a_bench_at_another_port_is_no_change_and_where_it_is_today_counts(lab: Laboratory):
    run = open_run(interrupted(lab))
    with pytest.raises(UsageError, match="'sim' has no port"):
        remake(run, "socket://127.0.0.1:9")
    options = SerialOptions(port="/dev/one").model_dump(mode="json")
    at_one = run.header.model_copy(
        update={
            "backend": "serial",
            "backend_options": options,
            "overrides": {"backend.port": '"/dev/one"'},
        }
    )
    for port in ("/dev/one", "/dev/two"):
        remade = remake(replace(run, header=at_one), port)
        assert remade.changes == ()
        assert remade.options.port == port


@pytest.mark.slow
def test_the_command_says_how_to_go_on_and_goes_on(tmp_path: Path):
    """The real thing, from the command line: Ctrl-C once, and the command that is then shown."""
    write(tmp_path, SEA.replace("cycles = 1\n", "cycles = 10\nrepeat = 15\n", 1))
    with begun(tmp_path, "run", "protocol.toml", "--workers", "1") as process:
        process.stderr.readline()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 130
    name = Path(out.splitlines()[-1]).stem
    assert err.splitlines()[-1] == f"  campaign resume {name}"
    # The trials that were running are counted where the run says how it ended, and only there.
    assert len(re.findall("interrupted", err)) == 2
    assert re.search(r"\d+ interrupted, in ", err)
    done = campaign(tmp_path, "resume", name)
    assert done.last_line == f"results/{name}.nxs"
    assert done.err.splitlines()[-1].startswith("complete: 30 trials done")
