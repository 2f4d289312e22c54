"""Which cells without a number were tried in vain: by the places that a test executed."""

from __future__ import annotations

import pytest

from campaign.published.attempts import in_vain
from campaign.published.evidence import Evidence
from campaign.published.provenance import Provenance, SweepPoint
from campaign.published.scoreboard import score
from campaign.published.values import read_published
from campaign.result import Finding, Value

SWEEP = [
    SweepPoint(
        {"frequency": f, "compensation": c}, c, "", numbers={"acceleration": 0.3}, failed=lost
    )
    for f, c, lost in ((0.4, "none", False), (0.4, "lugre", True), (2.0, "none", False))
]
"""Without compensation at 0.4 and 2 Hz, with LuGre at 0.4 Hz, which failed."""


@pytest.mark.parametrize(
    ("conditions", "tried"),
    [
        ({"frequency": 0.4, "compensation": "lugre"}, True),
        ({"frequency": 0.4 * (1 + 1e-12), "compensation": "lugre"}, True),
        ({"compensation": "lugre"}, True),  # over all frequencies
        ({}, True),
        ({"frequency": 0.4, "compensation": "none"}, True),  # may be a ratio to the one that failed
        ({"frequency": 2.0, "compensation": "none"}, False),  # all that it needs completed
        ({"frequency": 2.0, "compensation": "lugre"}, False),
        ({"frequency": 0.8, "compensation": "lugre"}, False),
        ({"frequency": 0.4, "compensation": "observer"}, False),
        ({"frequency": 0.4, "compensation": "lugre", "acceleration": 0.6}, False),
        ({"frequency": 0.4, "compensation": "lugre", "acceleration": 0.3}, True),
        ({"frequency": 0.4, "parameter": "viscous_friction"}, True),
    ],
)
def test_numbers_and_words(conditions: dict[str, Value], tried: bool) -> None:
    assert in_vain(SWEEP, conditions) is tried


@pytest.mark.parametrize(
    ("direction", "tried"), [("positive", True), ("negative", True), ("nominal", True)]
)
def test_a_word_of_no_trial_may_stand_for_several(direction: str, tried: bool) -> None:
    places = [
        SweepPoint({"direction": "positive"}, "none", ""),
        SweepPoint({"direction": "negative"}, "none", "", failed=True),
    ]
    assert in_vain(places, {"direction": direction}) is tried
    assert not in_vain([places[0]], {"direction": direction}), "nothing failed"


PUBLISHED = read_published(
    """
source = "made up"
[[table]]
name = "1"
title = "Errors"
quantity = "error"
unit = "rad"
rows = { condition = "frequency", unit = "Hz" }
[table.column.simulated]
conditions = { domain = "simulation" }
[table.column.measured]
conditions = { domain = "hardware" }
[table.cells]
"0.4" = [1.0, 1.0]
"2.0" = [1.0, 1.0]
"5.0" = [1.0, 1.0]
""",
    "made-up.toml",
)


def verdicts(*findings: Finding, **more: object) -> list[str]:
    provenance = Provenance(tuple(SWEEP))
    known = {"domain": "hardware"}
    test = Evidence("t", ("1",), findings, known=known, provenance=provenance, **more)
    return [str(line.verdict) for line in score(PUBLISHED, [test]).lines]


def test_a_failed_trial_costs_its_own_cells() -> None:
    """And none of the column that another kind of bench would have to find."""
    assert verdicts() == ["not run", "not found", *["not run"] * 4]


def test_what_an_analysis_lost_costs_that_cell() -> None:
    lost = Finding("error", float("nan"), "rad", {"frequency": 2.0})
    assert verdicts(lost) == ["not run", "not found", "not run", "not found", "not run", "not run"]


def test_what_nobody_can_tell_costs_all() -> None:
    assert verdicts(failed=True) == ["not run", "not found"] * 3
