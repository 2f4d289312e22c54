"""How long a run will still take: told late enough to be within a factor of two."""

from __future__ import annotations

import pytest

from campaign.execution.forecast import PER_TRIAL, SURE_AFTER, SURE_SHARE, Forecast, worth
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
