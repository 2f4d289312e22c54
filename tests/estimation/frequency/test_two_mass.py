"""Two-mass drives that scipy simulates: inertias, stiffness and both frequencies, blind."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest

from campaign.estimate import Origin
from campaign.estimation.frequency.best_linear import best_linear
from campaign.estimation.frequency.drive import PARTS
from campaign.estimation.frequency.multisine import odd_grid, random_phases
from campaign.estimation.frequency.one_inertia import HIDDEN, RIGID
from campaign.estimation.frequency.rational import LARGE_RESIDUALS
from campaign.estimation.frequency.two_mass import two_mass, two_mass_fit
from campaign.estimation.frequency.two_mass_model import Side, mode_damping
from campaign.estimation.intervals import MODEL_MISFIT
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.drives import Drive, random_drive
from tests.estimation.frequency.measured import noisy, scatter_as_told

FINE, RATE, PERIOD = 4096, 256, 4.0
FREQUENCY = np.arange(0.5, 70.0, 0.5)
DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 9.0)


def truths(drive: Drive) -> dict[str, float]:
    return {
        "motor_inertia": drive.motor,
        "load_inertia": drive.load,
        "total_inertia": drive.motor + drive.load,
        "stiffness": drive.stiffness,
        "damping": drive.damping,
        "resonance": drive.resonance,
        "antiresonance": drive.antiresonance,
        "resonance_damping": -drive.pole.real / abs(drive.pole),
        "antiresonance_damping": drive.damping / (2 * np.sqrt(drive.stiffness * drive.load)),
        "inertia_ratio": drive.load / drive.motor,
    }


@pytest.mark.slow
def test_from_simulated_multisines_blind() -> None:
    """From rest, with noise on torque and rate; resonance within 1 %."""
    held: dict[str, list[bool]] = defaultdict(list)
    for seed in range(10):
        random = np.random.default_rng(seed)
        drive = random_drive(random)
        grid = odd_grid(0.5, 70.0, PERIOD, seed)
        time = np.arange(int(PERIOD * FINE)) / FINE
        u = np.array([random_phases(grid, 1.0, 100 * seed + m).sample(time) for m in range(7)])
        u = np.tile(u, 2)
        rates = drive.rates(u, FINE)[..., :: FINE // RATE]
        u = u[:, :: FINE // RATE]
        rates += random.uniform(0.001, 0.05) * np.std(rates) * random.standard_normal(rates.shape)
        torque = u + 0.005 * random.standard_normal(u.shape)
        responses = {
            side: best_linear(torque, rate, RATE, 2, grid.excited, "reference", u).response
            for side, rate in zip(("motor", "load"), rates, strict=True)
        }
        motor = two_mass({"motor": responses["motor"]})
        load = two_mass({"load": responses["load"]})
        assert not motor.misfit
        assert not load.misfit
        for name, truth in truths(drive).items():
            held[name].append(holds(motor.estimates[name], truth))
        for name in ("motor_inertia", "load_inertia", "stiffness", "resonance", "antiresonance"):
            assert motor.estimates[name].value == pytest.approx(truths(drive)[name], rel=0.01)
        assert load.estimates["resonance"].value == pytest.approx(drive.resonance, rel=0.01)
        held["load resonance"].append(holds(load.estimates["resonance"], drive.resonance))
        held["load total"].append(holds(load.estimates["total_inertia"], drive.motor + drive.load))
    assert not rejected(held, "less")


def measured(drive: Drive, side: Side, seed: int, level: float = 0.01):  # type: ignore[no-untyped-def]
    truth = drive.response(FREQUENCY, side)
    random = np.random.default_rng(seed)
    return noisy(FREQUENCY, truth, level * np.median(np.abs(truth)), random)


def repeated(side: Side, seed: int):  # type: ignore[no-untyped-def]
    truth = DRIVE.response(FREQUENCY, side)
    level = 0.02 * np.median(np.abs(truth))
    return noisy(FREQUENCY, truth, level, np.random.default_rng(seed), of=30)


@pytest.mark.slow
def test_errors_are_the_scatter_of_repeated_measurements() -> None:
    """Each number's own: a wrong gradient shows here, where coverage of thirty hardly does."""
    found = [two_mass_fit({"motor": repeated("motor", seed)}, False) for seed in range(40)]
    for name in truths(DRIVE):
        ratio = scatter_as_told([each.estimates[name] for each in found])
        # 40 tell a deviation within 11 %; the weights' own scatter is counted in full for all.
        assert ratio == pytest.approx(0.95, abs=0.3), name
    found = [two_mass({"load": repeated("load", seed)}) for seed in range(100)]
    for name in ("total_inertia", "resonance", "resonance_damping"):
        ratio = scatter_as_told([each.estimates[name] for each in found])
        assert ratio == pytest.approx(1, abs=0.2), name


@pytest.mark.slow
def test_correlations_are_those_of_repeated_measurements() -> None:
    found = [two_mass_fit({"motor": repeated("motor", seed)}, False) for seed in range(60)]
    names = list(truths(DRIVE))
    seen = np.corrcoef([[each.estimates[name].value for each in found] for name in names])
    told = found[0].correlations
    assert len(told) == len(names) * (len(names) - 1) // 2
    for (one, other), share in told.items():
        # 60 tell Fisher's z of a correlation within 0.13; five of those in any of 45.
        expected = seen[names.index(one), names.index(other)]
        apart = np.arctanh(0.999 * share) - np.arctanh(0.999 * expected)
        assert abs(apart) < 0.65, (one, other)
    assert told["stiffness", "load_inertia"] > 0.8
    assert 1.0 < found[0].condition < 1000.0


@pytest.mark.slow
@pytest.mark.parametrize("side", ["motor", "load"])
def test_one_inertia_is_told_as_one(side: Side) -> None:
    """A rigid axis has no second inertia, and no interval of a sum of two that are not there."""
    truth = 1.0 / (2j * np.pi * FREQUENCY * 3.0 + 9.0) * np.exp(-2j * np.pi * FREQUENCY * 5e-4)
    held = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        found = two_mass({side: noisy(FREQUENCY, truth, 0.02 * np.median(np.abs(truth)), random)})
        if not found.rigid:
            continue
        assert found.estimates["resonance"].origin is Origin.NOT_DETERMINED
        assert found.estimates["load_inertia"].reason in RIGID
        assert found.estimates["total_inertia"].half_width < 0.05
        held.append(holds(found.estimates["total_inertia"], 3.0))
    assert len(held) >= 11
    assert not rejected({"inertia": held}, "less")
    # A drive with a resonance in the band is none.
    assert not two_mass({side: measured(DRIVE, side, 1)}).rigid


@pytest.mark.parametrize("seed", range(8))
def test_a_load_sensor_takes_no_delay_for_negative_damping(seed: int) -> None:
    """(1 - s t) with 2 t less delay answers alike but for its sign, and moves the inertia."""
    random = np.random.default_rng(seed)
    delay = random.uniform(0, 0.003)
    truth = DRIVE.response(FREQUENCY, "load") * np.exp(-2j * np.pi * FREQUENCY * delay)
    found = two_mass({"load": noisy(FREQUENCY, truth, 3e-5 * np.median(np.abs(truth)), random)})
    assert found.function.delay == pytest.approx(delay, abs=2e-4)
    assert found.estimates["total_inertia"].value == pytest.approx(3.0, rel=1e-3)


def test_a_load_sensor_alone_does_not_tell_the_two_inertias() -> None:
    found = two_mass({"load": measured(DRIVE, "load", 1)})
    for name in (*PARTS, "antiresonance", "antiresonance_damping", "inertia_ratio"):
        assert found.estimates[name].origin is Origin.NOT_DETERMINED
        assert found.estimates[name].reason in HIDDEN
    assert holds(found.estimates["resonance"], DRIVE.resonance)
    assert holds(found.estimates["total_inertia"], 3.0)
    # Another drive with the same sum, resonance and damping answers alike at the load.
    stiffness = (2 * np.pi * DRIVE.resonance) ** 2 * 0.6 * 2.4 / 3
    one = Drive(2.0, 1.0, 4000.0, 3.0, 0.0)
    other = Drive(0.6, 2.4, stiffness, 3.0 / 4000.0 * stiffness, 0.0)
    alike = one.response(FREQUENCY, "load") / other.response(FREQUENCY, "load")
    assert np.max(np.abs(alike - 1)) < 1e-9


def test_both_sensors_tell_more_than_one() -> None:
    responses = {side: measured(DRIVE, side, k, 0.05) for k, side in enumerate(("motor", "load"))}
    both = two_mass(responses)  # type: ignore[arg-type]
    for name, truth in truths(DRIVE).items():
        assert holds(both.estimates[name], truth), name


def test_a_torque_constant_is_a_systematic_part_of_what_is_in_newton_metres() -> None:
    found = two_mass({"motor": measured(DRIVE, "motor", 2)}, torque_uncertainty=0.03)
    stiffness = found.estimates["stiffness"]
    assert stiffness.systematic_uncertainty == pytest.approx(0.03 * stiffness.value)
    assert found.estimates["resonance"].systematic_uncertainty == 0.0


def test_a_spring_that_holds_the_motor_is_found() -> None:
    """As friction does before it slides: the inertias are still those of the drive."""
    s = 2j * np.pi * FREQUENCY
    j1, j2, k, d, held = 2.0, 1.0, 4000.0, 3.0, 600.0
    coupling, motor, load = k / s + d, j1 * s + 9.0 + held / s, j2 * s
    truth = (load + coupling) / (motor * load + coupling * (motor + load))
    random = np.random.default_rng(3)
    found = two_mass({"motor": noisy(FREQUENCY, truth, 0.01 * np.median(np.abs(truth)), random)})
    assert found.grounded
    assert not found.misfit
    for name, value in (("motor_inertia", j1), ("load_inertia", j2), ("stiffness", k)):
        assert holds(found.estimates[name], value)
        assert found.estimates[name].value == pytest.approx(value, rel=0.02)


def test_three_masses_are_misfit() -> None:
    truth = DRIVE.response(FREQUENCY, "motor")
    s = 2j * np.pi * FREQUENCY
    w = 2 * np.pi * 40.0
    third = 1 + 0.3 * s**2 / (s**2 + 0.04 * w * s + w**2)
    random = np.random.default_rng(4)
    found = two_mass({"motor": noisy(FREQUENCY, truth * third, 0.003 * np.abs(truth), random)})
    assert found.misfit in LARGE_RESIDUALS
    assert not found.estimates["motor_inertia"].has_interval
    assert found.estimates["motor_inertia"].reason in MODEL_MISFIT


def test_mode_damping_is_that_of_the_poles() -> None:
    drive = random_drive(np.random.default_rng(5))
    point = np.array(
        [
            np.log(drive.motor),
            np.log(drive.load / drive.motor),
            np.log(drive.stiffness),
            drive.damping,
            drive.motor_friction,
            0.0,
            0.0,
            0.0,
        ]
    )
    assert mode_damping(point) == pytest.approx(-drive.pole.real / abs(drive.pole))


def test_a_resonance_that_nothing_swings_has_no_damping_without_uncertainty() -> None:
    drive = Drive(2.0, 1.0, 4000.0, 300.0, 9.0)
    estimates = two_mass_fit({"motor": measured(drive, "motor", 1)}, grounded=False).estimates
    found = estimates["resonance_damping"]
    assert found.value == 1.0
    assert (found.origin, found.has_interval) == (Origin.AT_BOUND, False)
