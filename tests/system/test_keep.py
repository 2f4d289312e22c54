"""`keep`: which trials of a run have samples; metrics and digests are those of a run with all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import campaign
from campaign.archive.reading.open_run import open_run
from campaign.cli.prepare import Request, prepare
from campaign.cli.rerun import rerun_trial
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode, UsageError
from campaign.estimate import Estimate
from campaign.execution.decisions import extremes
from campaign.experiments.post_processing.recording_checks import doubt
from campaign.policy import SampleRetention
from campaign.reason import Cause
from campaign.recording import Ending, Outcome
from campaign.trial import Role
from tests.execution.fakes import COMPLETED, make_trials
from tests.execution.test_policy import Lab
from tests.system.laboratory import disturb
from tests.system.user import SEA, write
from tests.system.user import campaign as typed

NOISY = SEA.replace('"simulink"', '"platform"').replace(
    "cycles = 1\n", "cycles = 1\nrepeat = 3\n", 1
)
TRIALS = 6
PLAIN = Cause("plain", "it is a test")()


def executed(folder: Path, keep: str, protocol: str = NOISY) -> Path:
    results = folder / f"results-{keep}"
    request = Request(str(write(folder, protocol)), changes=(f"keep={keep}",), seed=7)
    assert run_protocol(request, results, RunOptions(workers=2)) is ExitCode.DONE
    return next(results.glob("*.nxs"))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("keep")
    return {keep: executed(folder, keep) for keep in ("all", "none", "failed", "2", "extremes")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keep", "kept"), [("none", set()), ("failed", set()), ("2", {1, 2}), ("all", {*range(1, 7)})]
)
def test_the_trials_that_keep_their_samples(runs: dict[str, Path], keep: str, kept: set[int]):
    run = open_run(runs[keep])
    assert {t.trial.number for t in run.trials if not t.not_kept} == kept
    assert len(run.trials) == TRIALS
    assert run.problems() == []


@pytest.mark.parametrize("keep", ["none", "failed", "2", "extremes"])
def test_what_is_found_is_that_of_a_run_with_all_samples(runs: dict[str, Path], keep: str):
    whole, part = (campaign.open(runs[name]).results for name in ("all", keep))
    assert len(whole.findings)
    assert part.findings.equals(whole.findings)
    assert part.problems == {}


@pytest.mark.parametrize("keep", ["none", "extremes"])
def test_digests_and_metrics_are_those_of_the_samples(runs: dict[str, Path], keep: str):
    for all_of_it, part in zip(*(open_run(runs[k]).trials for k in ("all", keep)), strict=True):
        assert part.digests() == all_of_it.digests()
        assert part.estimates == all_of_it.estimates
        assert part.estimates


def test_extremes_are_executed_again_and_keep_their_samples(runs: dict[str, Path]):
    run = open_run(runs["extremes"])
    errors = {
        t.trial.number: next(e.value for e in t.estimates if e.name == "stabilization_error")
        for t in run.trials
    }
    kept = {t.trial.number for t in run.trials if not t.not_kept}
    assert {min(errors, key=errors.get), max(errors, key=errors.get)} <= kept < set(errors)
    for trial in run.trials:
        earlier = run.earlier_attempts.get(trial.trial.number, ())
        assert len(earlier) == (trial.trial.number in kept)
        assert all(each.not_kept and each.digests() == trial.digests() for each in earlier)


def test_what_has_no_samples_is_not_measured_anew(runs: dict[str, Path]):
    whole = campaign.open(runs["all"]).results.findings
    part = campaign.open(runs["none"], measure_anew=True).results
    assert part.findings.equals(whole)
    assert part.problems == {}


def test_a_trial_with_neither_samples_nor_metrics_is_left_out_with_the_reason(runs):
    trial = open_run(runs["none"]).trials[0]
    assert doubt(trial) is None
    found = doubt(replace(trial, estimates=()))
    assert found is not None
    assert found.fatal
    assert found.reason.code == "samples not kept"


def test_metrics_are_a_row_for_each_trial(runs: dict[str, Path]):
    whole, part = (campaign.open(runs[keep]).metrics() for keep in ("all", "none"))
    apart = ["started", "ended"]
    assert part.drop(columns=apart).equals(whole.drop(columns=apart))
    assert part.attrs["units"]["stabilization_error"] == "rad"
    (first, *_) = open_run(runs["none"]).trials
    for each in first.estimates:
        row = part.loc[first.trial.number, [each.name, f"{each.name}_low", f"{each.name}_high"]]
        assert row.fillna(-1.0).to_list() == [
            -1.0 if number is None else number for number in (each.value, *each.combined)
        ]


@pytest.mark.slow
def test_a_page_says_that_samples_were_not_kept(runs: dict[str, Path], tmp_path: Path):
    run = runs["none"]
    typed(tmp_path, "report", str(run), "--output", str(tmp_path / "page"))
    page = (tmp_path / "page" / "report.html").read_text(encoding="utf-8")
    assert "Samples of 6 of 6 trials were not kept" in page
    out = typed(tmp_path, "verify", str(run))
    assert "5 more trials" in out.out + out.err


def test_a_trial_without_samples_is_repeated_by_its_digests(runs, tmp_path: Path, capsys):
    run = runs["none"]
    assert rerun_trial(str(run), "5", tmp_path) is ExitCode.DONE
    assert "equal to the bit, 12 series, by their digests" in capsys.readouterr().out


def test_a_repetition_that_differs_is_seen_by_its_digests(runs, tmp_path, capsys, monkeypatch):
    disturb(monkeypatch)
    assert rerun_trial(str(runs["none"]), "1", tmp_path) is ExitCode.TRIALS_FAILED
    assert "different, by the digests of: gyro_rate" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("protocol", "backend", "why"),
    [
        (SEA, "replay", "only a simulated trial"),
        (SEA.replace("stabilization", "excitation").split("cycles")[0], "sim", "needs samples"),
    ],
)
def test_where_samples_would_be_missed_nothing_is_executed(
    tmp_path: Path, runs: dict[str, Path], protocol: str, backend: str, why: str
):
    changes = ("keep=none", *([f"backend.run={runs['all']}"] if backend == "replay" else []))
    with pytest.raises(UsageError, match=why):
        prepare(Request(str(write(tmp_path, protocol)), changes=changes, backend=backend))


def test_failed_trials_and_checks_keep_theirs():
    trial = make_trials(1)[0]
    failed, done = Ending(Outcome.LIMIT, "too fast"), Ending(Outcome.COMPLETED)
    for keep, kept in (("none", False), ("failed", True), ("extremes", True), (1, True)):
        rule = SampleRetention(keep).rule(trial, 1)
        assert rule is not None
        assert rule(done)
        assert (rule(failed) == "") is kept
        assert SampleRetention(keep).rule(trial.model_copy(update={"role": Role.CHECK}), 1) is None
    assert SampleRetention.of(2, make_trials(5)).first == {1, 2}


def value(name: str, size: float) -> tuple[Estimate, ...]:
    return (Estimate.without_interval(name, size, "", PLAIN),)


def test_extremes_are_those_of_each_metric_of_each_test():
    one, two, three, four = make_trials(4)
    other = four.model_copy(update={"test": "other"})
    metrics = {1: value("a", 3.0), 2: value("a", 1.0), 3: value("a", 2.0), 4: value("a", 9.0)}
    found = extremes([one, two, three, other], metrics)
    assert found == {1: "largest a", 2: "smallest a", 4: "smallest a, largest a"}


def measured(lab: Lab) -> Lab:
    lab.archive.measured = {1: value("a", 3.0), 2: value("a", 1.0), 3: value("a", 2.0)}
    return lab


def test_a_run_that_is_stopped_among_its_extremes_is_not_complete():
    lab = measured(Lab(3, {}, keep="extremes"))
    again = []

    def second(stopped):
        again.append(lab.archive.attempt(lab.trials[0]))
        if len(again) == 2:
            lab.stop.request("you")
            return Ending(Outcome.INTERRUPTED, "you")
        return COMPLETED

    lab.backend.behaviour[1] = second
    run = lab.run()
    assert run.status == "interrupted"
    assert lab.archive.decisions[0] == ("keep samples", 1)
    assert run.outcomes == {Outcome.COMPLETED: 1, Outcome.INTERRUPTED: 1}
    # Who resumes it executes what is left: of trial 1 there is a second attempt by now.
    resumed = measured(Lab(3, {}, keep="extremes"))
    resumed.archive.attempts += [(1, Outcome.INTERRUPTED), (1, Outcome.COMPLETED)]
    resumed.archive.attempts += [(2, Outcome.COMPLETED), (3, Outcome.COMPLETED)]
    done = dict.fromkeys((1, 2, 3), Outcome.COMPLETED)
    assert resumed.run(finished=done).status == "complete"
    assert resumed.executed == ["trial-00002"]
