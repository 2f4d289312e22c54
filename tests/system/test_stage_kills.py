"""A run with stages that is killed in any gap of its journal goes on to the same end."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.verification.verify_run import verify_run
from tests.archive.test_resuming import content, documented_differences
from tests.system.user import environment, forks, write

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")

PROTOCOL = """\
[[test]]
name = "sweep"
kind = "frequency_response"
bench = "simulink"
seed = 5
frequencies = ["5 Hz", "8 Hz", "12 Hz", "18 Hz", "30 Hz"]
cycles = 2
settle_cycles = 1
settle_time = "0 s"
refine = true

[test.matrix]
compensation = ["none", "lugre"]
"""
MAP = """\
[[test]]
name = "map"
kind = "velocity_map"
bench = "simulink"
seed = 6
pilot = true
points = 20
slowest = "0.2 deg/s"
fastest = "20 deg/s"
max_time = "8 s"
settle_angle = "0.75 deg"
sample_rate = "100 Hz"
warm_up_cycles = 0
"""
"""A pilot of ten trials and the ten that follow."""
PILOT, MAP_LINES = 21, 42
"""Which line of its journal tells of the stage, and which of the end; every trial has two lines."""
PLANNED, FOLLOWING = 10, 28
LINES = 2 * (PLANNED + FOLLOWING) + 3
"""of the journal after its first: every trial as finished and as measured, two stages, the end."""
STAGES = (11, 50)
"""Which of them tell of the stages: each follows its point's five trials."""


class Nursery:
    """Lives of the program in one folder."""

    def __init__(self, folder: Path, protocol: str = PROTOCOL) -> None:
        self.folder = folder
        write(folder, protocol)
        assert self.live("run protocol.toml --results whole") == 0
        self.whole = content(find_run(folder / "whole"))
        whole = open_run(find_run(folder / "whole"))
        self.fingerprints = [trial.fingerprint for trial in whole.plan]
        self.points = [stage.point for stage in whole.stages]

    def live(self, arguments: str, where: str = "never", number: int = 0) -> int:
        """The exit code of a command, or -9 when it was killed."""
        variables = environment()
        if number:
            variables |= {"BEFORE_THE_COMMAND": "tests.system.dying", "DIES": f"{where} {number}"}
        words = [*arguments.split(), "--workers", "1"]
        return forks().run(self.folder, *words, environment=variables).returncode

    def goes_on(self, results: str, where: str, number: int, again: int = 0) -> None:
        """Killed at a line, gone on with (and killed at line `again` of that), and compared."""
        assert self.live(f"run protocol.toml --results {results}", where, number) == -9
        killed = open_run(find_run(self.folder / results))
        assert killed.damaged == ()
        assert [trial.fingerprint for trial in killed.plan] == self.fingerprints[: len(killed.plan)]
        resume = f"resume {killed.name} --results {results}"
        if again:
            self.live(resume, "after", again)
        if find_run(self.folder / results).is_dir():
            assert self.live(resume) == 0
        path = find_run(self.folder / results)
        run = open_run(path)
        assert (run.status, len(run.plan)) == (RunStatus.COMPLETE, len(self.fingerprints))
        assert [trial.fingerprint for trial in run.plan] == self.fingerprints
        assert verify_run(path).problems == ()
        assert [stage.point for stage in run.stages] == self.points
        ours, missing = content(path), object()
        differing = {
            name
            for name in ours.keys() | self.whole.keys()
            if (mine := ours.get(name, missing)) != (theirs := self.whole.get(name, missing))
            and str(mine) != str(theirs)  # not a number is not itself
        }
        allowed = documented_differences()
        drawn = {"/run/provenance/seed", "/run/provenance/seed@sha256"}  # the test has its own
        assert {name for name in differing - drawn if not allowed.fullmatch(name)} == set()


@pytest.fixture(scope="module")
def nursery(tmp_path_factory: pytest.TempPathFactory) -> Nursery:
    return Nursery(tmp_path_factory.mktemp("kills"))


@pytest.fixture(scope="module")
def of_a_map(tmp_path_factory: pytest.TempPathFactory) -> Nursery:
    return Nursery(tmp_path_factory.mktemp("maps"), MAP)


@pytest.mark.slow
def test_the_journal_has_the_lines_that_are_killed_here(nursery: Nursery):
    run = open_run(find_run(nursery.folder / "whole"))
    lines = run.journal.splitlines()[1:]
    assert len(lines) == LINES
    told = [n for n, line in enumerate(lines, start=1) if "trials followed" in line]
    assert tuple(told) == STAGES
    assert nursery.points == [{"compensation": "none"}, {"compensation": "lugre"}]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "number"),
    [
        ("torn", STAGES[0]),  # asked, and not journalled
        ("after", STAGES[0]),  # journalled, and none executed
        ("after", STAGES[0] + 3),  # between a trial and what was measured of it
        ("after", STAGES[0] + 4),  # between its trials
    ],
)
def test_a_kill_in_a_gap_around_a_stage_changes_nothing(nursery: Nursery, where: str, number: int):
    nursery.goes_on(f"{where}-{number}", where, number)


@pytest.mark.slow
def test_a_stage_that_is_journalled_is_not_asked_again(nursery: Nursery):
    assert nursery.live("run protocol.toml --results once", "after", STAGES[0]) == -9
    run = open_run(find_run(nursery.folder / "once"))
    assert nursery.live(f"resume {run.name} --results once") == 0
    run = open_run(find_run(nursery.folder / "once"))
    assert run.journal.count("trials followed") == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("where", "number"), [("torn", PILOT), ("after", PILOT), ("after", PILOT + 5)]
)
def test_a_kill_around_a_pilots_stage_changes_nothing(of_a_map: Nursery, where: str, number: int):
    run = open_run(find_run(of_a_map.folder / "whole"))
    lines = run.journal.splitlines()[1:]
    assert (len(of_a_map.fingerprints), len(lines)) == (20, MAP_LINES)
    assert "trials followed" in lines[PILOT - 1]
    of_a_map.goes_on(f"{where}-{number}", where, number)


@pytest.mark.soak
@pytest.mark.parametrize("where", ["before", "torn", "after"])
def test_a_kill_in_any_gap_of_a_map_changes_nothing(of_a_map: Nursery, where: str):
    for number in range(1, MAP_LINES + 1):
        of_a_map.goes_on(f"all-{where}-{number}", where, number)


@pytest.mark.soak
@pytest.mark.parametrize("where", ["before", "torn", "after"])
def test_a_kill_in_any_gap_changes_nothing(nursery: Nursery, where: str):
    for number in range(1, LINES + 1):
        nursery.goes_on(f"all-{where}-{number}", where, number)


@pytest.mark.soak
def test_a_second_kill_while_it_is_gone_on_with_changes_nothing(nursery: Nursery):
    for number in (STAGES[0] - 1, STAGES[0], STAGES[1] - 1):
        for again in range(1, 8):
            nursery.goes_on(f"twice-{number}-{again}", "after", number, again)
