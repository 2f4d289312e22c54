"""What a calibration's file says of reproduced numbers; t quantiles from printed tables."""

from __future__ import annotations

import pytest

from campaign.published.calibration_covariance import NOTHING, calibration_part, file_name
from campaign.published.evidence import Evidence
from campaign.published.provenance import Provenance, SweepPoint
from campaign.published.scoreboard import Line, score
from campaign.published.values import read_published
from campaign.result import Finding

FILE = """
protocol = "c.toml"
[propagation]
protocol = "thesis.toml"
fingerprint = "0123456789abcdef"
freedom = 23
lost = ["A.1/three/error"]
[propagation.standard_uncertainty]
"A.1/one/error" = 0.1
"""
PUBLISHED = read_published(
    """
source = "made up"
[[table]]
name = "A.1"
title = "Errors"
quantity = "error"
unit = "mrad"
decimals = 1
rows = { condition = "which" }
column.error = {}
[table.cells]
one = [1.0]
two = [2.0]
three = [3.0]
""",
    "made-up.toml",
)


def part(**sources: str) -> object:
    return calibration_part({f"benches/calibration/{k}.toml": v for k, v in sources.items()}, KEY)


KEY = "0123456789abcdef"


def lines(altered: str = "") -> dict[str, Line]:
    """Three numbers of 1.15 times what is printed."""
    findings = [
        Finding("error", 1.15e-3 * n, "rad", {"which": which})
        for n, which in enumerate(("one", "two", "three"), 1)
    ]
    provenance = Provenance((SweepPoint({}, "none", altered),))
    known = calibration_part({"calibration/b.toml": FILE}, KEY)
    test = Evidence("t", ("A.1",), findings, provenance=provenance, calibration=known)
    return {line.cell.row: line for line in score(PUBLISHED, [test]).lines}


def test_a_bench_finds_its_own_calibration() -> None:
    assert file_name("benches/platform.toml") == "benches/calibration/platform.toml"
    known = calibration_part({"benches/calibration/b.toml": FILE}, KEY)
    assert known.half_width("A.1/one/error") == pytest.approx(0.2069, abs=5e-5)  # t(23) = 2.069
    assert known.half_width("A.1/two/error") is None
    for other in ("", "fedcba9876543210"):
        assert calibration_part({"benches/calibration/b.toml": FILE}, other) is NOTHING
    assert calibration_part({"benches/b.toml": FILE}, KEY) is NOTHING, "no calibration by its place"


@pytest.mark.parametrize("text", ["protocol = 'of an earlier version'", "no TOML", "propagation=1"])
def test_a_file_that_says_nothing_is_passed_over(text: str) -> None:
    assert part(a=text) is NOTHING
    assert part(a=text, b=FILE) is not NOTHING


def test_verdicts_rest_on_it() -> None:
    """1.15 +- 0.207 holds the printed 1.0, and is wider than 10 % of it."""
    found = lines()
    assert {row: line.verdict for row, line in found.items()} == {
        "one": "undecided",
        "two": "differs",
        "three": "undecided",
    }
    assert found["three"].deviation is None, "nobody knows whether it can be found"


def test_a_bench_that_is_altered_has_no_calibration() -> None:
    found = lines("it was changed")
    assert {line.verdict for line in found.values()} == {"differs"}
    assert all(line.found is not None and line.found.low is None for line in found.values())
