"""`campaign run --profile`: all of a run's work is told, and only there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from campaign.cli.profile import REST
from campaign.stopwatch import Work
from tests.system.user import SEA, campaign, write

ROW = re.compile(r"^  (.+?) +(\d+\.\d\d) s +(\d+)% +(\d+\.\d\d) s$", re.MULTILINE)


@pytest.mark.slow
def test_a_run_with_profile_tells_where_its_time_went(tmp_path: Path) -> None:
    write(tmp_path, SEA)
    done = campaign(tmp_path, "run", "protocol.toml", "--profile", "--report", "--workers", "2")
    found = {name: (float(clock), float(used)) for name, clock, _, used in ROW.findall(done.err)}
    assert [*found] == [*Work, REST, "all, with 2 workers"]
    whole = found.pop("all, with 2 workers")
    parts = list(found.values())
    assert abs(sum(clock for clock, _ in parts) - whole[0]) < 0.01 * len(parts)
    assert abs(sum(used for _, used in parts) - whole[1]) < 0.01 * len(parts)
    simulating = found[Work.ENGINE][1] + found[Work.SETTING_UP][1]
    assert simulating > 0.0
    assert done.out.count("\n") == 1, "standard output has the archive's path and nothing else"


def test_a_run_without_it_says_nothing_of_the_kind(tmp_path: Path) -> None:
    write(tmp_path, SEA)
    done = campaign(tmp_path, "run", "protocol.toml")
    assert "where the time went" not in done.err
