"""Frequency responses held against unseen runs, on rotary and linear benches, and their levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.backends.sim import SimBackend, SimOptions
from campaign.channels import COMMAND, DRIVE_TORQUE, GYRO_RATE
from campaign.errors import UsageError
from campaign.estimation.frequency.multisine import odd_grid, random_phases
from campaign.identify import experiments_by_model
from campaign.identify.identification import Identification, identify
from campaign.identify.material import ChosenRun, choose
from campaign.identify.page import _looks, write_identification
from campaign.protocol import as_tree
from campaign.resources import protocols_folder, templates_folder
from campaign.result import Result, Table
from campaign.trial import Task
from tests.archives import archived, executed, plan_of
from tests.estimation.coverage import holds
from tests.estimation.frequency import test_best_linear as static
from tests.experiments.asked import asked
from tests.experiments.test_frequency_response_model import (
    DRIVE,
    GRID,
    Answer,
    answered,
    driven,
    trials,
)


def run_of(folder: Path, answer: Answer, first: int = 0, count: int = 7) -> list[ArchivedTrial]:
    """Trials of an archive of multisines of its own phases."""
    return list(chosen(folder, answer, first, count).trials)


def chosen(folder: Path, answer: Answer, first: int = 0, count: int = 7) -> ChosenRun:
    folder.mkdir()
    commands = [random_phases(GRID, 5.0, first + k) for k in range(count)]
    made = trials(folder, commands, "torque", 16.0)
    path = archived(folder / "results", [(each, answered(each, answer)) for each in made])
    return choose(path.parent, path.name)


def held(own: Sequence[ArchivedTrial], unseen: Sequence[ArchivedTrial]) -> Result:
    return asked("frequency_response", own, unseen)


def table(found: Result, key: str) -> Table:
    return next(each for each in found.tables if each.key == key)


@pytest.mark.slow
def test_an_unseen_run_is_predicted_line_by_line_and_over_time(tmp_path: Path) -> None:
    own, unseen = run_of(tmp_path / "a", driven()), run_of(tmp_path / "b", driven(), 100)
    found = held(own, unseen)
    rows = table(found, "validation").rows
    assert [row["model"] for row in rows] == ["rational function", "two inertias"]
    for row in rows:
        assert row["verdict"] == "as closely as scatter allows"
        assert row["square"] == pytest.approx(1.0, abs=0.35)
    lines = table(found, "validation-lines").rows
    assert len(lines) == 2 * len(GRID.excited)
    sizes = np.array([row["deviations"] for row in lines], dtype=float)
    assert 0.7 < np.mean(sizes**2) < 1.6
    # Noise of a hundredth of the rate is what the simulated output is off by.
    outputs = {
        (row["data"], row["model"]): row["error"] for row in table(found, "output-error").rows
    }
    assert len(outputs) == 4
    for data in ("fitted", "unseen"):
        assert 0.002 < outputs[data, "two inertias"].value < 0.02
    keys = [figure.key for figure in found.figures]
    assert keys[:2] == ["prediction-1-load", "output-1-load"]
    assert "residuals-1-load" in keys


@pytest.mark.slow
def test_a_drive_that_has_changed_is_not_predicted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = run_of(tmp_path / "a", driven())
    softer = replace(DRIVE, stiffness=0.97 * DRIVE.stiffness)
    monkeypatch.setattr("tests.experiments.test_frequency_response_model.DRIVE", softer)
    found = held(own, run_of(tmp_path / "b", driven(), 100))
    for row in table(found, "validation").rows:
        assert "times the square" in str(row["verdict"])
    unseen = [row["error"] for row in table(found, "output-error").rows if row["data"] == "unseen"]
    fitted = [row["error"] for row in table(found, "output-error").rows if row["data"] == "fitted"]
    assert unseen[0].low > fitted[0].high


@pytest.mark.slow
def test_the_same_samples_are_refused_whatever_run_they_are_in(tmp_path: Path) -> None:
    own = chosen(tmp_path / "a", driven())
    again = chosen(tmp_path / "b", driven(), count=8)  # of which one is new
    assert own.run.identity != again.run.identity
    with pytest.raises(UsageError, match="the same samples as"):
        identify(own, experiments_by_model(), models=("frequency_response",), validation=again)


@pytest.mark.slow
def test_the_same_phases_are_told(tmp_path: Path) -> None:
    """Other noise, but the same torque: friction would add the same to both."""
    again = driven()
    again(np.random.default_rng(0).standard_normal(4096))  # its noise has gone on
    found = held(run_of(tmp_path / "a", driven()), run_of(tmp_path / "b", again))
    assert any("with the same phases" in note for note in found.notes)
    other = held(run_of(tmp_path / "c", driven()), run_of(tmp_path / "d", driven(), 100))
    assert not any("with the same phases" in note for note in other.notes)


@pytest.mark.slow
def test_correlations_and_condition_are_told(tmp_path: Path) -> None:
    found = held(run_of(tmp_path / "a", driven()), ())
    assert found.identified.correlations["stiffness", "load_inertia"] > 0.5
    assert all(-1.0 <= share <= 1.0 for share in found.identified.correlations.values())
    conditions = [row["condition"] for row in table(found, "functions").rows]
    assert all(1.0 <= each < 1e6 for each in conditions)
    pairs = table(found, "correlations").rows
    assert len(pairs) == len(found.identified.correlations)


@pytest.mark.slow
def test_levels_of_a_static_nonlinearity_have_their_closed_form_in_decibels(tmp_path: Path) -> None:
    """y = u + b u² + a u³ in the band and line by line; the excitation stands beside them."""
    grid = odd_grid(0.5, 100.0, 4.0, 1)
    tmp_path = tmp_path / "static"
    tmp_path.mkdir()
    commands = [random_phases(grid, static.RMS, k) for k in range(12)]
    random = np.random.default_rng(2)

    def answer(torque: np.ndarray) -> dict[str, np.ndarray]:
        bent = torque + static.QUADRATIC * torque**2 + static.CUBIC * torque**3
        rate = bent + 1e-3 * random.standard_normal(len(torque))
        return {COMMAND: torque, DRIVE_TORQUE: torque, GYRO_RATE: rate}

    made = trials(tmp_path, commands, "torque", 8.0)
    path = archived(tmp_path / "results", [(each, answered(each, answer)) for each in made])
    found = held(choose(path.parent, path.name).trials, ())
    even, odd = static.powers(grid.excited, static.QUADRATIC, static.CUBIC)
    gain = 1 + 3 * static.CUBIC * static.RMS**2
    band = np.arange(grid.excited[0], grid.excited[-1] + 1)
    output = gain**2 * static.RMS**2 + np.sum(odd[grid.excited])
    row = table(found, "distortion").rows[0]
    for name, powers in (("even", even[band[band % 2 == 0]]), ("odd", odd[band[band % 2 == 1]])):
        assert holds(row[f"{name}_level"], 10 * np.log10(np.sum(powers) / output)), name
    told = str(row["excitation"])
    assert "rms 0.8 N·m" in told
    assert "12 realisations of 2 periods" in told
    assert f"{len(grid.excited)} lines from 0.75 to" in told
    # Line by line: over the linear output of an excited line.
    beside = gain**2 * static.RMS**2 / len(grid.excited)
    for name, powers in (("even", even), ("odd", odd), ("excited", odd)):
        rows = [each for each in table(found, "distortion-lines").rows if each["line"] == name]
        at = [round(float(each["frequency"]) * 4.0) for each in rows]
        expected = 10 * np.log10(powers[at] / beside)
        hits = [holds(each["level"], truth) for each, truth in zip(rows, expected, strict=True)]
        assert np.mean(hits) > 0.88, name
        values = np.array([each["level"].value for each in rows])
        assert np.mean(values - expected) == pytest.approx(-0.1, abs=0.5), name


# A linear axis ------------------------------------------------------------------------------------

PROTOCOL = """
title = "Linear"

[[test]]
name = "shaken"
kind = "presliding_multisine"
bench = "./rig.toml"
amplitudes = ["5 N"]
"""
APPENDAGE = """[appendage]
inertia = "5 kg"
frequency = "25 Hz"
damping_ratio = 0.02

[motor]
"""


def shaken(
    folder: Path,
    first: int,
    appendage: bool = True,
    sizes: tuple[float, ...] = (150.0, 300.0),
    count: int = 7,
) -> Path:
    """The shipped linear bench, simulated: multisines of force, of these rms (N) as asked for."""
    folder.mkdir()
    text = (protocols_folder() / "benches" / "linear.toml").read_text(encoding="utf-8")
    if appendage:
        text = text.replace("[motor]\n", APPENDAGE, 1)
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    plan = plan_of(folder, PROTOCOL)
    grid, made = odd_grid(1.0, 100.0, 4.0, 3), []
    for rms in sizes:
        for seed in range(count):
            command = random_phases(grid, rms, first + seed, draws=30)
            task = Task(
                mode="torque", command=command, duration=8.0, window=(0.0, 8.0), sample_rate=1000.0
            )
            update = {
                "number": len(made) + 1,
                "task": task,
                "windows": (),
                "point": {"rms": rms, "realisation": seed},
            }
            made.append(plan.trials[0].model_copy(update=update))
    tests = as_tree(plan)["tests"]
    return executed(folder / "results", made, SimBackend(SimOptions()), tests)


def identified(path: Path, unseen: Path | None = None) -> Identification:
    other = choose(unseen.parent, unseen.name) if unseen is not None else None
    return identify(
        choose(path.parent, path.name),
        experiments_by_model(),
        models=["frequency_response"],
        validation=other,
    )


@pytest.fixture(scope="module")
def linear(tmp_path_factory: pytest.TempPathFactory) -> tuple[Identification, Path]:
    """The linear bench with its appendage, held against an unseen run, and its page."""
    folder = tmp_path_factory.mktemp("linear")
    found = identified(shaken(folder / "a", 0), shaken(folder / "b", 100, count=4))
    page = write_identification(found, folder / "page", templates_folder(), "campaign identify")
    return found, page


@pytest.mark.slow
def test_a_linear_bench_has_masses_in_its_own_units(linear: tuple[Identification, Path]) -> None:
    found, page = linear
    told = {each.estimate.name: each for each in found.parameters}
    stiffness = (2 * np.pi * 25.0) ** 2 * 5.0
    for name, truth, unit in (
        ("total_inertia", 27.9, "kg"),
        ("motor_inertia", 22.9, "kg"),
        ("load_inertia", 5.0, "kg"),
        ("stiffness", stiffness, "N/m"),
        ("antiresonance", 25.0, "Hz"),
    ):
        estimate = told[name].estimate
        assert estimate.unit == unit
        assert told[name].display in ("", unit)
        assert holds(estimate, truth), name
        assert estimate.value == pytest.approx(truth, rel=0.05), name
    assert told["damping"].estimate.unit == "N s/m"
    assert "nertia" not in " ".join(each.meaning + each.advice for each in found.parameters)
    (section,) = found.sections
    assert section.result is not None
    result = section.result
    assert any("N, crest" in str(r["excitation"]) for r in table(section.result, "responses").rows)
    # The unseen run of the same strength is predicted; a weaker one is another response.
    verdicts = {
        (str(row["source"]), row["model"]): row["verdict"]
        for row in table(section.result, "validation").rows
    }
    assert verdicts["shaken, force, rms 300 N", "two masses"] == "as closely as scatter allows"
    assert "times the square" in str(verdicts["shaken, force, rms 150 N", "two masses"])
    assert any("before the force" in note for note in result.notes)
    text = page.read_text(encoding="utf-8")
    assert "Problems with this page" not in text
    assert "kg·m²" not in text
    assert "rad" not in " ".join(axis_units(found))


def axis_units(found: Identification) -> list[str]:
    """Units of the figures' axes."""
    (section,) = found.sections
    assert section.result is not None
    panels = [panel for each in section.result.figures for panel in each.panels]
    return [axis.unit for panel in panels for axis in (panel.x, panel.y) if axis.label != "Phase"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "first", [*(pytest.param(n, marks=pytest.mark.statistics) for n in (0, 1000)), 5000]
)
def test_a_rigid_carriage_is_one_mass(tmp_path: Path, first: int) -> None:
    """With the last two a second mass that nothing tells fits better by Schwarz' criterion."""
    found = identified(shaken(tmp_path / "rigid", first, False, (140.0, 280.0)))
    told = {each.estimate.name: each for each in found.parameters}
    assert holds(told["total_inertia"].estimate, 27.9)
    assert told["total_inertia"].estimate.half_width < 3.0
    assert not told["stiffness"].estimate.has_interval
    assert "one mass explains" in str(told["stiffness"].estimate.reason)


@pytest.mark.slow
def test_a_model_has_one_colour_all_over_the_page(linear: tuple[Identification, Path]) -> None:
    """It stands beside the measurement in one figure, and alone in another."""
    found, page = linear
    figures = sorted((page.parent / "figures").glob("*.svg"))
    told = {path.name: path.read_text(encoding="utf-8") for path in figures}
    prediction = next(text for name, text in told.items() if "prediction-1" in name)
    residuals = next(text for name, text in told.items() if "residuals-1" in name)
    looks = _looks(found)
    names = ("rational function", "two inertias")
    assert len({looks[name].light for name in names}) == len(names)
    for name in names:
        assert looks[name].light in prediction
        assert looks[name].light in residuals
