"""What an experiment warns of is part of the plan, each line once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import pytest

from campaign.errors import ProtocolError
from campaign.protocol import as_tree, make_plan
from tests.protocol.conftest import KINDS, Desk
from tests.protocol.test_stages import SWING


@pytest.fixture
def warning(monkeypatch: pytest.MonkeyPatch):
    def use(warnings: Callable[..., Iterable[str]]) -> None:
        monkeypatch.setitem(KINDS, "swing", replace(KINDS["swing"], warnings=warnings))

    return use


def test_what_points_say_alike_is_told_once(desk: Desk, warning) -> None:
    warning(lambda options, bench: ["swing more", f"{options.cycles} cycles"])
    (test,) = (plan := make_plan(desk.load(SWING))).tests
    assert test.warnings == ("swing more", "1 cycles", "2 cycles", "3 cycles")
    assert as_tree(plan)["tests"][0]["warnings"] == list(test.warnings)


def test_options_that_it_refuses_are_the_protocols_error(desk: Desk, warning) -> None:
    def refuse(options, bench):
        yield "first"
        raise ValueError("these do not go together")

    warning(refuse)
    with pytest.raises(ProtocolError, match=r"cycles = 1: these do not go together"):
        make_plan(desk.load(SWING))


def test_an_experiment_needs_none(desk: Desk) -> None:
    assert make_plan(desk.load(SWING)).tests[0].warnings == ()
