"""The method on archived runs: multisines, sines, other recordings, loops, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from campaign.channels import COMMAND, DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE, info
from campaign.estimate import Estimate, Origin
from campaign.estimation.frequency.extrema import NEEDS_A_FIT, NO_SCATTER
from campaign.estimation.frequency.multisine import odd_grid, random_phases
from campaign.experiments.frequency_response.model.axis_numbers import UNKNOWN
from campaign.experiments.frequency_response.model.frequency_fit import TOO_FEW
from campaign.experiments.responses.signals import base_frequency, by_amplitude, unused
from campaign.experiments.responses.sources import _lines
from campaign.identify.material import choose
from campaign.result import Result
from campaign.signals import MultiSine, Polyline, Signal, Sine, Zero
from campaign.trial import Recording, Task, Trial
from tests.archives import archived, plan_of
from tests.estimation.coverage import holds
from tests.estimation.frequency.drives import Drive, loop_of, simulated, with_coulomb
from tests.experiments.asked import asked, suitable

FINE, RATE, PERIOD = 4096, 256, 4.0
EVERY = FINE // RATE
DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 9.0)
GRID = odd_grid(0.5, 60.0, PERIOD, 1)
Answer = Callable[[np.ndarray], dict[str, np.ndarray]]


def rig(bench: dict, appendage: bool) -> dict:  # type: ignore[type-arg]
    """What is known of it: an axis, and perhaps that something elastic hangs on it."""
    facts = {"name": "rig", "axis": {"name": "azimuth"}}
    if appendage:
        facts["appendage"] = {"inertia": 0.5, "frequency": 12.0, "damping_ratio": 0.02}
    return facts


def trials(
    folder: Path, commands: Sequence[Signal], mode: str, duration: float, appendage: bool = True
) -> list[Trial]:
    first = plan_of(folder).trials[0]
    made = []
    for number, command in enumerate(commands, start=1):
        task = Task(
            mode=mode,  # type: ignore[arg-type]
            command=command,
            duration=duration,
            window=(0.0, duration),
            sample_rate=RATE,
        )
        update = {
            "number": number,
            "test": "drive",
            "kind": "frequency_response",
            "point": {},
            "windows": (),
            "requires": (),
            "can_use": (),
            "task": task,
            "bench": rig(first.bench, appendage),
        }
        made.append(first.model_copy(update=update))
    return made


def answered(trial: Trial, answer: Answer, without: tuple[str, ...] = ()) -> Recording:
    """Simulated from rest, as it is recorded."""
    fine = np.arange(round(trial.task.duration * FINE)) / FINE
    found = answer(trial.task.command.sample(fine))
    time = fine[::EVERY]
    signals = {name: values[::EVERY] for name, values in found.items() if name not in without}
    return Recording(
        time,
        {
            name: info(name, mode=trial.task.mode).with_samples(values)
            for name, values in signals.items()
        },
    )


def driven(side: int = 0, noise: float = 0.01) -> Answer:
    """A torque without a loop; the gyro has the rate of the motor (0) or of the load (1)."""
    random = np.random.default_rng(7)

    def answer(torque: np.ndarray) -> dict[str, np.ndarray]:
        rate = DRIVE.rates(torque, FINE)[side]
        angle = (np.cumsum(rate) - 0.5 * rate) / FINE
        angle = angle + noise * 0.1 * np.std(angle) * random.standard_normal(len(angle))
        rate = rate + noise * np.std(rate) * random.standard_normal(len(rate))
        return {
            COMMAND: torque,
            DRIVE_TORQUE: torque,
            GYRO_RATE: rate,
            RELATIVE_ANGLE: angle,
        }

    return answer


def looped(torque_noise: float = 20.0) -> Answer:
    random = np.random.default_rng(8)
    a, b, c = loop_of(DRIVE, 60.0, 100.0)

    def answer(reference: np.ndarray) -> dict[str, np.ndarray]:
        held = np.repeat(random.standard_normal(len(reference) // EVERY), EVERY)
        out = simulated(a, b, c, np.array([reference, torque_noise * held, 0 * reference]), FINE)
        return {COMMAND: reference, DRIVE_TORQUE: out[0] + 60.0 * reference, GYRO_RATE: out[1]}

    return answer


def identified(
    folder: Path,
    made: Sequence[Trial],
    answer: Answer,
    without: tuple[str, ...] = (),
    **options: object,
) -> Result:
    path = archived(folder / "results", [(t, answered(t, answer, without)) for t in made])
    chosen = choose(path.parent, path.name)
    usable, why = suitable("frequency_response", chosen.trials)
    if why:
        raise ValueError(why)
    return asked("frequency_response", usable, **options)


def multisines(count: int, rms: float = 5.0) -> list[MultiSine]:
    return [random_phases(GRID, rms, seed) for seed in range(count)]


def told(found: Result) -> dict:  # type: ignore[type-arg]
    return {each.estimate.name: each for each in found.identified.parameters}


@pytest.mark.slow
def test_multisines_of_a_torque(tmp_path: Path) -> None:
    found = identified(tmp_path, trials(tmp_path, multisines(7), "torque", 8.0), driven())
    parameters = told(found)
    for name, truth in (
        ("motor_inertia", DRIVE.motor),
        ("load_inertia", DRIVE.load),
        ("stiffness", DRIVE.stiffness),
        ("resonance", DRIVE.resonance),
        ("antiresonance", DRIVE.antiresonance),
    ):
        assert holds(parameters[name].estimate, truth), name
        assert parameters[name].estimate.value == pytest.approx(truth, rel=0.01)
    # The bench has a part that hangs on its load, and these are its keys.
    assert parameters["antiresonance"].bench == "appendage.frequency"
    assert parameters["load_inertia"].bench == "appendage.inertia"
    assert parameters["total_inertia"].bench == "axis.inertia"
    assert parameters["stiffness"].bench == ""
    tables = {table.key: table for table in found.tables}
    assert "7 realisations of 2 periods" in str(tables["responses"].rows[0]["excitation"])
    assert set(tables) >= {"responses", "two-masses", "modes", "distortion", "functions"}
    # A linear drive has no distortion.
    for parity in ("even", "odd"):
        level = tables["distortion"].rows[0][parity]
        assert level.kind == "at most" or level.value < 0.005
    keys = [figure.key for figure in found.figures]
    assert keys == ["bode-1-load", "distortion-1-load", "coherence", "residuals-1-load"]
    assert all(figure.caption and figure.alt for figure in found.figures)


def rubbing(commands: Sequence[Signal], duration: float) -> Answer:
    """As `driven`, with Coulomb friction of 1 N m at the motor; all trials at once, in order."""
    count = round(duration * FINE)
    half = np.arange(2 * count // 4 + 2) / (FINE / 2)
    torques = np.array([each.sample(half) for each in commands])
    steps = FINE // 4
    rates = with_coulomb(
        [DRIVE], 1.0, lambda time: torques[:, round(time * 2 * steps)], count // 4, steps
    )
    rates += 1e-4 * np.random.default_rng(5).standard_normal(rates.shape)
    left = iter(np.repeat(rates, 4, axis=1))

    def answer(torque: np.ndarray) -> dict[str, np.ndarray]:
        return {COMMAND: torque, DRIVE_TORQUE: torque, GYRO_RATE: next(left)}

    return answer


@pytest.mark.slow
def test_friction_is_a_systematic_part_where_two_amplitudes_tell_it(tmp_path: Path) -> None:
    weak, strong = multisines(7, 2.5), multisines(7, 7.5)
    (tmp_path / "one").mkdir()
    one = identified(tmp_path / "one", trials(tmp_path, weak, "torque", 8.0), rubbing(weak, 8.0))
    total = told(one)["total_inertia"]
    assert total.estimate.origin is Origin.NOT_DETERMINED
    assert not total.estimate.has_interval
    assert total.bench == ""
    # Nor what friction shifts besides, by an amount that is not known.
    assert not any(each.bench for each in one.identified.parameters)
    assert any("Repeat it at half or twice the amplitude" in note for note in one.notes)
    all_of_them = [*weak, *strong]
    made = trials(tmp_path, all_of_them, "torque", 8.0)
    both = identified(tmp_path, made, rubbing(all_of_them, 8.0))
    total = told(both)["total_inertia"]
    assert total.estimate.systematic_uncertainty > 0
    assert holds(total.estimate, DRIVE.motor + DRIVE.load)
    assert total.bench == "axis.inertia"
    distortion = next(t for t in both.tables if t.key == "distortion").rows
    # The stronger one comes first: it tells most.
    assert distortion[1]["odd"].value > 1.3 * distortion[0]["odd"].value


@pytest.mark.slow
def test_a_sensor_behind_the_spring_is_recognised(tmp_path: Path) -> None:
    made = trials(tmp_path, multisines(7), "torque", 8.0, appendage=False)
    found = identified(tmp_path, made, driven(side=1))
    parameters = told(found)
    assert parameters["stiffness"].estimate.origin is Origin.NOT_DETERMINED
    assert "no antiresonance" in str(parameters["stiffness"].estimate.reason)
    assert holds(parameters["resonance"].estimate, DRIVE.resonance)
    assert holds(parameters["total_inertia"].estimate, DRIVE.motor + DRIVE.load)
    assert parameters["load_inertia"].bench == ""
    assert any("behind the spring" in note for note in found.notes)


@pytest.mark.slow
def test_periods_before_the_window_settle(tmp_path: Path) -> None:
    """They are none of those that tell noise from distortion."""
    made = trials(tmp_path, multisines(7), "torque", 3 * PERIOD)
    windows = {"window": (PERIOD, 3 * PERIOD)}
    late = [each.model_copy(update={"task": each.task.model_copy(update=windows)}) for each in made]
    for planned, periods in ((made, 3), (late, 2)):
        folder = tmp_path / str(periods)
        folder.mkdir()
        found = identified(folder, planned, driven())
        (row,) = next(table for table in found.tables if table.key == "responses").rows
        assert f"7 realisations of {periods} periods" in str(row["excitation"])


def test_few_realisations_tell_distortion_and_no_parameters(tmp_path: Path) -> None:
    found = identified(tmp_path, trials(tmp_path, multisines(4), "torque", 8.0), driven())
    # Between lines a mode stands out; inertias, stiffness and damping need a fit.
    for name, each in told(found).items():
        if name in ("resonance", "antiresonance"):
            assert holds(each.estimate, getattr(DRIVE, name))
        elif "damping" in name and name != "damping":
            assert each.estimate.reason in NEEDS_A_FIT
        else:
            assert each.estimate.reason in TOO_FEW
    assert not any(each.bench for each in found.identified.parameters)
    assert any("need 7" in note for note in found.notes)
    assert all("record 7 realisations" in each.advice for each in found.identified.parameters)
    assert "distortion" in {table.key for table in found.tables}


def test_a_motor_sensor_that_nobody_can_use_is_told() -> None:
    trial = SimpleNamespace(channel_names=lambda: {"motor_rate", "relative_rate", "drive_torque"})
    (told,) = unused([trial], SimpleNamespace(ratio=None))  # type: ignore[list-item,arg-type]
    assert "motor_rate" in told
    assert "without `[gear]` motor and load move as one" in told, "as docs/import.md has it"
    assert "[gear] ratio" in told
    assert not list(unused([trial], SimpleNamespace(ratio=2.0)))  # type: ignore[list-item,arg-type]


def test_lines_that_no_command_names_stand_out_by_a_gap() -> None:
    """What a current loop leaves beside the lines is a tenth of them, and was not asked for."""
    time = np.arange(2048) / 256.0
    asked = np.arange(13, 250, 4)
    phases = np.random.default_rng(3).uniform(0, 2 * np.pi, len(asked))
    wave = np.cos(2 * np.pi * np.outer(time, asked) / 4.0 + phases).sum(axis=1)
    beside = 0.1 * np.cos(2 * np.pi * np.outer(time, np.arange(14, 60, 4)) / 4.0).sum(axis=1)
    nobody = SimpleNamespace(trial=SimpleNamespace(task=SimpleNamespace(command=None)))
    found = _lines(nobody, 4.0, (wave + beside)[None], 2)  # type: ignore[arg-type]
    np.testing.assert_array_equal(found, asked)


def test_one_realisation_tells_the_level_of_distortion_and_the_mode(tmp_path: Path) -> None:
    found = identified(tmp_path, trials(tmp_path, multisines(1), "torque", 16.0), driven())
    parameters = told(found)
    for name in ("resonance", "antiresonance"):
        estimate = parameters[name].estimate
        assert holds(estimate, getattr(DRIVE, name))
        # Its lines are half a hertz apart, or more where one was left out.
        assert estimate.high - estimate.low >= 1.0
    assert parameters["stiffness"].estimate.reason in TOO_FEW


def test_much_friction_leaves_no_mode_of_one_realisation(tmp_path: Path) -> None:
    """It damps modes away and has extrema of its own."""
    command = multisines(1, 2.5)
    made = trials(tmp_path, command, "torque", 8.0)
    found = identified(tmp_path, made, rubbing(command, 8.0))
    assert not any(each.estimate.has_interval for each in found.identified.parameters)
    assert told(found)["resonance"].estimate.reason in UNKNOWN
    rows = next(table for table in found.tables if table.key == "modes").rows
    assert not any(row["frequency"].has_interval for row in rows)


def test_of_a_single_period_no_mode_is_told(tmp_path: Path) -> None:
    """Nothing shows how far its lines scatter: the page says so, and what to record."""
    found = identified(tmp_path, trials(tmp_path, multisines(1), "torque", PERIOD), driven())
    assert {each.estimate.origin for each in found.identified.parameters} == {Origin.NOT_DETERMINED}
    assert told(found)["resonance"].estimate.reason in NO_SCATTER
    said = " ".join(found.notes)
    assert "Not determined: resonance" in said
    assert "record 7 realisations" in said


def recorded_twice(
    folder: Path, count: int, conditions: Mapping[str, object]
) -> tuple[list[Trial], list[MultiSine]]:
    """Recordings from elsewhere, `count` of 5 N m and `count` of half of it, in turns."""
    folder.mkdir()
    sizes = [5.0, 2.5] * count
    commands = [random_phases(GRID, size, seed) for seed, size in enumerate(sizes)]
    made = [
        each.model_copy(update={"point": {k: v for k, v in conditions.items() if number % 3}})
        for number, each in enumerate(trials(folder, commands, "recorded", 8.0))
    ]
    return made, commands


@pytest.mark.parametrize("conditions", [{}, {"amplitude": "5 N m"}])
def test_recordings_are_grouped_by_their_recorded_amplitude(
    tmp_path: Path, conditions: dict[str, object]
) -> None:
    """Whatever is stated of it: some of these are stated falsely."""
    made, _ = recorded_twice(tmp_path / "one", 4, conditions)
    found = identified(tmp_path / "one", made, driven(), without=(COMMAND,), excited="input")
    rows = next(t for t in found.tables if t.key == "responses").rows
    assert [row["trials"] for row in rows] == [4, 4]
    for row, rms in zip(rows, (5, 2.5), strict=True):
        assert f"rms {rms} N·m, crest" in str(row["excitation"])
        assert "4 realisations of 2 periods" in str(row["excitation"])
    assert any("rms 5 N·m (4 trials), rms 2.5 N·m (4 trials)" in n for n in found.notes)
    # Neither has enough, and each number that is missing has its reason.
    for each in found.identified.parameters:
        assert each.estimate.has_interval or each.estimate.reason
        assert "record 7 realisations" in each.advice
    assert told(found)["stiffness"].estimate.reason in TOO_FEW


@pytest.mark.slow
def test_two_amplitudes_recorded_elsewhere_tell_what_friction_adds(tmp_path: Path) -> None:
    made, commands = recorded_twice(tmp_path / "two", 7, {})
    answer = rubbing(commands, 8.0)
    found = identified(tmp_path / "two", made, answer, without=(COMMAND,), excited="input")
    total = told(found)["total_inertia"].estimate
    assert total.systematic_uncertainty > 0
    assert holds(total, DRIVE.motor + DRIVE.load)


def test_realisations_of_one_amplitude_are_kept_together() -> None:
    """A torque loop and noise change their rms by a few percent, another command by more."""
    sizes = [1.0, 0.97, 1.04, 0.5, 0.52]
    wave = np.sin(2 * np.pi * np.arange(256) / 64)
    trials = [
        SimpleNamespace(
            data=SimpleNamespace(trial=SimpleNamespace(number=k)),
            rate=64.0,
            leading=np.r_[np.zeros(128 * k), size * wave],
        )
        for k, size in enumerate(sizes)
    ]
    groups = by_amplitude(trials, 2.0)  # type: ignore[arg-type]
    numbers = [[signal.data.trial.number for signal in group] for group in groups]
    assert numbers == [[0, 1, 2], [3, 4]]


def noise(duration: float, size: float) -> Polyline:
    """Up to 50 Hz."""
    times = np.arange(0.0, duration, 1.0 / 1024.0)
    values = np.random.default_rng(3).standard_normal(len(times))
    band = butter(8, 50.0, fs=1024.0, output="sos")
    return Polyline(times=tuple(times), values=tuple(size * sosfilt(band, values)))


def phase_margin(found: Result) -> Estimate:
    margins = next(table for table in found.tables if table.key == "servo-characteristics")
    return margins.rows[0]["phase_margin"]  # type: ignore[return-value]


def true_phase_margin() -> float:
    frequency = np.geomspace(0.5, 200.0, 20_000)
    s = 2j * np.pi * frequency
    loop = (60.0 + 100.0 / s) * DRIVE.response(frequency, "motor")
    crossed = np.flatnonzero(np.diff(np.sign(np.log(np.abs(loop)))))
    return float(np.min(np.pi + np.unwrap(np.angle(loop))[crossed]))


@pytest.mark.slow
def test_a_loop_is_told_by_its_command(tmp_path: Path) -> None:
    found = identified(tmp_path, trials(tmp_path, multisines(7, 0.5), "rate", 8.0), looped())
    parameters = told(found)
    for name, truth in (("motor_inertia", DRIVE.motor), ("resonance", DRIVE.resonance)):
        assert holds(parameters[name].estimate, truth), name
    assert phase_margin(found).value == pytest.approx(true_phase_margin(), abs=0.05)


@pytest.mark.slow
def test_margins_of_a_loop_follow_from_noise_as_well(tmp_path: Path) -> None:
    made = trials(tmp_path, [noise(100.0, 10.0)], "rate", 100.0)
    found = identified(tmp_path, made, looped(), resolution="0.25 Hz")
    assert phase_margin(found).value == pytest.approx(true_phase_margin(), abs=0.05)


def test_a_loop_without_its_reference_is_refused(tmp_path: Path) -> None:
    made = trials(tmp_path, multisines(1, 0.5), "recorded", 8.0)
    with pytest.raises(ValueError, match="mixture of the drive and its controller"):
        identified(tmp_path, made, looped(), without=(COMMAND,), excited="reference")


@pytest.mark.parametrize("mode", ["rate", "torque"])
def test_ramps_and_steps_give_no_response(tmp_path: Path, mode: str) -> None:
    """What friction does to them is no noise: in a friction map it looked like a mode at 21 Hz."""
    ramp = Polyline(times=(0.0, 4.0, 8.0), values=(0.0, 20.0, 0.0))
    made = trials(tmp_path, [ramp, Zero()], mode, 8.0)
    with pytest.raises(ValueError, match="no trial is recorded elsewhere, or commanded by sines"):
        identified(tmp_path, made, looped() if mode == "rate" else driven())


@pytest.mark.slow
def test_recorded_elsewhere_it_must_be_said_what_is_excited(tmp_path: Path) -> None:
    made = trials(tmp_path, [noise(100.0, 20.0)], "recorded", 100.0)
    with pytest.raises(ValueError, match="does not say what was excited"):
        identified(tmp_path, made, driven(), without=(COMMAND,))
    (tmp_path / "again").mkdir()
    found = identified(
        tmp_path / "again",
        made,
        driven(),
        without=(COMMAND,),
        excited="input",
        resolution="0.25 Hz",
        highest="40 Hz",
    )
    parameters = told(found)
    assert parameters["resonance"].estimate.value == pytest.approx(DRIVE.resonance, rel=0.01)
    assert "coherence" in [figure.key for figure in found.figures]


@pytest.mark.slow
def test_angles_do_where_no_rate_is_recorded(tmp_path: Path) -> None:
    made = trials(tmp_path, multisines(7), "torque", 8.0)
    found = identified(tmp_path, made, driven(), without=(GYRO_RATE,))
    assert told(found)["resonance"].estimate.value == pytest.approx(DRIVE.resonance, rel=0.01)
    assert told(found)["motor_inertia"].estimate.value == pytest.approx(DRIVE.motor, rel=0.02)


@pytest.mark.slow
def test_single_sines(tmp_path: Path) -> None:
    frequencies = np.round(np.geomspace(2.0, 40.0, 40), 2)
    commands = [Sine(amplitude=5.0, frequency=float(each)) for each in frequencies]
    made = [
        trial.model_copy(update={"task": trial.task.model_copy(update={"window": (6.0, 10.0)})})
        for trial in trials(tmp_path, commands, "torque", 10.0)
    ]
    found = identified(tmp_path, made, driven())
    assert told(found)["resonance"].estimate.value == pytest.approx(DRIVE.resonance, rel=0.01)
    assert told(found)["stiffness"].estimate.value == pytest.approx(DRIVE.stiffness, rel=0.02)


def test_without_a_torque_nothing_suits(tmp_path: Path) -> None:
    made = trials(tmp_path, multisines(1), "torque", 8.0)
    with pytest.raises(ValueError, match="no trial is recorded elsewhere"):
        identified(tmp_path, made, driven(), without=(DRIVE_TORQUE,))


@pytest.mark.parametrize(
    ("frequencies", "base"),
    [((0.75, 1.25, 2.75), 0.25), ((3.0,), 3.0), ((1.0, 2.0**0.5), 0.0), ((0.3, 0.5), 0.1)],
)
def test_base_frequency(frequencies: tuple[float, ...], base: float) -> None:
    assert base_frequency(frequencies) == pytest.approx(base, rel=1e-4)
