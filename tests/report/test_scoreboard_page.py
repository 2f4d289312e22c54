"""The scoreboard of a report: what follows from the archive, and how the page says it."""

from __future__ import annotations

import csv
import dataclasses
import html
import io
import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

import pytest

from campaign.api.analysis import analyse_run, published_of
from campaign.archive.layout.journal import RunResumed, TrialFinished
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.reading.run_reader import RunReader
from campaign.estimate import OF_ONE_TRIAL, Estimate
from campaign.experiments.interface import Experiment
from campaign.published.provenance import OF_A_TRUTH
from campaign.published.scoreboard import Line, score
from campaign.published.verdicts import reproduced
from campaign.reason import Reason
from campaign.recording import Outcome, SafeState
from campaign.report.content.lines import shown_line
from campaign.result import Finding

pytestmark = pytest.mark.usefixtures("drawings_kept")

TESTS = {"stabilization": ("5.2", "5.8")}
AXIS = {"name": "azimuth", "inertia": "36 kg m^2"}


def found(run: RunReader, experiments: Mapping[str, Experiment]) -> list[Line]:
    """The lines with a number."""
    tests = analyse_run(run, experiments)
    board = score(published_of(run), [test.evidence() for test in tests])
    return [line for line in board.lines if line.reproduced is not None]


def rows(folder: Path, name: str = "scoreboard") -> list[dict[str, str]]:
    text = (folder / "tables" / f"{name}.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text)))


def test_the_bench_as_described(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path, tests=TESTS)
    assert {line.status for line in found(run, made_up.EXPERIMENTS)} == {"selected"}


@pytest.mark.slow
def test_an_altered_bench_and_what_was_found_twice_are_told(
    made_up: ModuleType, tmp_path: Path
) -> None:
    """Beside them Figure 5.14, of which nothing was found: one of its trials failed."""
    wanted = {"stabilization": ("5.2", "figure 5.14"), "velocity_map": ("5.2",)}
    run = made_up.made_up_run(tmp_path, tests=wanted, bench=made_up.bench(axis=AXIS))
    kind = made_up.EXPERIMENTS["stabilization"]
    made_up.build(run, tmp_path / "out", experiments={**made_up.EXPERIMENTS, "velocity_map": kind})
    folder = tmp_path / "out"
    assert [row["status"] for row in rows(folder)] == ["altered"] * 3 + [""] * 12
    assert [row["verdict"] for row in rows(folder)[3:]] == ["not found"] * 12
    again = [(row["row"], row["test"]) for row in rows(folder, "scoreboard-runs")]
    assert again == [(name, "velocity-map") for name in ("none", "static", "lugre")]
    page = (folder / "report.html").read_text(encoding="utf-8")
    text = " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())
    why = "Altered: stabilization: the bench is not the 'simulink' that was described."
    assert f"{why} campaign fingerprint BENCH states anew" in text
    assert text.count("not found") >= 12
    assert "Samples from simulation" in text


def test_of_a_truth_no_fingerprint_is_asked_for(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path, tests=TESTS)
    trials = tuple(
        dataclasses.replace(each, trial=each.trial.model_copy(update={"truth": "0" * 64}))
        for each in run.trials
    )
    made_up.build(dataclasses.replace(run, trials=trials), tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    text = " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())
    assert f"Altered: stabilization: {OF_A_TRUTH}." in text
    assert "campaign fingerprint" not in text


def test_a_study_of_perturbations_is_judged_by_the_protocol_s_bench(
    made_up: ModuleType, tmp_path: Path
) -> None:
    run = made_up.made_up_run(tmp_path, tests=TESTS, bench=made_up.bench(axis=AXIS))
    described = made_up.bench().model_dump(mode="json")
    protocol = {"tests": [{"name": "stabilization", "bench": described}]}
    header = run.header.model_copy(update={"normalised": protocol})
    run = dataclasses.replace(run, header=header)
    assert {line.status for line in found(run, made_up.EXPERIMENTS)} == {"altered"}
    kind = dataclasses.replace(made_up.EXPERIMENTS["stabilization"], perturbs_bench=True)
    assert {line.status for line in found(run, {"stabilization": kind})} == {"selected"}


INERTIA = "bench.axis.inertia: 35.0 → 36.0"
CHANGED = "the run was gone on with on a changed bench"


@pytest.mark.parametrize("perturbs", [False, True])
@pytest.mark.parametrize(
    ("resumes", "why"),
    [
        ([f"stabilization.{INERTIA}"], CHANGED),
        (["stabilization.bench.known.seen[0]: 5.2 → 5.8"], CHANGED),
        (["other.bench.axis.inertia (and in 2 other tests): 35.0 → 36.0"], CHANGED),
        (["stabilization.matrix.bench.axis.inertia[1]: 35.0 → 36.0"], CHANGED),
        ([f"stabilization.{INERTIA}", ""], CHANGED),
        (["", f"stabilization.{INERTIA}"], ""),  # nothing was executed after it
        ([f"other.{INERTIA}"], ""),
        (["stabilization.bench.limits.angle: 1.0 → 2.0"], ""),
        (["stabilization.cycles: 1 → 2", "versions.numpy: 2.0 → 2.1"], ""),
    ],
)
def test_a_run_that_was_gone_on_with_on_a_changed_bench(
    made_up: ModuleType, tmp_path: Path, resumes: list[str], why: str, perturbs: bool
) -> None:
    """A trial was finished before the first resume, one after it, and none after the second."""
    run = made_up.made_up_run(tmp_path, tests=TESTS)
    lines: list[str] = [finished(1)]
    for number, change in enumerate(resumes):
        lines.append(RunResumed(at="", changes=(change,) if change else ()).model_dump_json())
        lines += [finished(2)] if number == 0 else []
    run = dataclasses.replace(
        run, story=read_lines("".join(f"{line}\n" for line in lines).encode())
    )
    kind = dataclasses.replace(made_up.EXPERIMENTS["stabilization"], perturbs_bench=perturbs)
    (test,) = analyse_run(run, {"stabilization": kind})
    assert test.provenance.why_altered({"compensation": "none"}) == why
    status = "altered" if why else "selected"
    assert {line.status for line in found(run, {"stabilization": kind})} == {status}


def finished(trial: int) -> str:
    return TrialFinished(
        at="",
        trial=trial,
        file=f"trial-{trial:05}.nxs",
        sha256="0" * 64,
        record="1" * 64,
        bytes=1,
        outcome=Outcome.COMPLETED,
        reason="",
        safe_state=SafeState.CONFIRMED,
    ).model_dump_json()


@pytest.mark.parametrize(
    ("header", "source"),
    [
        ({}, "simulation"),
        ({"backend": "serial"}, "hardware"),
        ({"backend": "replay"}, "recording"),
        ({"backend": "somebody-s"}, ""),
        ({"backend": "somebody-s", "source": "hardware"}, "hardware"),
        ({"backend": "sim", "source": "recording"}, "recording"),
    ],
)
def test_where_the_samples_come_from(
    made_up: ModuleType, tmp_path: Path, header: dict[str, str], source: str
) -> None:
    run = made_up.made_up_run(tmp_path, tests=TESTS, **header)
    assert {line.source for line in found(run, made_up.EXPERIMENTS)} == {source}


def test_an_interval_of_one_trial_says_that_it_is(made_up: ModuleType, tmp_path: Path) -> None:
    """A sentence leaves that of a ratio out, and the table has it: each must say why."""
    line, *_ = found(made_up.made_up_run(tmp_path, tests=TESTS), made_up.EXPERIMENTS)
    assert line.found is not None
    value = line.found.value

    def notes(**how: object) -> set[str]:
        told = dataclasses.replace(line, found=dataclasses.replace(line.found, **how))
        return set(shown_line(told).notes) - set(shown_line(line).notes)

    ends = {"low": 0.9 * value, "high": 1.1 * value}
    said = "one trial: the interval is of the calibration, without the scatter between trials"
    assert notes(reason=OF_ONE_TRIAL(), **ends) == {said}
    assert notes(reason=Reason("of blocks", str(OF_ONE_TRIAL())), **ends) == set()
    said = "no interval: one trial, and no calibration of its bench"
    assert notes(reason=OF_ONE_TRIAL(), low=None, high=None) == {said}


def test_the_reason_of_an_interval_comes_with_the_number() -> None:
    known = Estimate("error", 0.5, "mrad", 0.4, 0.6, 0.95, reason=OF_ONE_TRIAL())
    assert reproduced(Finding.of(known, {}), "mrad").reason == OF_ONE_TRIAL()
