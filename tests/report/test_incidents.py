"""What happened besides the plan is told from the journal and the trials, and only then."""

from __future__ import annotations

import math
from dataclasses import replace
from types import ModuleType

import numpy as np

from campaign.archive.layout.journal import (
    Decision,
    OperatorStep,
    TrialFinished,
    TrialRefused,
    TrialsFollowed,
)
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError
from campaign.recording import Channel, Ending, Fault, Outcome, Recording, SafeState
from campaign.report.build import render
from campaign.report.content.drift import drift_table, drifts_of
from campaign.report.content.incidents import Incidents, incidents
from campaign.report.content.low_margins import low_margin_table
from campaign.report.content.tables import table_csv
from campaign.trial import Role


class InMemory(ArchivedTrial):
    """A trial whose current is a sine of amplitude 1 + number / 100."""

    def recording(self) -> Recording:
        time = np.arange(0, self.trial.task.duration, 1e-3)
        current = (1 + self.trial.number / 100) * np.sin(2 * np.pi * 10 * time)
        channel = Channel("motor_current", "A", "Motor current", "A", current)
        return Recording(time, {"motor_current": channel})


def of(run: RunReader, number: int, role: Role, ending: Ending) -> ArchivedTrial:
    like = run.trials[0]
    task = like.trial.task.model_copy(update={"window": (0.0, like.trial.task.duration)})
    task = type(task).model_validate({**task.model_dump(), "base_acceleration": {"shape": "zero"}})
    trial = like.trial.model_copy(update={"number": number, "role": role, "task": task})
    return InMemory(trial, ending, "", "", like.path, "", like.samples)


class Damaged(InMemory):
    """A trial of which a sample fails its checksum."""

    def recording(self) -> Recording:
        raise ArchiveError(f"{self.path}: /{self.trial.name}/data/motor_current: is damaged")


def lines_of(found: Incidents, key: str) -> list[str]:
    """A table of them as its CSV file has it, header first."""
    return table_csv(next(table for table in found.tables if table.key == key)).splitlines()


def test_a_plain_run_has_nothing_to_say(made_up: ModuleType, tmp_path: object) -> None:
    assert not incidents(made_up.made_up_run(tmp_path))


def test_the_journal_and_the_faults(made_up: ModuleType, tmp_path: object) -> None:
    run = made_up.made_up_run(tmp_path)
    lines = [
        Decision(at="2026-11-21T10:00:00Z", trial=3, decision="retry", reason="over-temperature"),
        OperatorStep(at="2026-11-21T10:01:00Z", trial=4, step="Preload it", answer="done"),
    ]
    hot = Ending(Outcome.FAULT, "hot", fault=Fault.DRIVE, telemetry={"ring": {"fill_max": 7}})
    journal = "".join(line.model_dump_json() + "\n" for line in lines)
    run = replace(
        run, story=read_lines(journal.encode()), trials=(of(run, 9, Role.MEASUREMENT, hot),)
    )
    found = incidents(run)
    titles = [table.title for table in found.tables]
    assert titles == ["What the run decided", "What was done by hand", titles[2]]
    assert "retry" in lines_of(found, "decisions")[1]
    assert "Preload it" in lines_of(found, "operator-steps")[1]
    assert "drive" in lines_of(found, "faults")[1]
    assert "7" in lines_of(found, "faults")[1]


def test_stages_are_told_with_what_was_refused_and_why(made_up: ModuleType, tmp_path: object):
    run = made_up.made_up_run(tmp_path)
    refused = (TrialRefused(label="sea [speed=9]", why="too fast"),)
    at, point = "2026-11-21T10:00:00Z", {"compensation": "none"}
    lines = [
        TrialsFollowed(at=at, test="sea", stage=2, name="more", point=point, refused=refused),
        TrialsFollowed(at=at, test="sea", stage=3, name="again", reason="ValueError: no slope"),
    ]
    journal = "".join(line.model_dump_json() + "\n" for line in lines)
    found = incidents(replace(run, story=read_lines((run.journal + journal).encode())))
    _, first, second = lines_of(found, "stages")
    assert "sea at compensation = none, stage 2 (more)" in first
    assert "sea [speed=9]: too fast" in first
    assert "ValueError: no slope" in second


def test_a_damaged_check_is_left_out_of_the_drift_and_told(
    made_up: ModuleType, tmp_path: object
) -> None:
    run = made_up.made_up_run(tmp_path)
    done = Ending(Outcome.COMPLETED)
    roles = {1: Role.MEASUREMENT, 21: Role.CHECK, 42: Role.CHECK}
    trials = [of(run, n, role, done) for n, role in roles.items()]
    bad = trials[1]
    trials[1] = Damaged(bad.trial, bad.ending, "", "", run.path, "", bad.samples)
    run = replace(run, trials=tuple(trials))
    (drift,), problems, damaged = drifts_of(run)
    assert [trial.trial.number for trial in drift.trials] == [1, 42]
    assert not problems
    assert [damage.trial for damage in damaged] == ["trial-00021"]
    found = incidents(run)
    assert found.damaged == tuple(damaged)
    page, _, report = render(run, run.path, {}, made_up.TEMPLATES)  # no analysis reads it
    assert report.damaged == tuple(damaged)
    assert "(trial-00021)" in page


def test_the_drift_of_the_checks(made_up: ModuleType, tmp_path: object) -> None:
    run = made_up.made_up_run(tmp_path)
    done = Ending(Outcome.COMPLETED)
    roles = {1: Role.MEASUREMENT, 21: Role.CHECK, 42: Role.CHECK}
    run = replace(run, trials=tuple(of(run, n, role, done) for n, role in roles.items()))
    (drift,), problems, damaged = drifts_of(run)
    assert not problems
    assert not damaged
    rows = drift_table(drift).rows
    assert [row["trial"] for row in rows] == [1, 21, 42]
    assert math.isclose(float(rows[0]["rms"]), 1.01 / math.sqrt(2), rel_tol=1e-2)
    changes = [float(row["change"]) for row in rows]
    assert np.allclose(changes, [0, 1.21 / 1.01 - 1, 1.42 / 1.01 - 1], rtol=1e-6)
    found = incidents(run)
    assert len(found.figures) == len(found.tables) == 1


def with_gain(run: RunReader, factor: float) -> RunReader:
    """The run as if its rate controller's gain had been `factor` times what it was."""
    from campaign.experiments.interface import bench_of

    trials = []
    for item in run.trials:
        bench = bench_of(item.trial).model_dump(mode="json")
        bench["controller"]["rate"]["proportional"] *= factor
        trials.append(replace(item, trial=item.trial.model_copy(update={"bench": bench})))
    return replace(run, trials=tuple(trials))


def on_platform(made_up: ModuleType, folder: object) -> RunReader:
    from campaign.protocol.bench_file import load_bench

    return made_up.made_up_run(folder, bench=load_bench("platform"))


def test_loops_with_little_margin_are_told(made_up: ModuleType, tmp_path: object) -> None:
    """30.8 dB: 26 times the gain leaves 2.5 dB, 57.3 times is unstable, and once is fine."""
    run = on_platform(made_up, tmp_path)
    assert not low_margin_table(run)[0].rows
    table, problems = low_margin_table(with_gain(run, 26.0))
    assert not problems
    assert {row["state"] for row in table.rows} == {"low margin"}
    assert all(2.0 < float(str(row["gain"])) < 3.0 for row in table.rows)
    rows = lines_of(incidents(with_gain(run, 57.3)), "low-margins")[1:]
    assert rows
    assert all("unstable" in row for row in rows)


def test_a_bench_that_cannot_be_read_is_a_problem_and_no_more(
    made_up: ModuleType, tmp_path: object
) -> None:
    run = made_up.made_up_run(tmp_path)
    broken = run.trials[0].trial.model_copy(update={"bench": {"name": "of a later version"}})
    run = replace(run, trials=(replace(run.trials[0], trial=broken), *run.trials[1:]))
    table, problems = low_margin_table(run)
    assert not table.rows
    assert problems[0].startswith("the loops of ")


def test_every_number_of_an_incident_has_an_interval_or_says_why_not(
    made_up: ModuleType, tmp_path: object
) -> None:
    hot = Ending(Outcome.FAULT, "hot", fault=Fault.DRIVE, telemetry={"ring": {"fill_max": 7}})
    run = with_gain(on_platform(made_up, tmp_path), 26.0)
    checks = [of(run, n, Role.CHECK, Ending(Outcome.COMPLETED)) for n in (21, 42)]
    attempts = [finished(1, attempt) for attempt in (1, 2)]
    lines = [Decision(at="2026-11-21T10:00:00Z", trial=3, decision="retry", reason="hot")]
    lines += [OperatorStep(at="2026-11-21T10:01:00Z", trial=4, step="Preload it", answer="done")]
    journal = "".join(line.model_dump_json() + "\n" for line in (*lines, *attempts))
    trials = (*run.trials, *checks, of(run, 9, Role.MEASUREMENT, hot))
    tables = incidents(replace(run, story=read_lines(journal.encode()), trials=trials)).tables
    assert {table.key.partition("-")[0] for table in tables} == {
        "decisions",
        "operator",
        "attempts",
        "faults",
        "low",
        "drift",
    }
    for table in tables:
        for column in table.columns:
            cells = [row.get(column.name) for row in table.rows]
            numbers = [c for c in cells if isinstance(c, int | float) and not isinstance(c, bool)]
            assert not numbers or column.exact or column.reason, (table.key, column.name)


def finished(trial: int, attempt: int) -> TrialFinished:
    return TrialFinished(
        at="2026-11-21T10:00:00Z",
        trial=trial,
        attempt=attempt,
        file=f"trial-0000{trial}.nxs",
        sha256="0" * 64,
        record="1" * 64,
        bytes=1,
        outcome=Outcome.COMPLETED,
        reason="",
        safe_state=SafeState.CONFIRMED,
    )
