"""Sound recordings are not refused: noise, rest, sticking, coarse sensors, runs of the program."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.importing.defects import Defect, find
from campaign.resources import protocols_folder
from tests.archives import simulated_run
from tests.importing import rig
from tests.importing.rig import Motion, rounded

SEEDS = range(5)
MOTIONS = {
    "sines": rig.sines,
    "trapezoids": rig.trapezoids,
    "standstill": rig.standstill,
    "stick-slip": rig.stick_slip,
}


def channels(motion: Motion) -> dict[str, np.ndarray]:
    return {
        "relative_angle": motion.q,
        "relative_rate": motion.v,
        "drive_torque": motion.tau,
        "motor_current": motion.i,
    }


def wrong(found: tuple[Defect, ...]) -> list[str]:
    return [each.what for each in found if not each.noted]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", MOTIONS)
def test_nothing_is_wrong_with_a_sound_recording(kind, seed):
    motion = MOTIONS[kind](seed)
    assert wrong(find(motion.t, channels(motion))) == []


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("step", [1e-5, 1e-3, 2 * np.pi / 4096])
@pytest.mark.parametrize("kind", MOTIONS)
def test_coarse_sensors_are_no_defect(kind, step, seed):
    motion = MOTIONS[kind](seed, rate=500.0)
    coarse = channels(motion)
    coarse["relative_angle"] = rounded(motion.q, step)
    coarse["relative_rate"] = rounded(motion.v, 0.229 * np.pi / 30)
    coarse["drive_torque"] = rounded(motion.tau, 0.05)
    coarse["motor_current"] = rounded(motion.i, 2.69e-3)
    assert wrong(find(motion.t, coarse)) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_rates_that_a_controller_derives_are_no_defect(seed):
    """Differences of a quantised angle, low-passed: zero most of the time, or late."""
    motion = rig.trapezoids(seed)
    own = channels(motion)
    own["relative_angle"] = rounded(motion.q, 1e-4)
    raw = np.diff(own["relative_angle"], prepend=0.0) * 1000
    own["relative_rate"] = raw
    assert wrong(find(motion.t, own)) == []
    late = raw.copy()
    for k in range(1, len(late)):
        late[k] = late[k - 1] + 0.1 * (raw[k] - late[k - 1])
    own["relative_rate"] = late
    assert wrong(find(motion.t, own)) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_a_filter_that_runs_out_between_counts_is_no_dropout(seed):
    """At low speed a derived rate decays to nothing, and leaps with the next count."""
    chance = np.random.default_rng(seed)
    t = np.arange(4000) / 200
    gaps = np.cumsum(chance.integers(60, 120, 60))
    counts = np.zeros(4000)
    counts[gaps[gaps < 4000]] = 1.0
    rate = np.zeros(4000)
    for k in range(1, 4000):
        rate[k] = np.float32(rate[k - 1] * np.float32(2e-2)) + counts[k]
    own = {"relative_rate": rate * 200 * 0.98, "relative_angle": np.cumsum(counts)}
    assert wrong(find(t, own)) == []


def test_a_rate_from_counts_that_settles_and_leaps_is_no_dropout():
    """At a constant rate a filter of counts settles to the last digit, until one count is late."""
    rate = np.random.default_rng(2).normal(0, 1e-3, 8000) + np.sin(np.arange(8000) / 200)
    for k in range(40):
        rate[200 * k + 50 : 200 * k + 66] = 1 + 0.1 * k
    assert wrong(find(np.arange(8000) / 200, {"relative_rate": rate})) == []


@pytest.mark.slow
def test_no_trial_of_the_demo_is_refused(tmp_path):
    shipped = protocols_folder()
    text = (shipped / "quickstart.toml").read_text("utf-8")
    text = text.replace('"benches/', f'"{shipped.as_posix()}/benches/')
    trials = 0
    for each in open_run(simulated_run(tmp_path, text)).trials:
        recording = each.recording()
        own = {name: recording.channels[name].samples for name in recording.channels}
        assert wrong(find(recording.time, own)) == [], each.number
        trials += 1
    assert trials > 30


@pytest.mark.parametrize("seed", range(60))
def test_anything_at_all_is_looked_at_without_falling(seed):
    """Short, empty, lost, infinite, huge and constant: no exception, no warning."""
    chance = np.random.default_rng(seed)
    n = int(chance.choice([0, 1, 2, 3, 7, 8, 20, 21, 100, 400]))
    odd = np.array([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 5e-324, 1.0, 2**31, -32768.0])

    def series() -> np.ndarray:
        match chance.integers(5):
            case 0:
                return chance.normal(0, 1, n)
            case 1:
                return np.cumsum(chance.normal(0, 1, n))
            case 2:
                return np.full(n, chance.choice(odd))
            case 3:
                return np.round(chance.normal(0, 3, n))
            case _:
                return np.where(chance.uniform(size=n) < 0.2, chance.choice(odd, n), np.arange(n))

    time = np.arange(n) / 100
    names = ("relative_angle", "relative_rate", "motor_angle", "motor_rate", "drive_torque",
             "motor_current", "command", "reference", "odd")  # fmt: skip
    for gear in (None, 50.0):
        own = {name: series() for name in names if chance.uniform() < 0.8}
        found = find(time, own, gear=gear)
        assert all(0 <= each.rows[0] <= each.rows[1] < max(n, 1) for each in found)
