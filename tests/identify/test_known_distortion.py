"""Two-mass benches whose levels of even and odd distortion are known without this program.

One has a motor that makes of the torque asked for another one, by a static curve: its levels have a
closed form. The other has a spring that stiffens, and more in one direction: its levels are those
of many more realisations, without noise, by plain Fourier transforms. Both are recorded as text
files and imported as a laboratory would.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign.arrays import Array
from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode
from campaign.identify import experiments_by_model
from campaign.identify.identification import identify
from campaign.identify.material import choose
from campaign.result import Table
from tests.estimation.coverage import holds
from tests.estimation.frequency.drives import Drive

DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 8.0)
"""Antiresonance 10.07 Hz, resonance 12.33 Hz."""
RATE, PERIOD, PERIODS, SETTLING = 400, 2.5, 3, 2
SAMPLES = int(RATE * PERIOD)
FINER = 2
"""Steps of the integration for each sample."""
BAND = (1, 100)
"""Lines: up to 40 Hz."""
RMS = 20.0
RECORDED, SIMULATED = 7, 40
QUADRATIC, CUBIC = 0.0012, 0.0001
"""Of the torque, in N m: at 20 N m rms some 3 % and 8 %."""
SQUARE, CUBE = 5e4, 4e6
"""Of the spring, in N m/rad² and N m/rad³."""
TOLERANCE = 0.1
"""dB, of the program's own ..."""
SCATTER = 2.0
"""... and of how levels of seven realisations scatter, where one mode has most of the power."""
RIG = '\nschema = 3\nname = "two masses"\n\n[axis]\nname = "bench"\n\n[gear]\nratio = 1\n'
MAPPING = """
schema = 2
title = "Two masses"
published = "none"
"""
COLUMNS = {
    "time": ("t", "s"),
    "drive_torque": ("u", "N m"),
    "motor_rate": ("wm", "rad/s"),
    "relative_rate": ("wl", "rad/s"),
}


def excited_lines() -> Array:
    """Odd lines, of every three one left out at random."""
    random = np.random.default_rng(5)
    odd = np.arange(BAND[0], BAND[1] + 1, 2)
    kept = [
        np.delete(group, random.integers(3)) for group in odd[: len(odd) // 3 * 3].reshape(-1, 3)
    ]
    return np.concatenate(kept)


LINES = excited_lines()


def torques(per_period: int) -> Array:
    """One period of each realisation, shape (SIMULATED, per_period)."""
    random = np.random.default_rng(6)
    spectrum = np.zeros((SIMULATED, per_period // 2 + 1), dtype=complex)
    phases = random.uniform(0, 2 * np.pi, (SIMULATED, len(LINES)))
    spectrum[:, LINES] = np.exp(1j * phases) * RMS / np.sqrt(2 * len(LINES)) * per_period
    return np.fft.irfft(spectrum, per_period, axis=1)


def curved_motor() -> Array:
    """Motor and load rate of one period in the steady state, shape (2, SIMULATED, SAMPLES)."""
    asked = torques(SAMPLES)
    made = np.fft.rfft(asked + QUADRATIC * asked**2 + CUBIC * asked**3, axis=1)
    frequency = np.arange(made.shape[1]) / PERIOD
    gains = np.stack([DRIVE.response(frequency, side) for side in ("motor", "load")])
    return np.fft.irfft(gains[:, None] * made, SAMPLES, axis=-1)


def curved_spring() -> Array:
    """The same, by Runge and Kutta's fourth order, when the transient has passed."""
    half = torques(2 * FINER * SAMPLES)
    step = 1.0 / (RATE * FINER)
    state = np.zeros((3, SIMULATED))

    def slope(at: Array, torque: Array) -> Array:
        motor, twist, load = at
        spring = DRIVE.stiffness * twist + SQUARE * twist**2 + CUBE * twist**3
        inner = spring + DRIVE.damping * (motor - load)
        return np.stack(
            [
                (torque - inner - DRIVE.motor_friction * motor) / DRIVE.motor,
                motor - load,
                inner / DRIVE.load,
            ]
        )

    kept = np.empty((2, SIMULATED, SAMPLES))
    for k in range((SETTLING + 1) * FINER * SAMPLES):
        if k >= SETTLING * FINER * SAMPLES and k % FINER == 0:
            kept[:, :, k // FINER - SETTLING * SAMPLES] = state[[0, 2]]
        u0, u1, u2 = (half[:, (2 * k + i) % half.shape[1]] for i in range(3))
        k1 = slope(state, u0)
        k2 = slope(state + 0.5 * step * k1, u1)
        k3 = slope(state + 0.5 * step * k2, u1)
        k4 = slope(state + step * k3, u2)
        state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return kept


def by_plain_transforms(rates: Array) -> dict[str, float]:
    """Levels (dB) of even and odd distortion over the output, of realisations without noise."""
    into = np.fft.rfft(torques(SAMPLES)[: len(rates)], axis=1)[:, LINES]
    out = np.fft.rfft(rates, axis=1)
    band = np.arange(LINES[0] + 1, LINES[-1])
    beside = np.setdiff1d(band[band % 2 == 1], LINES)
    power = np.mean(np.abs(out) ** 2, axis=0)
    scatter = np.var(out[:, LINES] / into, axis=0, ddof=1) * np.abs(into[0]) ** 2
    odd = np.sum(power[beside]) + np.sum(scatter)
    levels = {"even": np.sum(power[band[band % 2 == 0]]), "odd": odd}
    return {parity: 10 * np.log10(each / np.sum(power[LINES])) for parity, each in levels.items()}


def closed_form(side: str) -> dict[str, float]:
    """The same of the curved motor: b u² puts 2 b² (S * S) beside the mean, a u³ a gain of
    3 a s² and 6 a² (S * S * S) beside it (Hermite polynomials; Bussgang)."""
    spectrum = np.zeros(SAMPLES)
    spectrum[LINES] = spectrum[-LINES] = RMS**2 / len(LINES) / 2
    transformed = np.fft.fft(spectrum)
    twice, thrice = (np.fft.ifft(transformed**k).real for k in (2, 3))
    band = np.arange(LINES[0], LINES[-1] + 1)
    gain = np.abs(DRIVE.response(band / PERIOD, side)) ** 2
    even = (2 * QUADRATIC**2 * twice[band] * gain)[band % 2 == 0]
    odd = (6 * CUBIC**2 * thrice[band] * gain)[band % 2 == 1]
    linear = ((1 + 3 * CUBIC * RMS**2) ** 2 * spectrum[band] * gain)[np.isin(band, LINES)]
    whole = np.sum(linear) + np.sum((6 * CUBIC**2 * thrice[band] * gain)[np.isin(band, LINES)])
    return {"even": 10 * np.log10(np.sum(even) / whole), "odd": 10 * np.log10(np.sum(odd) / whole)}


BENCHES = {"motor": curved_motor, "spring": curved_spring}


@pytest.fixture(scope="module")
def truths() -> dict[str, Array]:
    return {name: simulate() for name, simulate in BENCHES.items()}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory, truths: dict[str, Array]) -> Path:
    """A run `bench` with a test for each bench; each file is one realisation of three periods."""
    folder = tmp_path_factory.mktemp("known")
    random = np.random.default_rng(7)
    time = np.arange(PERIODS * SAMPLES) / RATE
    text = MAPPING
    for channel, (column, unit) in COLUMNS.items():
        text += f'\n[columns.own.{channel}]\ncolumn = "{column}"\nunit = "{unit}"\n'
    for name, rates in truths.items():
        text += f'\n[[test]]\nname = "{name}"\nkind = "motion"\nbench = "./rig.toml"\n'
        text += f'\n[[test.recording]]\nfile = "{name}*.csv"\n'
        for m in range(RECORDED):
            signals = [np.tile(each, PERIODS) for each in (torques(SAMPLES)[m], *rates[:, m])]
            noisy = [
                each + 0.01 * np.std(each) * random.standard_normal(len(each))
                for each in signals[1:]
            ]
            rows = np.column_stack([time, signals[0], *noisy])
            header = ",".join(column for column, _ in COLUMNS.values())
            np.savetxt(folder / f"{name}{m}.csv", rows, "%.8g", ",", header=header, comments="")
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    (folder / "bench.toml").write_text(text, encoding="utf-8")
    assert import_recordings([str(folder / "bench.toml")], folder / "results") is ExitCode.DONE
    return folder / "results"


@pytest.fixture(scope="module")
def tables(results: Path) -> dict[str, dict[str, Table]]:
    """Of each bench what a laboratory would be told."""
    told = {}
    run = next(results.glob("*-bench.nxs")).stem
    # A narrow band: fits of modes are not what is looked at here.
    said = {"excited": "input", "highest": "6 Hz"}
    settings = [f'frequency_response.{option}="{value}"' for option, value in said.items()]
    for name in BENCHES:
        chosen = choose(results, f"{run}:{name}")
        found = identify(
            chosen, experiments_by_model(), models=("frequency_response",), settings=settings
        )
        (own,) = found.sections
        assert own.result is not None, own.problem
        notes = " ".join(own.result.notes)
        assert f"repeats every {PERIOD} s" in notes
        told[name] = {each.key: each for each in own.result.tables}
    return told


@pytest.mark.slow
@pytest.mark.parametrize("bench", BENCHES)
def test_levels_of_even_and_odd_distortion_are_the_known_ones(
    truths: dict[str, Array], tables: dict[str, dict[str, Table]], bench: str
) -> None:
    rows = {row["side"]: row for row in tables[bench]["distortion"].rows}
    assert set(rows) == {"motor", "load"}
    for k, side in enumerate(("motor", "load")):
        known = closed_form(side) if bench == "motor" else by_plain_transforms(truths[bench][k])
        own = by_plain_transforms(truths[bench][k][:RECORDED])
        for parity in ("even", "odd"):
            level = rows[side][f"{parity}_level"]
            assert holds(level, known[parity]), (side, parity, known, level)
            assert level.value == pytest.approx(known[parity], abs=SCATTER)
            assert level.value == pytest.approx(own[parity], abs=TOLERANCE)
