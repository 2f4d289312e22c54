"""What a torque is between the samples of a controller that holds its command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from campaign.experiments.presliding_multisine.dynamics import record_of, with_torques_known
from campaign.experiments.presliding_multisine.held_current import LATE, UNKNOWN, between_samples
from campaign.physics.bench import Bench
from campaign.signals import MultiSine
from tests.experiments.laboratory import execute, trials
from tests.physics.benches import Tree, bench

RATE, FINER, PERIODS = 1000.0, 50, 6
LINE, AMPLITUDE = 50.0, 2.0
COMMAND = MultiSine(amplitudes=(AMPLITUDE,), frequencies=(LINE,), phases=(0.3,))


def held(current: dict[str, str] | None, delay: float = 0.0) -> Bench:
    """A drive of 1.2 ohm and 4 mH, with a controller that holds its command."""

    def edit(tree: Tree) -> None:
        tree["motor"]["resistance"], tree["motor"]["inductance"] = "1.2 ohm", "4 mH"
        tree["controller"] |= {"sample_rate": f"{RATE} Hz", "delay": f"{delay} s"}
        tree["controller"].pop("current")
        if current is not None:
            tree["controller"]["current"] = current

    return bench(edit)


def line_of(values: np.ndarray, step: float) -> complex:
    """Amplitude of the line in whole periods of it, of evenly spaced values."""
    time = step * np.arange(len(values))
    return complex(2.0 * np.mean(values * np.exp(-2j * np.pi * LINE * time)))


@pytest.mark.parametrize(("late", "every"), [(0, 50), (15, 50), (0, 100), (0, 25)])
def test_the_line_between_samples_is_that_of_a_current_loop_advanced_finely(
    late: int, every: int
) -> None:
    """L di/dt = P (c - i) + P Ki integral of (c - i) - R i of a motor at rest; c is held."""
    gain, integral, resistance, inductance = 10.0, 300.0, 1.2, 4e-3
    step = 1.0 / RATE / FINER
    system = np.zeros((3, 3))  # current, integral, command
    system[0] = [-(gain + resistance) / inductance, gain * integral / inductance, gain / inductance]
    system[1, 0], system[1, 2] = -1.0, 1.0
    move = expm(system * step)
    samples = int(RATE / LINE) * PERIODS * 5
    state, fine = np.zeros(3), np.empty(samples * FINER)
    for index in range(samples * FINER):
        if index >= late and (index - late) % FINER == 0:
            state[2] = COMMAND.sample(np.array([(index - late) // FINER / RATE]))[0]
        fine[index] = state[0]
        state = move @ state
    # The last periods, when it has settled.
    fine = fine[-int(RATE / LINE) * PERIODS * FINER :]
    missing = line_of(fine, step) - line_of(fine[::every], every * step)
    current = {"form": "ideal", "proportional": "10 V/A", "integral": "300 1/s"}
    drive = held(current, late * step)
    time = every * step * np.arange(len(fine) // every)
    told, doubt = between_samples(time, COMMAND, drive)
    assert abs(missing) > 4e-3 * AMPLITUDE
    assert abs(line_of(told, every * step) - missing) < 0.01 * abs(missing)
    assert doubt == pytest.approx(UNKNOWN * told)


def test_a_current_loop_that_nobody_tells_may_lag_behind() -> None:
    time = np.linspace(0.0, 0.1, 101)
    told, doubt = between_samples(time, COMMAND, held(None))
    assert not np.any(told)
    for name in ("resistance", "inductance"):
        current = {"form": "ideal", "proportional": "10 V/A", "integral": "300 1/s"}
        told_all = held(current)
        assert told_all.motor is not None
        motor = told_all.motor.model_copy(update={name: None})
        unsaid = told_all.model_copy(update={"motor": motor})
        assert between_samples(time, COMMAND, unsaid)[1] == pytest.approx(doubt)
    slope = AMPLITUDE * 2.0 * np.pi * LINE * np.cos(2.0 * np.pi * LINE * time + 0.3)
    assert doubt == pytest.approx(LATE / RATE * slope)


def test_a_continuous_controller_holds_nothing() -> None:
    for parts in between_samples(np.linspace(0.0, 0.1, 11), COMMAND, bench()):
        assert not np.any(parts)


def test_a_record_has_what_its_torque_is_between_samples() -> None:
    def edit(tree: Tree) -> None:
        tree["controller"] |= {"sample_rate": "1 kHz", "delay": "0 s"}

    options = {"amplitudes": ["1 N m"], "lowest": "2 Hz", "highest": "40 Hz", "periods": 2}
    (data,) = execute(trials("presliding_multisine", bench(edit), options))
    measured = record_of(data)
    (known,) = with_torques_known([data], [measured])
    command = data.trial.task.command
    assert isinstance(command, MultiSine)
    missing, doubt = between_samples(measured.time, command, bench(edit))
    assert np.max(np.abs(missing)) > 1e-3
    assert known.torque - measured.torque == pytest.approx(missing, abs=1e-12)
    assert known.doubts[:, -1] == pytest.approx(doubt)


def test_trials_at_other_rates_and_unshaken_ones_doubt_nothing_of_each_other() -> None:
    def edit(tree: Tree) -> None:
        tree["controller"] |= {"sample_rate": "1 kHz", "delay": "0 s"}
        tree.setdefault("sensors", {})["current"] = {"noise": "20 mA"}

    sizes = {"amplitudes": ["0.5 N m"], "lowest": "2 Hz", "highest": "40 Hz", "periods": 3}
    kind = "presliding_multisine"
    one = execute(trials(kind, bench(edit), sizes))
    other = execute(trials(kind, bench(edit), {**sizes, "sample_rate": "500 Hz"}))
    items = [*one, *other, *one]
    records = [record_of(each) for each in items]
    records[2] = replace(records[2], at_rest=False)
    known = with_torques_known(items, records)
    widths = {each.doubts.shape[1] for each in known}
    assert len(widths) == 1
    first, second = (np.any(each.doubts[:, :-1], axis=0) for each in known[:2])
    assert np.any(first)
    assert np.any(second)
    assert not np.any(first & second)
    assert np.array_equal(known[2].torque, records[2].torque)
    assert not np.any(known[2].doubts)
