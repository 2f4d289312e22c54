"""Exit code 6: trials completed, and what was asked for could not be found in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.channels import LOAD_RATE
from campaign.cli.identify import identify_run
from campaign.cli.report import report_run
from campaign.errors import DEBUG, PRECEDENCE, CampaignError, ExitCode, NoResultError
from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment, Model, TestData, TrialData, metrics
from campaign.result import Finding, Result
from tests.execution.test_measuring import numbered, run
from tests.experiments.laboratory import trials
from tests.experiments.test_left_out import SHORT, failing, top_rate
from tests.physics.benches import bench
from tests.system.user import ROOT

Measure = Callable[[TrialData], Sequence[Estimate]]
PULLS = [{"pull_rate": rate} for rate in ("0.1 rad/s", "0.2 rad/s", "0.3 rad/s")]


def archived(folder: Path, kind: Experiment) -> RunReader:
    """A run of three pulls, measured as `kind` does."""
    with experiments().including(kind):
        return run(folder, numbered(trials(kind.name, bench(), SHORT, PULLS)))


def report(reader: RunReader, kind: Experiment, *, anew: bool = False) -> ExitCode:
    with experiments().including(kind):
        _, code = report_run(str(reader.path), reader.path.parent, None, None, measure_anew=anew)
    return code


def page(reader: RunReader) -> str:
    folder = reader.path.with_name(f"{reader.path.stem}-report")
    return " ".join((folder / "report.html").read_text(encoding="utf-8").split())


@contextmanager
def damaged(reader: RunReader, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As if something of the run that no analysis reads were damaged."""
    found = replace(open_run(reader.path), damaged=(Damage("journal.jsonl:3", "a line is lost"),))
    with monkeypatch.context() as patch:
        for module in ("campaign.cli.report", "campaign.identify.material"):
            patch.setattr(f"{module}.open_run", lambda path: found)
        yield


def test_a_trial_that_is_left_out_is_told_on_page_and_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = top_rate(failing(RuntimeError("no such window"), Counter(), (2,)))
    reader = archived(tmp_path, kind)
    assert report(reader, kind) is ExitCode.DONE
    told = "(trial 2): RuntimeError: no such window; not analysed (1 of 3 trials)."
    assert told in " ".join(capsys.readouterr().err.split())
    assert told in page(reader)


def test_a_test_of_which_each_trial_is_left_out_has_no_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = top_rate(failing(RuntimeError("no"), Counter(), (1, 2, 3)))
    reader = archived(tmp_path, kind)
    assert report(reader, kind) is ExitCode.NO_RESULT
    told = " ".join(capsys.readouterr().err.split())
    assert "and 2 more trials: RuntimeError: no; not analysed (3 of 3 trials)." in told
    with damaged(reader, monkeypatch):
        assert report(reader, kind) is ExitCode.ARCHIVE


def test_an_analysis_that_handles_every_failure_and_finds_nothing_has_no_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = top_rate(failing(RuntimeError("no"), Counter(), ()))
    kind = replace(kind, analyse=lambda data: Result(notes=("No pull slid.",)))
    assert report(archived(tmp_path, kind), kind) is ExitCode.NO_RESULT
    assert "top_rate: no result: No pull slid." in capsys.readouterr().err


def test_an_analysis_that_fails_says_how_to_see_where(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def analyse(data: TestData) -> Result:
        raise KeyError("a bug")

    kind = replace(top_rate(failing(RuntimeError("no"), Counter(), ())), analyse=analyse)
    reader = archived(tmp_path, kind)
    assert report(reader, kind) is ExitCode.NO_RESULT
    told = capsys.readouterr().err
    assert "top_rate: the analysis failed: KeyError: 'a bug'\n" in told
    assert "--measure-anew" not in told  # which fails the same way
    assert "Traceback" not in told
    assert f"  {DEBUG}=1 campaign report {reader.path.with_suffix('')}\n" in told
    monkeypatch.setenv(DEBUG, "1")
    assert report(reader, kind) is ExitCode.NO_RESULT
    assert 'raise KeyError("a bug")' in capsys.readouterr().err


def test_measuring_anew_is_advised_where_it_works(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Metrics of an older version lack what the analysis of today cannot do without."""

    def today(data: TrialData) -> Sequence[Estimate]:
        return [Estimate("top", float(np.max(data.recording()[LOAD_RATE])), "rad/s")]

    def analyse(data: TestData) -> Result:
        found = [dict(metrics(item, today))["top"] for item in data.completed()]
        return Result(findings=tuple(Finding.of(each, {}) for each in found))

    kind = top_rate(lambda data: [Estimate("former", 1.0, "rad/s")])
    reader = archived(tmp_path, kind)
    kind = replace(top_rate(today), analyse=analyse)
    assert report(reader, kind) is ExitCode.NO_RESULT
    assert "--measure-anew" in capsys.readouterr().err
    assert report(reader, kind, anew=True) is ExitCode.DONE


@pytest.mark.parametrize("models", [("ramps",), ("frequency_response", "ramps")])
def test_a_run_in_which_nothing_is_identified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, models: tuple[str, ...]
) -> None:
    reader = archived(tmp_path, top_rate(failing(RuntimeError("no"), Counter(), ())))
    with pytest.raises(NoResultError) as refused:
        identify_run(str(reader.path), tmp_path, models=models)
    assert refused.value.exit_code is ExitCode.NO_RESULT
    assert not reader.path.with_name(f"{reader.path.stem}-identification").exists()
    with damaged(reader, monkeypatch), pytest.raises(CampaignError) as refused:
        identify_run(str(reader.path), tmp_path, models=models)
    assert refused.value.exit_code is ExitCode.ARCHIVE


def test_a_method_whose_numbers_overflow_costs_that_method(tmp_path: Path) -> None:
    def overflow(data: TestData) -> Result:
        raise OverflowError("math range error")

    kind = top_rate(failing(RuntimeError("no"), Counter(), ()))
    kind = replace(kind, model=Model("overflowing", ""), analyse=overflow)
    reader = archived(tmp_path, kind)
    with experiments().including(kind), pytest.raises(NoResultError) as refused:
        identify_run(str(reader.path), tmp_path, models=(kind.model.name,))
    assert "overflowing: it failed: OverflowError: math range error" in str(refused.value)


def test_the_documented_order_is_the_one_that_holds() -> None:
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8").partition("## Exit codes")[2]
    rows = (line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| "))
    assert [row for row in rows if row.isdigit()] == [str(code.value) for code in PRECEDENCE]
