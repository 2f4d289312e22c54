"""Patterns of a bench that mean no cell, and paths that lead nowhere, where they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from campaign.errors import ProtocolError
from campaign.protocol.bench_file import load_bench

GOOD = """\
[[test]]
name = "t"
kind = "swing"
bench = "own.toml"
frequency = "1 Hz"
"""
DOCUMENT = """
source = "ours"
[[table]]
name = "A.1"
title = "Ours"
quantity = "error"
column.value = {}
[table.cells]
x = [1]
"""


@pytest.fixture
def known(desk, simulink: str):
    """Writes a bench that has these lines under [known]."""

    def write(*lines: str) -> Path:
        plain = re.sub(r"\[known\]\n(?:[a-z]+ = .*\n)+", "", simulink)
        assert "[known]" not in plain
        return desk.write("own.toml", "\n".join((plain, "[known]", *lines, "")))

    return write


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (('document = "thesis"', 'fitted = ["5.10", §"5.99"]'), "'5.99' is no cell of 'thesis'"),
        (('document = "thesis"', 'given = [§"5.11/*/lugra"]'), r"did you mean '5.11/.*/lugre'\?"),
        (('document = "thesis"', 'seen = [§"4.1/1/motor/x"]'), "is no cell of 'thesis'"),
        (('document = §"wrong.toml"', 'seen = ["5.1"]'), "wrong.toml: source: Field required"),
        (('document = "ours.toml"', 'seen = ["A.1/*/value", §"A.2"]'), "did you mean 'A.1'"),
        (('operating = [§"gear.preload.torque"]',), "no number at 'gear.preload.torque'"),
        (("values = { §'axis.mass' = {} }",), "no number at 'axis.mass'"),
        (
            ('values = { "axis.inertia" = { interval = ["1 kg m^2", §"3 m"] } }',),
            "'m' is not a unit of moment of inertia",
        ),
    ],
)
def test_where_it_stands(desk, known, lines: tuple[str, ...], message: str) -> None:
    desk.write("ours.toml", DOCUMENT)
    desk.write("wrong.toml", "")
    known(*lines)
    (problem,) = desk.problems(GOOD)
    assert re.search(message, problem.message)


def test_a_document_that_is_not_at_hand_is_missed_by_who_looks_at_the_bench(desk, known) -> None:
    """A bench travels without it, and can be used."""
    path = known('document = "none.toml"', 'fitted = ["Z.9"]')
    assert desk.load(GOOD)
    with pytest.raises(ProtocolError, match=r"'none\.toml': no such file \(looked for"):
        load_bench(str(path))


def test_a_bench_that_names_no_document_may_mean_any(desk, known) -> None:
    known('fitted = ["Z.9"]')
    assert desk.load(GOOD)
