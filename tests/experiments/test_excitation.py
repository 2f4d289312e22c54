"""Excitations: what is commanded of a bench, what is found of it, and where it can be executed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from campaign.backends.serial import SerialBackend, SerialOptions
from campaign.estimation.gate import UNPHYSICAL
from campaign.experiments import experiments
from campaign.experiments.any_motion.motions import rows_of
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.interface import Experiment
from campaign.physics.bench import Bench
from campaign.physics.limits import motion
from campaign.protocol import check_limits, load_protocol, make_plan
from campaign.protocol.bench_file import load_bench
from campaign.recording import Ending, Fault, MemoryRecorder, Outcome
from campaign.signals import MultiSine, Polyline
from campaign.trial import Trial
from tests.backends.test_files import opened
from tests.estimation.coverage import holds
from tests.experiments.asked import suitable
from tests.experiments.laboratory import Done, analyse, execute, finding, table, trials
from tests.link.controllers import controller
from tests.physics.benches import bench

KIND = "excitation"
MULTISINE = {"amplitude": "8 deg/s", "lowest": "1 Hz", "highest": "20 Hz", "period": "2 s"}
FOURIER = {"signal": "fourier", "period": "4 s", "search": 40}
TORQUE = {"command": "torque", "torque": "20 N m", "lowest": "2 Hz", "highest": "20 Hz"}
SHIPPED = Path(__file__).parents[2] / "protocols"


def commands(options: dict[str, Any], on: Bench | None = None) -> list[MultiSine | Polyline]:
    planned = trials(KIND, on or bench(), options)
    return [cast("MultiSine | Polyline", each.task.command) for each in planned]


@cache
def series() -> tuple[Done, ...]:
    return execute(trials(KIND, bench(), FOURIER))


@cache
def shaken() -> tuple[Done, ...]:
    return execute(trials(KIND, bench(), {**MULTISINE, "realisations": 7}))


# What is commanded


def test_realisations_have_the_same_lines_and_power_and_the_size_asked() -> None:
    planned = trials(KIND, bench(), MULTISINE)
    assert [each.point["realisation"] for each in planned] == list(range(1, 8))
    assert {each.task.duration for each in planned} == {1.0 + 2 * 2.0}
    found = [cast("MultiSine", each.task.command) for each in planned]
    assert len({each.frequencies for each in found}) == 1
    assert len({each.phases for each in found}) == 7
    assert {round(each.amplitudes[0], 12) for each in found} == {round(found[0].amplitudes[0], 12)}
    time = np.linspace(0.0, 2.0, 20_001)
    assert max(np.max(np.abs(each.sample(time))) for each in found) == pytest.approx(
        np.deg2rad(8.0), rel=2e-3
    )
    assert commands(MULTISINE) == commands(MULTISINE)
    assert commands({**MULTISINE, "seed": 5}) != commands(MULTISINE)


@pytest.mark.parametrize("signal", ["multisine", "chirp", "noise"])
def test_a_torque_has_the_size_asked(signal: str) -> None:
    options = {**TORQUE, "signal": signal, "period": "2 s", "duration": "10 s", "realisations": 2}
    time = np.linspace(0.0, 10.0, 200_001)
    largest = max(float(np.max(np.abs(each.sample(time)))) for each in commands(options))
    assert largest == pytest.approx(20.0, rel=5e-3)


@pytest.mark.parametrize("name", ["platform", "linear"])
def test_a_series_keeps_to_the_limits_that_it_was_searched_for(name: str) -> None:
    on = load_bench(name)
    (trial,) = trials(KIND, on, {**FOURIER, "terms": ["inertia", "viscous", "coulomb"]})
    used = motion(trial.task)
    assert on.limits is not None
    assert used.rate <= 0.9 * on.limits.rate * 1.0001
    assert used.angle <= 0.9 * on.limits.angle * 1.0001
    assert isinstance(trial.task.command, MultiSine)
    time = np.linspace(0.0, 4.0, 40_001)
    accelerated = np.max(np.abs(trial.task.command.integral(time, -1)))
    assert accelerated <= 0.9 * on.limits.acceleration * 1.0001
    size = 0.04 * on.limits.rate
    slower = {**FOURIER, "max_rate": f"{np.rad2deg(size)} deg/s", "terms": ["inertia", "viscous"]}
    (slow,) = trials(KIND, on, slower)  # read without a bench, units are those of what turns
    assert 0.99 * size < motion(slow.task).rate <= size * 1.0001


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"signal": "file"}, "needs a table"),
        ({"signal": "fourier", "command": "torque"}, "needs command = 'rate'"),
        ({**MULTISINE, "sample_rate": "100 Hz"}, "raise sample_rate or lower highest"),
        ({**MULTISINE, "period": "0.3 s"}, "lengthen the period"),
        ({**MULTISINE, "period": "2.0001 s"}, "no whole number of samples"),
        ({**FOURIER, "max_torque": "20 N m"}, "lower max_rate or raise max_torque"),
        ({**FOURIER, "terms": ["mass"]}, "there is no term 'mass'"),
        ({"signal": "chirp", "highest": "100 Hz", "duration": "300 s"}, "polyline of .* points"),
        ({**TORQUE, "torque": "2 kN m", "lowest": "0.5 Hz"}, "lower torque or raise lowest"),
    ],
)
def test_what_cannot_be_is_said(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        trials(KIND, bench(), options)


def test_sizes_follow_from_the_bench_and_few_realisations_are_warned_of() -> None:
    experiment: Experiment = experiments()[KIND]
    assert experiment.fit is not None
    assert experiment.warnings is not None
    told = experiment.fit(experiment.options(), bench())
    assert 0.0 < told["amplitude"].value <= np.deg2rad(20.0)
    few = ExcitationOptions.model_validate({"realisations": 3, "periods": 1})
    said = list(experiment.warnings(few, bench()))
    assert "realisations = 7" in said[0]
    assert "periods = 2" in said[1]
    assert not list(experiment.warnings(ExcitationOptions(), bench()))


# A file


PROTOCOL = """
[[test]]
name = "own"
kind = "excitation"
bench = "simulink"
signal = "file"
table = { file = "own.csv", value = "VALUE" }
"""


def planned_file(folder: Path, value: str, rows: str, more: str = "") -> Trial:
    (folder / "own.csv").write_text(f"time,value\n{rows}", encoding="utf-8")
    path = folder / "my.toml"
    path.write_text(PROTOCOL.replace("VALUE", value) + more, encoding="utf-8")
    plan = make_plan(load_protocol(path, experiments(), shipped=SHIPPED))
    check_limits(plan)
    return plan.trials[0]


def test_a_file_is_commanded_as_it_is_and_known_by_its_digest(tmp_path: Path) -> None:
    rows = "0,0\n1,5\n2,-5\n3,0\n"
    trial = planned_file(tmp_path, "deg/s", rows)
    assert isinstance(trial.task.command, Polyline)
    assert trial.task.command.values == pytest.approx(np.deg2rad([0.0, 5.0, -5.0, 0.0]))
    assert trial.task.duration == 3.0
    told = str(trial.options["table"])
    assert "SHA-256" in told
    changed = planned_file(tmp_path, "deg/s", rows.replace("5", "6"))
    assert str(changed.options["table"]) != told


def test_of_an_angle_the_rate_is_commanded(tmp_path: Path) -> None:
    time = np.linspace(0.0, 4.0, 401)
    angle = 5.0 * (1.0 - np.cos(0.5 * np.pi * time))
    rows = "".join(f"{t:.4f},{a:.9f}\n" for t, a in zip(time, angle, strict=True))
    command = planned_file(tmp_path, "deg", rows).task.command
    rate = np.deg2rad(2.5 * np.pi * np.sin(0.5 * np.pi * time))
    assert command.sample(time) == pytest.approx(rate, abs=1e-4)


def test_a_file_of_another_mode_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="is no unit of a rate"):
        planned_file(tmp_path, "N m", "0,0\n1,5\n")


# What is found


def test_a_series_tells_the_inertia_and_friction_of_the_bench() -> None:
    result = analyse(KIND, series())
    inertia, viscous = (finding(result, name).known for name in ("inertia", "viscous"))
    assert viscous.has_interval
    # The motor side turns with the load: its inertia is that of the axis, as the bench says it.
    assert holds(inertia, cast("float", bench().axis.inertia))
    drawn = ["command", "friction-over-rate", "residuals", "plane"]
    assert [figure.key for figure in result.figures] == drawn
    assert "inertia" in {each.quantity for each in result.key_numbers}


def turned(done: Done, factor: float) -> Done:
    """The same with its torque times a factor."""
    torque = done.samples.channels["drive_torque"]
    torque = replace(torque, samples=factor * torque.samples)
    samples = replace(done.samples, channels={**done.samples.channels, "drive_torque": torque})
    return replace(done, samples=samples)


def test_a_force_of_the_wrong_sign_has_no_inertia_and_no_friction() -> None:
    result = analyse(KIND, [turned(series()[0], -1.0)])
    assert finding(result, "inertia").known.value < 0.0
    for name in ("inertia", "coulomb_positive", "coulomb_negative"):
        assert finding(result, name).known.reason in UNPHYSICAL


@pytest.mark.parametrize("seed", [1, 2])
def test_what_friction_does_in_reversals_is_part_of_the_interval(seed: int) -> None:
    on = load_bench("platform")
    (trial,) = trials(KIND, on, {"signal": "fourier", "periods": 3, "seed": seed})
    played = execute([trial.model_copy(update={"seed": 100 + seed})])
    inertia = finding(analyse(KIND, played), "inertia").known
    assert "slow" in {each.source for each in inertia.systematic}
    assert holds(inertia, cast("float", on.axis.inertia))


@pytest.mark.parametrize(
    ("mode", "highest", "expected"),
    [("rate", 1.0, 25.0), ("rate", 4.0, 80.0), ("torque", 1.0, 100.0)],
)
def test_slow_series_have_fewer_rows(mode: str, highest: float, expected: float) -> None:
    """Friction as sliding sets in is in rows beside a reversal, which are left out with it."""
    command = MultiSine(frequencies=(0.5, highest), amplitudes=(1.0, 1.0), phases=(0.0, 0.0))
    trial = SimpleNamespace(task=SimpleNamespace(mode=mode, command=command))
    assert rows_of([SimpleNamespace(trial=trial)]) == expected  # type: ignore[list-item]


def test_multisines_tell_the_response_its_noise_and_distortion() -> None:
    result = analyse(KIND, shaken())
    (source,) = table(result, "responses").rows
    assert "7 realisations of 2 periods" in str(source["excitation"])
    (row,) = table(result, "distortion").rows
    even, odd = row["even"], row["odd"]
    assert isinstance(odd, float)
    # Friction of this bench is alike both ways: it distorts at odd lines.
    assert odd > 0.01
    assert even is None or cast("float", even) < 0.1 * odd
    crests = [cast("float", each["crest_factor"]) for each in table(result, "reached").rows]
    assert max(crests) < 1.75
    drawn = ["command", "bode-1-load", "distortion-1-load", "coherence"]
    assert [figure.key for figure in result.figures] == drawn


def test_a_dead_torque_sensor_tells_no_response() -> None:
    told, *_ = analyse(KIND, [turned(shaken()[0], 0.0)]).notes
    assert "drive_torque never changes" in told


def test_a_limit_is_held_beside_what_was_reached() -> None:
    (row,) = table(analyse(KIND, series()), "reached").rows
    limits = bench().limits
    assert limits is not None
    asked, reached = cast("float", row["command_peak"]), cast("float", row["top_rate"])
    assert reached == pytest.approx(asked, rel=0.1)
    assert 0.0 < cast("float", row["used"]) <= 1.0
    assert row["limit"] in ("angle", "rate", "torque")


# What identifies from them


def test_identification_takes_them() -> None:
    of_series, why = suitable("inverse_dynamics", series())
    assert len(of_series) == 1, why
    responses, why = suitable("frequency_response", shaken())
    assert len(responses) == 7, why


# Where they are executed


def shorten(backend: SerialBackend, most: int) -> None:
    """As if the controller had said that its arrays are that short."""
    session = cast("Any", backend)._session
    session.capabilities = replace(session.capabilities, longest_array=most)


def test_a_controller_plays_multisines_series_and_polylines() -> None:
    on = load_bench("platform")
    short = {"duration": "2 s", "lowest": "2 Hz", "highest": "10 Hz", "amplitude": "5 deg/s"}
    asked = [
        *trials(KIND, on, {**MULTISINE, "realisations": 1, "periods": 1}),
        *trials(KIND, on, {**short, "signal": "chirp"}),
        *trials(KIND, on, {**short, "signal": "noise", "realisations": 1}),
        *trials(KIND, on, {**FOURIER, "periods": 1}),
    ]
    with (
        controller("--speed", "max") as port,
        SerialBackend(SerialOptions(port=port)) as backend,
    ):
        for number, trial in enumerate(asked, start=1):
            played = trial.model_copy(update={"number": number})
            assert backend.refuses(played) is None
            recorder = MemoryRecorder()
            ending = backend.execute(played, recorder, lambda: False)
            assert ending.outcome is Outcome.COMPLETED, ending.reason
            (simulated,) = execute([played])
            recorded = recorder.recording(ending)
            assert recorded["gyro_rate"] == pytest.approx(
                simulated.samples["gyro_rate"], nan_ok=True
            )


def test_a_polyline_that_is_too_long_for_a_controller_is_refused_with_both_lengths() -> None:
    options = {"signal": "chirp", "duration": "2 s", "lowest": "2 Hz", "highest": "10 Hz"}
    (trial,) = trials(KIND, load_bench("platform"), {**options, "amplitude": "5 deg/s"})
    count = len(cast("Polyline", trial.task.command).times)
    with (
        controller("--speed", "max") as port,
        SerialBackend(SerialOptions(port=port)) as backend,
    ):
        shorten(backend, 100)
        ending: Ending = backend.execute(trial, MemoryRecorder(), lambda: False)
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.REFUSED)
        assert f"has {count} values" in ending.reason
        assert "takes 100 at most" in ending.reason
        shorten(backend, count)
        assert backend.execute(trial, MemoryRecorder(), lambda: False).fault is None


@pytest.mark.parametrize(
    "options", [{**MULTISINE, "realisations": 1}, {**MULTISINE, "signal": "chirp"}, FOURIER]
)
def test_they_are_handed_out_as_a_table(tmp_path: Path, options: dict[str, Any]) -> None:
    trial = trials(KIND, bench(), {**options, "duration": "4 s"})[0]
    backend = opened(tmp_path, (trial,))
    with backend:
        backend.execute(trial, MemoryRecorder(), lambda: False)
    path = tmp_path / "trial-00001" / "excitation.csv"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert rows[:, 1] == pytest.approx(trial.task.command.sample(rows[:, 0]), abs=1e-6)
    assert rows[-1, 0] == pytest.approx(trial.task.duration, abs=2e-3)
