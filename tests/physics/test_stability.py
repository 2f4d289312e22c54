"""Stability of the linear loop: closed forms, and growth or decay in the simulation itself."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.experiments.observer_gain.experiment import predicted_limit
from campaign.physics.bench import Bench
from campaign.physics.stability import growth_rate
from campaign.signals import Sine
from tests.physics.benches import INERTIA, RATIO, bench, run, task


def linear(corner: float = 2.0, **controller: object) -> Bench:
    """The simulink bench without friction, with an observer of a corner frequency (Hz)."""

    def edit(tree):
        tree["friction"] = {}
        gain = 2 * np.pi * corner * INERTIA / RATIO
        tree["compensation"] = {"observer": {"gain": f"{gain} N m s/rad"}}
        tree["controller"] |= controller

    return bench(edit)


def test_the_slowest_mode_of_the_observer_is_its_integral() -> None:
    """(J s^2 + Gp s + Gi)(s + a): the observer's own pole -a is the loop's slowest below 1 Hz."""
    for corner in (0.1, 0.5):
        assert growth_rate(linear(corner), "observer") == pytest.approx(
            -2 * np.pi * corner, rel=0.02
        )


def test_a_loop_that_is_too_late_is_unstable() -> None:
    """Bandwidth near 60 rad/s: with 5 ms of delay it lives, with 100 ms it cannot."""
    assert growth_rate(linear(sample_rate="1 kHz", delay="5 ms"), "none") < 0
    assert growth_rate(linear(sample_rate="1 kHz", delay="100 ms"), "none") > 0


@pytest.mark.parametrize("gyro_delay", ["0 s", "2 ms"])
def test_the_limit_of_the_gain_is_where_the_simulation_begins_to_grow(gyro_delay: str) -> None:
    """5 % below the predicted limit a knock dies away, 5 % above it grows."""

    def at(corner: float) -> Bench:
        on = linear(corner, sample_rate="1 kHz", delay="1 ms")
        tree = on.model_dump(mode="json")
        tree["sensors"]["gyro"]["delay"] = float(gyro_delay.split()[0]) * 1e-3
        return Bench.model_validate(tree, context={"si": True})

    limit = predicted_limit(at(2.0), "observer", 400.0)
    knock = Sine(amplitude=1.0, frequency=20.0)
    for factor, grows in ((0.95, False), (1.05, True)):
        on = at(factor * limit)
        assert (growth_rate(on, "observer") > 0) is grows
        _, out = run(on, task(compensation="observer", disturbance=knock, duration=1.0))
        rate = np.abs(out["load_rate"])
        assert bool(rate[-200:].max() > 3 * rate[200:400].max()) is grows


def test_what_is_not_sampled_has_no_limit() -> None:
    assert predicted_limit(linear(), "observer", 2000.0) is None
