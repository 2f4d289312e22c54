"""The sensitivity study: thresholds of made-up curves, which trials vary what, and the ranking."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.estimation.threshold import Threshold
from campaign.experiments.sensitivity.experiment import EXPERIMENT, SensitivityOptions
from campaign.experiments.sensitivity.results import RANK, Response, judge, ranking
from campaign.recording import Channel, Recording
from tests.experiments.laboratory import (
    MADE_UP,
    Done,
    analyse,
    execute,
    failed,
    finding,
    table_of_estimates,
    trials,
)
from tests.physics.benches import bench

CHANGES = np.array([-0.8, -0.4, -0.2, 0.0, 0.2, 0.4, 0.8])


def test_rank_is_by_threshold_and_then_by_the_largest_error() -> None:
    def response(slope: float) -> Response:
        errors = (
            Estimate.without_interval("error", 0.1 + slope * abs(change), "rad", MADE_UP())
            for change in CHANGES
        )
        return Response(CHANGES, tuple(errors), np.zeros((0, 2)))

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


def test_a_rank_says_with_whom_it_may_change_places() -> None:
    """Thresholds 0.50 and 0.53 of a deviation near 0.02 overlap; 0.1 and a bound of 0.8 do not."""

    def response(slope: float) -> Response:
        values = 0.1 * (1 + slope * np.abs(CHANGES))
        errors = (Estimate("e", float(v), "", standard_error=2e-3) for v in values)
        return Response(CHANGES, tuple(errors), np.zeros((0, 2)))

    responses = {"a": response(2.0), "b": response(1.9), "c": response(10.0), "d": response(0.1)}
    judged = {one.parameter: one for one in judge(responses, Threshold(0.2))}
    assert [judged[name].rank.value for name in "abcd"] == [2, 3, 1, 4]
    assert str(judged["a"].rank.reason).endswith("may change places with b")
    assert str(judged["b"].rank.reason).endswith("may change places with a")
    for alone in "cd":
        assert judged[alone].rank.reason in RANK
    assert [judged[name].passed for name in "abcd"] == [True, True, True, False]


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
        assert finding(result, "sensitivity_rank", parameter=parameter).estimate.kind == "count"
    reached = finding(result, "sensitivity_threshold", parameter="coulomb_torque").estimate
    assert reached.low < 0.10 < reached.high
    order = finding(result, "sensitivity_rank", parameter="static_torque").estimate.reason
    assert order in RANK  # no interval reaches its neighbours
    cut_off = analyse("sensitivity", [*done[:-1], failed(done[-1])])
    assert not [f for f in cut_off.findings if f.quantity.startswith("sensitivity_")]
    assert any("need every trial" in note for note in cut_off.notes)
    rows = {row["parameter"]: row for row in table_of_estimates(result, "sensitivity").rows}
    bound = rows["stribeck_velocity"]["threshold"]
    assert (bound.kind, bound.value) == ("at least", 0.75)
    assert rows["stribeck_velocity"]["said"] == "none below 75%"
    thresholds, figure = result.figures
    assert figure.thesis == ("5.14",)
    assert len(figure.panels) == 3
    assert {curve.quantity for curve in thresholds.panels[0].curves} == {"sensitivity_threshold"}
    compared = [curve.quantity for curve in cut_off.figures[0].panels[0].curves]
    assert not any(compared), "what is not compared has no published marks"
    relative = {**options, "threshold_ratio": 1.5}
    again = [
        replace(d, trial=d.trial.model_copy(update={"options": {**d.trial.options, **relative}}))
        for d in done
    ]
    found = finding(
        analyse("sensitivity", again), "sensitivity_threshold", parameter="static_torque"
    )
    assert found.value == pytest.approx(0.25, rel=1e-2)


def test_every_trial_of_the_error_has_a_metric_and_a_model_alone_has_none() -> None:
    options = {"parameters": ["coulomb_torque"], "changes": [0.3], "repeats": 1, "cycles": 2}
    done = execute(trials("sensitivity", bench(), options))
    for item in done:
        names = [window.name for window in item.trial.windows]
        if item.trial.task.mode == "rate":
            assert names == ["measured", "shown"]
            (error,) = EXPERIMENT.measure(item)
            cut = item.samples.window(*item.trial.task.window)
            assert error.value == pytest.approx(float(np.std(cut["pointing_error"])), rel=1e-3)
        else:
            assert names == ["reversal", "cycle"]
            assert EXPERIMENT.measure(item) == []
    older = [replace(d, trial=d.trial.model_copy(update={"windows": ()})) for d in done]
    was, now = analyse("sensitivity", older), analyse("sensitivity", done)
    assert was.findings == now.findings
    for one, other in zip(was.figures, now.figures, strict=True):
        for panel, same in zip(one.panels, other.panels, strict=True):
            for curve, again in zip(panel.curves, same.curves, strict=True):
                np.testing.assert_array_equal(curve.y, again.y)


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
