"""What is shown while a run goes on."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from campaign.archive.layout.header import RunHeader
from campaign.archive.reading.run_list import list_runs
from campaign.archive.writing.writer import RunWriter
from campaign.execution.display import PlainDisplay, counts, live_display, progress_display
from campaign.execution.progress import Ledger, Progress
from campaign.recording import Ending, Outcome
from campaign.text import clock
from tests.execution.fakes import COMPLETED, make_trials

NOW = "2026-11-21T09:37:00Z"
DIVERGED = Ending(Outcome.DIVERGED, "gyro_rate [rad/s] is infinite at 0.3 s")


@pytest.mark.parametrize(
    ("seconds", "text"), [(0, "0:00"), (59.6, "1:00"), (725, "12:05"), (11250, "3:07:30")]
)
def test_a_time_reads_like_a_clock(seconds: float, text: str):
    assert clock(seconds) == text


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_that_is_gone_does_not_end_the_run(terminal: bool):
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(5, "Input/output error")

        def flush(self) -> None:
            raise OSError(5, "Input/output error")

    console = Console(file=Gone(), force_terminal=terminal, width=80, _environ={"TERM": "xterm"})
    with progress_display(console) as display:
        run_three(display)


def run_three(display) -> None:
    trials = make_trials(3)
    ledger = Ledger(trials, display, {})
    for trial, ending in zip(trials, (COMPLETED, DIVERGED, COMPLETED), strict=True):
        ledger.begin(trial)
        ledger.end(trial, ending)


def test_without_a_terminal_there_are_plain_lines_only_when_there_is_news():
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=False, width=40)
    with progress_display(console) as display:
        assert isinstance(display, PlainDisplay)
        run_three(display)
    first, failure, last = stream.getvalue().splitlines()
    assert first == "test: 0 done, 3 left"
    assert failure == "trial-00002 test diverged: gyro_rate [rad/s] is infinite at 0.3 s"
    assert last == "test: 2 done, 1 failed, 0 left"


def test_tests_that_run_at_once_have_one_plain_line_each():
    stream = io.StringIO()
    with progress_display(Console(file=stream, force_terminal=False, width=40)) as display:
        trials = [
            trial.model_copy(update={"test": test})
            for trial, test in zip(make_trials(4), ("map", "ramp") * 2, strict=True)
        ]
        ledger = Ledger(trials, display, {})
        for trial in trials:
            ledger.begin(trial)
            ledger.end(trial, COMPLETED)
    assert [line.split(", ")[0] for line in stream.getvalue().splitlines()] == [
        "map: 0 done",
        "ramp: 1 done",
        "ramp: 4 done",
    ]


def test_trials_that_a_stop_interrupts_are_not_told_one_by_one():
    """The end of the run says how many they are, and who stopped it."""
    stream = io.StringIO()
    with progress_display(Console(file=stream, force_terminal=False, width=40)) as display:
        trials = make_trials(3)
        ledger = Ledger(trials, display, {})
        for trial in trials:
            ledger.begin(trial)
            ledger.end(trial, Ending(Outcome.INTERRUPTED, "stopped by the operator"))
    assert "stopped" not in stream.getvalue()


def test_the_live_line_counts_what_failed_as_the_list_of_runs_does(tmp_path):
    """One trial of each outcome; those that somebody stopped are counted apart."""
    told: list[Progress] = []
    trials = make_trials(len(Outcome))
    ledger = Ledger(trials, told.append, {})
    writer = RunWriter.create(tmp_path, RunHeader(name="run", created=NOW), trials)
    for trial, outcome in zip(trials, Outcome, strict=True):
        ending = Ending(outcome, "why")
        ledger.begin(trial)
        ledger.end(trial, ending)
        writer.begin(trial).finish(ending, NOW, NOW)
    (listed,) = list_runs(tmp_path)
    assert (told[-1].failed, told[-1].interrupted) == (listed.failed, listed.interrupted) == (3, 1)
    assert counts(told[-1]) == "1 done, 3 failed, 1 interrupted, 0 left"


def test_a_terminal_keeps_failures_above_the_live_line_and_reads_no_markup_in_them():
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=True, width=100, color_system=None)
    with live_display(console) as display:
        run_three(display)
    assert "gyro_rate [rad/s] is infinite" in stream.getvalue()
    assert "2 done, 1 failed, 0 left" in stream.getvalue()
