"""The stabilization test: its numbers, and recordings whose standard deviation is known."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.estimation.intervals import with_error
from campaign.experiments.stabilization.comparisons import beside_rows
from campaign.experiments.stabilization.experiment import EXPERIMENT, StabilizationOptions
from tests.experiments.laboratory import analyse, execute, failed, finding, table, trials
from tests.physics.benches import bench

METHODS = [{"compensation": name} for name in ("none", "static", "lugre", "observer")]


def test_the_four_methods_of_tables_5_2_and_5_8() -> None:
    """0.48841 and 0.0660 within 0.2 %, 0.000595 and 0.000813 mrad within 2 %."""
    result = analyse("stabilization", execute(trials("stabilization", bench(), {}, METHODS)))
    expected = {
        "none": (0.48841e-3, 2e-3),
        "static": (0.0660e-3, 2e-3),
        "lugre": (0.000595e-3, 2e-2),
        "observer": (0.000813e-3, 2e-2),
    }
    for name, (error, tolerance) in expected.items():
        found = finding(result, "stabilization_error", compensation=name)
        assert found.value == pytest.approx(error, rel=tolerance)
        assert found.unit == "rad"
        assert found.conditions["frequency"] == 0.24
        assert found.conditions["acceleration"] == pytest.approx(np.deg2rad(18.0))
    ratio = finding(result, "error_reduction", compensation="static").value
    assert ratio == pytest.approx(0.48841 / 0.0660, rel=4e-3)
    assert {"relative-rate", "position-error", "compensation-torque"} <= {
        figure.key for figure in result.figures
    }
    for figure in result.figures:
        for panel in figure.panels:
            for curve in panel.curves:
                assert curve.x.shape == curve.y.shape
                assert np.all(np.isfinite(curve.y))


def test_repeats_are_averaged_and_their_spread_is_shown() -> None:
    done = execute(trials("stabilization", bench(), {"cycles": 1}, METHODS[:1]))[0]
    channel = done.samples.channels["pointing_error"]
    louder = replace(channel, samples=1.1 * channel.samples)
    changed = replace(done.samples, channels={**done.samples.channels, "pointing_error": louder})
    (row,) = table(
        analyse("stabilization", [done, replace(done, samples=changed)]), "stabilization-error"
    ).rows
    (alone,) = table(analyse("stabilization", [done]), "stabilization-error").rows
    assert row["repeats"] == 2
    assert row["error"] == pytest.approx(np.sqrt(1.1) * float(str(alone["error"])))
    assert row["spread"] == pytest.approx(0.1 * float(str(alone["error"])) / np.sqrt(2))


def test_the_window_is_the_cycles_after_the_settling() -> None:
    (trial,) = trials("stabilization", bench(), {"cycles": 3, "settle_cycles": 1})
    assert trial.task.window == pytest.approx((1 / 0.24, 4 / 0.24))
    assert trial.task.duration == pytest.approx(4 / 0.24)


def test_a_recording_too_slow_for_the_motion_is_refused() -> None:
    options = StabilizationOptions.model_validate({"frequency": "300 Hz"})
    with pytest.raises(ValueError, match="sample_rate"):
        list(EXPERIMENT.trials(options, bench()))


def test_failed_trials_and_empty_tests() -> None:
    done = execute(trials("stabilization", bench(), {"cycles": 1}, METHODS[:2]))
    result = analyse("stabilization", [failed(done[0]), done[1]])
    assert len(table(result, "stabilization-error").rows) == 1
    assert any("1 of 2 trials" in note for note in result.notes)
    assert not [f for f in result.findings if f.quantity == "error_reduction"]
    assert analyse("stabilization", [failed(done[0])]).findings == ()
    assert analyse("stabilization", ()).findings == ()


def twins(tree: dict) -> None:
    """Of the static model one that knows friction 20 % too small."""
    own = copy.deepcopy(tree["compensation"]["static"])
    own["friction"]["load"]["coulomb_torque"] = "20.8 N m"
    tree["compensation"]["static-identified"] = own


def test_an_identified_compensation_stands_beside_the_one_it_replaces() -> None:
    methods = [{"compensation": name} for name in ("none", "static", "static-identified")]
    done = execute(trials("stabilization", bench(twins), {"cycles": 1}, methods))
    result = analyse("stabilization", done)
    (row,) = table(result, "identified-beside-stated").rows
    stated, identified = (
        finding(result, "stabilization_error", compensation=name).value
        for name in ("static", "static-identified")
    )
    assert (row["compensation"], row["frequency"]) == ("static", 0.24)
    assert float(str(row["ratio"])) == pytest.approx(identified / stated)
    assert identified > 1.5 * stated
    assert not [t for t in analyse("stabilization", done[:2]).tables if "beside" in t.key]


def test_ratios_of_several_trials_have_intervals_and_are_of_one_place() -> None:
    def error(value: float) -> Estimate:
        return with_error("stabilization_error", value, "rad", 0.01 * value, 4, "test")

    rows = [
        {"compensation": name, "frequency": frequency, "error": error(value), "repeats": 5}
        for name, frequency, value in (
            ("lugre", 0.2, 2.0),
            ("lugre-identified", 0.2, 1.0),
            ("lugre", 2.0, 1.0),
            ("lugre-identified", 2.0, 1.0),
            ("static-identified", 2.0, 1.0),  # of what was not tried
        )
    ]
    first, second = beside_rows(rows)
    assert first["ratio"].value == 0.5
    assert first["ratio"].low < 0.5 < first["ratio"].high < 0.53
    assert second["ratio"].low < 1.0 < second["ratio"].high
