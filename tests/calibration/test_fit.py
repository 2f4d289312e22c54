"""Known parameters of a bench are found again from a table worked out by hand."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from campaign.calibration.document import result_text
from campaign.calibration.objective import Simulation
from campaign.calibration.outcome import CalibrationOutcome, calibrate
from campaign.cli.calibrate import _rows
from campaign.errors import UsageError
from campaign.estimation.multi_start import Progress
from campaign.estimation.unknowns import shares_of
from campaign.experiments import experiments

from .laboratory import FREQUENCIES, INERTIA, PROTOCOL, VISCOUS, error, problem, table, write

ONE_START = PROTOCOL.replace("starts = 2", "starts = 1")


def run(path: Path, workers: int = 1, leave_out: bool = False) -> CalibrationOutcome:
    return calibrate(
        problem(path),
        experiments(),
        workers=workers,
        display=lambda progress: None,
        leave_out=leave_out,
    )


@pytest.mark.slow
def test_recovers_the_truth_from_a_closed_form(tmp_path: Path) -> None:
    outcome = run(write(tmp_path), leave_out=True)
    inertia, viscous = outcome.values
    assert inertia == pytest.approx(INERTIA, rel=5e-3)
    assert viscous == pytest.approx(VISCOUS, rel=5e-3)
    assert outcome.uncertainty is not None
    for value, share, half in zip(
        shares_of(outcome.problem.space.unknowns, (INERTIA, VISCOUS)),
        outcome.shares,
        outcome.uncertainty.half_width,
        strict=True,
    ):
        assert abs(value - share) < half < 0.2
    assert outcome.cost < 0.1 < outcome.cost_before
    result = tomllib.loads(result_text(outcome, "b.toml"))
    assert result["fit"]["starts_that_agree"] == 2
    assert result["cells"] == ["A.1"]
    assert [cell["published"] for cell in result["cell"]] == pytest.approx(
        [1e6 * error(f) for f in FREQUENCIES], rel=1e-5
    )
    assert result["fit"]["worst_deviation_percent"] < 1
    assert [left["value"] for left in result["leave_one_out"]["without"]] == list(FREQUENCIES)
    assert result["leave_one_out"]["worst_deviation_percent"] < 1


@pytest.mark.slow
def test_disagreeing_cells_widen_the_intervals_and_spoil_predictions(tmp_path: Path) -> None:
    scale = (1.1, 0.9, 1.1, 0.9)
    outcome = run(write(tmp_path, ONE_START, published=table(scale)), leave_out=True)
    assert outcome.uncertainty is not None
    assert outcome.uncertainty.scatter > 2
    result = tomllib.loads(result_text(outcome, "b.toml"))
    left, fit = result["leave_one_out"], result["fit"]
    assert left["worst_deviation_percent"] > fit["worst_deviation_percent"] > 5
    assert left["fitted_worst_deviation_percent"] == fit["worst_deviation_percent"]


@pytest.mark.slow
def test_neither_workers_nor_repetition_change_a_digit(tmp_path: Path) -> None:
    path = write(tmp_path, PROTOCOL.replace("max_evaluations = 30", "max_evaluations = 3"))
    texts = {result_text(run(path, workers), "b.toml") for workers in (1, 2, 1)}
    assert len(texts) == 1


@pytest.mark.slow
def test_names_a_parameter_that_no_cell_depends_on(tmp_path: Path) -> None:
    idle = """
[[calibration.parameter]]
name = "idle"
path = "compensation.static.gain"
lower = 0.1
upper = 1.0
"""
    path = write(tmp_path, ONE_START + idle)
    result = tomllib.loads(result_text(run(path), "b.toml"))
    by_name = {entry["name"]: entry for entry in result["parameter"]}
    assert not by_name["idle"]["identified"]
    assert "not determined" in by_name["idle"]["note"]
    assert "interval_95" not in by_name["idle"]
    assert by_name["inertia"]["identified"]
    assert "interval_95" in by_name["inertia"]
    assert "interval_95_wide" not in by_name["inertia"]


@pytest.mark.slow
def test_names_a_parameter_at_its_bound(tmp_path: Path) -> None:
    narrow = ONE_START.replace('lower = "20 kg m^2"', 'lower = "45 kg m^2"')
    outcome = run(write(tmp_path, narrow))
    result = tomllib.loads(result_text(outcome, "b.toml"))
    inertia, viscous = result["parameter"]
    assert "lower bound" in inertia["note"]
    assert "interval_95" not in inertia
    assert 45 < float(inertia["limit_95"].split()[0]) < 80
    low, high, wide_low, wide_high = (
        float(end.split()[0]) for end in viscous["interval_95"] + viscous["interval_95_wide"]
    )
    assert wide_low <= low < high <= wide_high
    assert (wide_low, wide_high) != (low, high)
    shown = [row[2] for row in _rows(outcome)]
    assert shown == [f"at most {inertia['limit_95']}", " to ".join(viscous["interval_95_wide"])]
    assert not inertia["identified"]
    assert inertia["value"] == "45 kg m^2"


def test_one_parameter_drives_several_fields(tmp_path: Path) -> None:
    both = PROTOCOL.replace(
        'path = "friction.load.viscous_friction"',
        'paths = ["friction.load.viscous_friction", "friction.load.negative.viscous_friction"]\n'
        "factors = [2.0, 1.0]",
    ).replace('lower = "5 N', 'lower = "2 N')
    path = write(tmp_path, both)
    bench = (tmp_path / "bench.toml").read_text()
    negative = 'negative = { viscous_friction = "3 N m s/rad" }\n[controller.rate]'
    (tmp_path / "bench.toml").write_text(bench.replace("[controller.rate]", negative))
    made = problem(path)
    tree = made.space.bench(made.calibration.bench.tree, (35.0, 7.0))
    assert tree["friction"]["load"]["viscous_friction"] == "14.0 N m s/rad"
    assert tree["friction"]["load"]["negative"]["viscous_friction"] == "7.0 N m s/rad"
    assert tree["axis"]["inertia"] == "35.0 kg m^2"


def test_a_bench_that_breaks_its_limits_counts_and_does_not_crash(tmp_path: Path) -> None:
    path = write(tmp_path)
    bench = (tmp_path / "bench.toml").read_text()
    (tmp_path / "bench.toml").write_text(bench.replace('"500 A"', '"1 mA"'))
    simulation = Simulation(problem(path), experiments(), 1)
    evaluation = simulation.check()
    assert evaluation.found == {}
    assert "current limit" in evaluation.problems[0]
    # Each counts as wrong by a factor of 100, in standard deviations of 1 %.
    np.testing.assert_allclose(simulation.residuals((35.0, 12.0)), np.log(100) / 0.01)


def test_a_cell_that_no_test_measures_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, PROTOCOL.replace('"6 Hz", ', ""))
    with pytest.raises(UsageError, match=r"finds A\.1/6\.0/error; sweep"):
        run(path)


def test_ctrl_c_keeps_the_best_so_far(tmp_path: Path) -> None:
    seen: list[Progress] = []

    def press(progress: Progress) -> None:
        seen.append(progress)
        if len(seen) == 3:
            raise KeyboardInterrupt

    outcome = calibrate(problem(write(tmp_path)), experiments(), workers=2, display=press)
    assert outcome.interrupted
    assert outcome.cost == min(progress.cost for progress in seen) < outcome.cost_before
    assert outcome.uncertainty is None
    result = tomllib.loads(result_text(outcome, "b.toml"))
    assert result["finished"] is False
    assert "interrupted" in result["fit"]["notes"][0]
