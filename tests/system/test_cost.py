"""What a plan says of the steps of its tests: those of each one's own trials."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.backends.sim import SimBackend, SimOptions
from campaign.cli.plan import costs
from tests.archives import PROTOCOL, plan_of

TWO = f"""{PROTOCOL}
[[test]]
name = "faster"
kind = "stabilization"
bench = "simulink"
frequency = "4 Hz"
acceleration = "18 deg/s^2"
settle_cycles = 1
cycles = 3
compensation = "lugre"
"""


def test_steps_are_counted_test_by_test(tmp_path: Path) -> None:
    plan, backend = plan_of(tmp_path, TWO), SimBackend(SimOptions())
    found = costs(backend, plan)
    assert list(found) == ["stabilization", "faster"]
    for name, cost in found.items():
        own = [trial for trial in plan.trials if trial.test == name]
        each = [backend.cost(trial) for trial in own]
        assert cost.steps == sum(one.steps for one in each)
        assert (cost.shortest, cost.longest) == (
            min(one.step for one in each),
            max(one.step for one in each),
        )
        seconds = sum(trial.task.duration for trial in own)
        assert cost.of_milliseconds == pytest.approx(1e-3 * cost.steps / seconds, rel=1e-3)
    assert found["stabilization"].steps != found["faster"].steps
