"""A person at the terminal confirms steps, or ends the run."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from io import StringIO

import pytest

from campaign.backends import backends
from campaign.cli.ask import ASSUMED, ConsoleOperator, NotStartedError, allow_motion
from campaign.execution.operator_prompts import AbsentOperator
from campaign.experiments import experiments
from campaign.protocol import PlannedTest, load_protocol, make_plan
from campaign.resources import protocols_folder
from tests.execution.fakes import make_trials


@pytest.mark.parametrize(
    ("lines", "answer"),
    [
        (["\n"], "done"),
        (["no\n", "preloaded to 1.02 N m\n"], "preloaded to 1.02 N m"),
        (["stop\n"], None),
        ([None], None),
    ],
)
def test_an_answer_is_recorded_as_given(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    lines: list[str | None],
    answer: str | None,
):
    waiting = iter(lines)
    monkeypatch.setattr("campaign.cli.ask.read_line", lambda stop: next(waiting))
    operator = ConsoleOperator(nullcontext)
    assert (
        operator.confirm(make_trials(1)[0], "Preload the spring to 1 N m", lambda: False) == answer
    )
    assert "Preload the spring to 1 N m" in capsys.readouterr().err


def test_a_script_takes_steps_for_done_and_the_record_says_so():
    said = AbsentOperator(ASSUMED).confirm(make_trials(1)[0], "x", lambda: False)
    assert said == "assumed done (--yes)"


def unstable_test() -> PlannedTest:
    """An observer's gain at which the platform's loop is unstable, sought by the experiment."""
    path = protocols_folder() / "observer_gain.toml"
    changes = ('observer-gain.bench.controller.rate.proportional="11441.5 A s/rad"',)
    plan = make_plan(
        load_protocol(path, experiments(), overrides=changes, shipped=protocols_folder())
    )
    return plan.tests[0]


def asked(
    monkeypatch: pytest.MonkeyPatch, tests: list[PlannedTest], answers: str, *, yes: bool
) -> None:
    kind = replace(backends()["sim"], live=True)
    trials = [trial.model_copy(update={"test": "observer-gain"}) for trial in make_trials(2)]
    terminal = StringIO(answers)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdin", terminal)
    allow_motion(kind, trials, tests, yes=yes)
    assert terminal.read() == ""


def test_a_real_bench_is_asked_about_instability_first(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    test = unstable_test()
    asked(monkeypatch, [test], "yes\nyes\n", yes=False)
    told = capsys.readouterr().err
    assert (
        told.index("becomes unstable")
        < told.index("The bench will shake")
        < told.index("Is the bench")
    )
    assert "UNSTABLE" in told
    with pytest.raises(NotStartedError, match="nothing has moved"):
        asked(monkeypatch, [test], "no\n", yes=False)
    assert "Is the bench clear" not in capsys.readouterr().err
    asked(monkeypatch, [test], "", yes=True)
    assert "becomes unstable" in capsys.readouterr().err


def test_a_test_that_seeks_nothing_is_asked_about_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    asked(monkeypatch, [replace(unstable_test(), seeks_instability=False)], "yes\n", yes=False)
    assert "unstable" not in capsys.readouterr().err
