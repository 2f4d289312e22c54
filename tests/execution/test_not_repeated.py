"""Which trials a resume does not execute again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from campaign.archive.layout.journal import Decision, TrialFinished
from campaign.execution.resume import not_repeated
from campaign.recording import Outcome, SafeState

SKIP, RETRY = "skip", "retry"


def decision(word: str) -> Decision:
    return Decision(at="2026-12-01T00:00:00Z", decision=word, reason="", trial=1)


def finished() -> TrialFinished:
    return TrialFinished(
        at="2026-12-01T00:00:00Z",
        trial=1,
        attempt=1,
        file="trial-00001.trial",
        sha256="0" * 64,
        record="0" * 64,
        bytes=1,
        outcome=Outcome.FAULT,
        reason="",
        safe_state=SafeState.CONFIRMED,
    )


@pytest.mark.parametrize(
    ("story", "is_settled"),
    [
        ([finished()], False),  # the fault ended the run
        ([finished(), decision(RETRY)], False),
        ([finished(), decision(SKIP)], True),
        ([finished(), decision(RETRY), finished(), decision(SKIP)], True),
        # Its file was damaged, it was executed again, and the run was killed before the decision.
        ([finished(), decision(SKIP), finished()], False),
    ],
)
def test_a_fault_is_settled_by_a_skip_of_the_last_attempt(
    story: list[Any], is_settled: bool
) -> None:
    trial = SimpleNamespace(
        trial=SimpleNamespace(number=1), ending=SimpleNamespace(outcome=Outcome.FAULT)
    )
    run = SimpleNamespace(trials=[trial], story=SimpleNamespace(entries=story))
    assert bool(not_repeated(cast("Any", run))) is is_settled
