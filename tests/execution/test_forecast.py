"""How long a run will still take: told late enough to be within a factor of two."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.execution.forecast import PER_TRIAL, SURE_AFTER, SURE_SHARE, Forecast, worth
from campaign.execution.progress import Ledger
from campaign.recording import Ending, Outcome
from tests.execution.fakes import make_trials


def told(signs: list[tuple[float, float]], whole: float) -> list[tuple[float, float]]:
    """When something was forecast, and what: from (clock, what was done by then)."""
    forecast = Forecast()
    found = [(now, forecast.time_left(now, done, whole - done)) for now, done in signs]
    return [(now, left) for now, left in found if left is not None]


def test_what_came_before_the_first_work_is_no_pace() -> None:
    """27 s of compiling, then 30 trials a second: the first forecast is right, not 27 minutes."""
    signs = [(27.0 + k / 30, float(k)) for k in range(1, 1000)]
    found = told(signs, 1000.0)
    end = 27.0 + 1000 / 30
    now, left = found[0]
    assert now - 27.0 <= SURE_AFTER + 0.1
    assert left == pytest.approx(end - now, rel=1e-6)
    assert all(0.5 * (end - now) < left < 2.0 * (end - now) for now, left in found)


def test_nothing_is_forecast_from_next_to_nothing() -> None:
    assert not told([(0.0, 0.0), (1.0, 0.0), (1.5, 1.0)], 1000.0)  # one sign of work
    assert not told([(1.0, 1.0), (1.0 + 0.9 * SURE_AFTER, 2.0)], 1000.0)
    assert told([(1.0, 1.0), (1.0 + 1.1 * SURE_AFTER, 2.0)], 1000.0)
    assert told([(1.0, 1.0), (1.1, 1.1 + 1000.0 * SURE_SHARE)], 1000.0)  # a short run


def test_short_trials_that_are_computed_cost_as_much_as_long_ones_nearly() -> None:
    short, long = make_trials(1, duration=1.0)[0], make_trials(1, duration=40.0)[0]
    assert worth(long, computed=False) == 40.0 * worth(short, computed=False)
    assert worth(long, computed=True) - worth(short, computed=True) == 39.0
    assert worth(short, computed=True) == 1.0 + PER_TRIAL


def read_from_files(number: int, duration: float, rate: float):
    trial = make_trials(1, duration=duration)[0]
    task = trial.task.model_copy(update={"duration": duration, "sample_rate": rate})
    told = {"channels": [{"name": "a"}, {"name": "b"}]}
    return trial.model_copy(update={"number": number, "task": task, "recording": told})


def test_what_is_read_from_files_is_worth_its_bytes_not_the_time_that_it_once_took() -> None:
    """A minute at 10 kHz and a week at 1 Hz are as many bytes: one read is half of the whole."""
    quick, slow = read_from_files(1, 60.0, 10_000.0), read_from_files(2, 600_000.0, 1.0)
    assert worth(quick, computed=False) == worth(slow, computed=False) == 600_000 * 2 * 8


def test_a_file_that_is_looked_through_for_seconds_makes_no_forecast_of_days(monkeypatch) -> None:
    """23 s of import: little comes of a short file, then a long one is opened for 10 s."""
    clock = 0.0
    monkeypatch.setattr("time.monotonic", lambda: clock)
    shown: list[float | None] = []
    short, long = read_from_files(1, 0.5, 1000.0), read_from_files(2, 600_000.0, 10.0)
    ledger = Ledger([short, long], lambda progress: shown.append(progress.time_left), {})
    ledger.begin(short)
    ledger.reached(short, (), short.task.duration * np.ones(1), np.ones((2, 1)))
    ledger.look()
    ledger.end(short, Ending(Outcome.COMPLETED))
    ledger.begin(long)
    clock = 10.0
    for step in range(1, 101):
        clock += 0.13
        ledger.reached(long, (), np.array([6000.0 * step]), np.ones((2, 1)))
        ledger.look()
    told = [each for each in shown if each is not None]
    assert told
    assert max(told) < 5 * 10.0 + 13.0
