"""A person at the terminal confirms steps, or ends the run."""

from __future__ import annotations

from contextlib import nullcontext

import pytest

from campaign.cli.ask import AssumingOperator, ConsoleOperator
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
    assert (
        AssumingOperator().confirm(make_trials(1)[0], "x", lambda: False) == "assumed done (--yes)"
    )
