"""The sensitivity study: thresholds of made-up curves, which trials vary what, and the ranking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from campaign.experiments.sensitivity import (
    EXPERIMENT,
    Response,
    SensitivityOptions,
    crossing,
    ranking,
)
from campaign.trial import Channel, Recording
from tests.experiments.laboratory import Done, analyse, execute, failed, finding, table, trials
from tests.physics.benches import bench

CHANGES = np.array([-0.8, -0.4, -0.2, 0.0, 0.2, 0.4, 0.8])


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        # 0.1 + 0.5 |x| passes 0.2 at 0.2 exactly where a straight line says so
        (0.1 + 0.5 * np.abs(CHANGES), 0.2),
        # steeper below: 0.1 + |x| at -0.1 (interpolated), 0.1 + x/4 above at 0.4
        (np.where(CHANGES < 0, 0.1 - CHANGES, 0.1 + 0.25 * CHANGES), 0.1),
        # passed on one side only, between 0.4 (0.15) and 0.8 (0.35): 0.4 + 0.4 * 0.05 / 0.2
        (np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.15, 0.35]), 0.5),
        # a return below the threshold does not undo the first passing
        (np.array([0.1, 0.1, 0.3, 0.1, 0.1, 0.1, 0.1]), 0.1),
        (np.full(7, 0.2), None),  # reached, never passed
        (np.full(7, 0.21), 0.0),
    ],
)
def test_where_a_curve_passes_the_threshold(error: np.ndarray, expected: float | None) -> None:
    found = crossing(CHANGES, error, 0.2)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-12))


def test_rank_is_by_threshold_and_then_by_the_largest_error() -> None:
    def response(slope: float) -> Response:
        return Response(CHANGES, 0.1 + slope * np.abs(CHANGES), np.zeros((0, 2)))

    ranks = ranking(
        {
            "flat": response(0.0),
            "mild": response(0.1),
            "steep": response(1.0),
            "some": response(0.3),
        },
        0.2,
    )
    assert ranks == {"steep": 1, "some": 2, "mild": 3, "flat": 4}


def test_each_trial_varies_one_parameter_of_the_model_and_none_of_the_bench() -> None:
    planned = trials("sensitivity", bench(), {"changes": [-0.5, 0.2], "repeats": 2, "cycles": 1})
    swept = [t for t in planned if t.task.mode == "rate"]
    assert len(swept) == 2 * (1 + 6 * 2)
    truth = bench().model_dump(mode="json")
    for trial in swept:
        parameter, change = trial.point["parameter"], trial.point["change"]
        assert trial.bench["friction"] == truth["friction"]
        for interface, model in trial.bench["compensation"]["lugre"]["friction"].items():
            known = truth["compensation"]["lugre"]["friction"][interface]
            differs = {key for key in model if model[key] != known[key]}
            assert differs == ({parameter} if parameter else set())
            if parameter:
                assert model[parameter] == pytest.approx(known[parameter] * (1 + change))


def test_both_directions_of_a_model_are_varied() -> None:
    def asymmetric(tree):
        tree["compensation"]["lugre"]["friction"]["load"]["negative"] = {"coulomb_torque": "20 N m"}

    planned = trials(
        "sensitivity",
        bench(asymmetric),
        {"parameters": ["coulomb_torque"], "changes": [0.5], "repeats": 1, "model_output": False},
    )
    varied = planned[-1].bench["compensation"]["lugre"]["friction"]["load"]
    assert varied["coulomb_torque"] == pytest.approx(39.0)
    assert varied["negative"]["coulomb_torque"] == pytest.approx(30.0)


def test_what_cannot_be_varied_is_skipped_and_said() -> None:
    options = {
        "parameters": ["coulomb_torque", "bristle_damping"],
        "compensation": "static",
        "changes": [-1.5, 0.2],
        "repeats": 1,
        "cycles": 1,
        "settle_cycles": 0,
        "model_output": False,
    }
    planned = trials("sensitivity", bench(), options)
    assert [t.point["change"] for t in planned] == [0.0, 0.2]
    result = analyse("sensitivity", execute(planned))
    assert any("no bristle_damping" in note for note in result.notes)
    assert any("coulomb_torque -150% was skipped" in note for note in result.notes)


def test_options_that_do_not_go_with_the_bench_are_refused() -> None:
    for wrong, said in (
        ({"compensation": "observer"}, "no friction model"),
        ({"compensation": "lugra"}, "no compensation 'lugra'"),
        ({"parameters": ["colomb"]}, "has none of colomb"),
    ):
        with pytest.raises(ValueError, match=said):
            list(EXPERIMENT.trials(SensitivityOptions.model_validate(wrong), bench()))


def made_up(done: Done, error: float) -> Done:
    """The trial, had it recorded a pointing error with this standard deviation."""
    _, stop = done.trial.task.window
    time = np.arange(0.0, stop, 0.01)
    samples = error * np.sqrt(2) * np.sin(2 * np.pi * 0.24 * time)
    channel = Channel("pointing_error", "rad", "", "mrad", samples)
    return Done(done.trial, done.ending, Recording(time, {"pointing_error": channel}))


def test_thresholds_and_ranking_of_made_up_errors() -> None:
    """Error 0.1 (1 + k |x|) mrad with k = 10 and 2: 0.2 mrad at 10 % and 50 %; k = 1: at none."""
    slopes = {"": 0.0, "coulomb_torque": 10.0, "static_torque": 2.0, "stribeck_velocity": 1.0}
    options = {
        "parameters": [name for name in slopes if name],
        "changes": [-0.75, -0.5, -0.25, 0.25, 0.5, 0.75],
        "repeats": 2,
        "model_output": False,
    }
    planned = trials("sensitivity", bench(), options)
    some = execute(planned[:1])[0]
    done = []
    for trial in planned:
        error = 1e-4 * (1 + slopes[trial.point["parameter"]] * abs(trial.point["change"]))
        wobble = 1.02 if trial.point["repetition"] == 1 else 0.98  # the mean counts
        done.append(made_up(replace(some, trial=trial), error * wobble))
    result = analyse("sensitivity", done)
    for parameter, threshold, rank, passed in (
        ("coulomb_torque", 0.10, 1, True),
        ("static_torque", 0.50, 2, True),
        ("stribeck_velocity", 0.75, 3, False),
    ):
        found = finding(result, "sensitivity_threshold", parameter=parameter)
        assert found.value == pytest.approx(threshold, rel=2e-3)
        assert found.lower_bound is not passed
        assert finding(result, "sensitivity_rank", parameter=parameter).value == rank
    cut_off = analyse("sensitivity", [*done[:-1], failed(done[-1])])
    assert not [f for f in cut_off.findings if f.quantity.startswith("sensitivity_")]
    assert any("need every trial" in note for note in cut_off.notes)
    rows = {row["parameter"]: row for row in table(result, "sensitivity").rows}
    assert rows["stribeck_velocity"]["threshold"] is None
    assert rows["stribeck_velocity"]["said"] == "none below 75%"
    (figure,) = result.figures
    assert figure.thesis == ("5.14",)
    assert len(figure.panels) == 3
    relative = {**options, "threshold_ratio": 1.5}
    again = [
        replace(d, trial=d.trial.model_copy(update={"options": {**d.trial.options, **relative}}))
        for d in done
    ]
    found = finding(
        analyse("sensitivity", again), "sensitivity_threshold", parameter="static_torque"
    )
    assert found.value == pytest.approx(0.25, rel=1e-2)


def test_failed_trials_leave_the_others_alone() -> None:
    done = execute(
        trials(
            "sensitivity",
            bench(),
            {"parameters": ["coulomb_torque"], "changes": [0.3], "repeats": 1, "cycles": 1},
        )
    )
    assert analyse("sensitivity", [failed(item) for item in done]).tables == ()
    without_reference = [failed(done[0]), *done[1:]]
    notes = analyse("sensitivity", without_reference).notes
    assert any("unchanged model" in note for note in notes)


def test_the_model_s_output_is_its_steady_curve_away_from_reversals() -> None:
    """Figures 5.12, 5.13: at full rate the torque is Tc' + sigma2 v, with the varied Tc'."""
    options = {"parameters": ["coulomb_torque"], "changes": [0.3], "repeats": 1, "cycles": 1}
    planned = [t for t in trials("sensitivity", bench(), options) if t.task.mode == "prescribed"]
    assert [t.point["change"] for t in planned] == [0.0, -0.5, 0.5]
    largest = np.deg2rad(18.0) / (2 * np.pi * 0.24)
    viscous = (4.0 + 141.176 * 0.001) * largest
    coulomb = 26.0 + 141.176 * 0.03
    for item in execute(planned):
        expected = coulomb * (1 + item.trial.point["change"]) + viscous
        at = np.argmin(np.abs(item.samples.time - 0.25 / 0.24))
        assert item.samples["compensation_torque"][at] == pytest.approx(expected, rel=2e-3)
    result = analyse("sensitivity", execute(trials("sensitivity", bench(), options)))
    assert ("5.13",) in [figure.thesis for figure in result.figures]
