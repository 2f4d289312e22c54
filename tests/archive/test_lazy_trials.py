"""Records of a sealed run are parsed when their trials are asked for, and let go of."""

import pickle
from collections import Counter
from pathlib import Path

import pytest

import campaign
from campaign.archive.layout import journal_summary
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading import sealed_run
from campaign.archive.reading.archived_metrics import ArchivedMetrics
from campaign.archive.reading.lazy_trials import Outline
from campaign.archive.reading.open_run import open_run
from campaign.cli.show import show_archive
from campaign.errors import ExitCode
from campaign.estimate import Estimate
from campaign.policy import SampleRetention
from campaign.recording import Ending, Outcome, SafeState

TRIALS = 7
FAILED = 3
FOUND = ArchivedMetrics((Estimate("peak", 0.25, "rad/s", 0.2, 0.3, 0.95, "m"),), "campaign 0")


@pytest.fixture
def path(tmp_path: Path, kit) -> Path:
    """A run of trials without samples, each measured, one failed."""
    writer, trials = kit.begin(tmp_path, TRIALS)
    for trial in trials:
        limit = Ending(Outcome.LIMIT, "too fast", SafeState.CONFIRMED)
        how = kit.CHANNELS, SampleRetention("none")
        ending = limit if trial.number == FAILED else None
        kit.recorded(writer, trial, 10, *how, ending=ending).measure(lambda archived: FOUND)
    return writer.seal(RunStatus.FAILED_TRIALS, ended=kit.ENDED)


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How many records were parsed, and lines of the journal one by one."""
    counts: Counter[str] = Counter()
    for module, name in ((sealed_run, "parse_record"), (journal_summary, "_parse")):
        original = getattr(module, name)

        def counted(*told, original=original, name=name):
            counts[name] += 1
            return original(*told)

        monkeypatch.setattr(module, name, counted)
    return counts


def test_show_parses_no_record_and_no_line_by_itself(path, parsed, capsys) -> None:
    assert show_archive(str(path), path.parent, as_json=False) is ExitCode.DONE
    assert not parsed
    assert "trial-00003" in capsys.readouterr().out


def test_what_is_told_of_an_opened_run_parses_no_record(path, parsed) -> None:
    view = campaign.open(path)
    assert f"{TRIALS} of {TRIALS} trials executed" in repr(view)
    assert view.tests.loc["map", "completed"] == TRIALS - 1
    assert len(view["map"]) == TRIALS
    assert not parsed
    assert view.trial(FAILED).ending.reason == "too fast"
    assert parsed["parse_record"] == 1


def test_a_table_parses_a_trial_once_and_keeps_none(path, parsed) -> None:
    view = campaign.open(path)
    assert view.metrics()["peak"].tolist() == [0.25] * TRIALS
    assert parsed["parse_record"] == TRIALS
    held = view.archive.trials[0]
    assert view.archive.trials_of("map")[0] is held
    assert parsed["parse_record"] == TRIALS + 1
    assert view.archive.trials[0] is held
    del held
    assert view.archive.trials[0].estimates == FOUND.estimates
    assert parsed["parse_record"] == TRIALS + 2


def test_trials_are_a_sequence_like_a_tuple(path) -> None:
    run = open_run(path)
    trials = tuple(run.trials)
    assert run.trials == trials
    assert run.trials != trials[1:]
    assert run.trials[1:3] == trials[1:3]
    assert run.trials[-1] == trials[-1]
    assert pickle.loads(pickle.dumps(run)).trials == trials
    assert run.executed(FAILED) == trials[FAILED - 1]
    assert run.executed(TRIALS + 1) is None


def test_outlines_are_as_the_records_say(path) -> None:
    """But for the label, which is the plan's: with the conditions in the order of the protocol."""
    run = open_run(path)
    labels = {planned.number: planned.label for planned in run.plan}
    wanted = [Outline.of(trial)._replace(label=labels[trial.trial.number]) for trial in run.trials]
    assert list(run.outlines) == wanted
