"""Repeatability: which trials make a set, and the statistics of Table 4.4 from its own columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation.scatter import relative_scatter
from campaign.experiments.friction_map.repeated_maps import scatter_figure
from campaign.experiments.repeatability import DOUBTFUL, MapSet
from campaign.experiments.repeatability import _deviation as deviation_of
from campaign.experiments.repeatability import _mean as over_maps
from tests.experiments.laboratory import MADE_UP, analyse, execute, finding, table, trials
from tests.physics.benches import bench

FAST = {
    "speeds": [f"{v} deg/s" for v in (0.5, 1, 1.5, 2, 3, 5, 10, 20, 40)],
    "warm_up_cycles": 0,
    "rest": "0.1 s",
    "max_travel": "40 deg",
    "window_time": "0.3 s",
    "window_angle": "1 deg",
    "max_time": "3 s",
}


@pytest.mark.parametrize(
    ("columns", "mean", "percent"),
    [
        ((27.2, 26.7, 25.8, 26.4, 25.3, 26.7), 26.4, 2.4),  # Tc of Table 4.4, as printed
        ((0.0281, 0.0299, 0.0275, 0.0288, 0.0271, 0.0291), 0.0284, 3.4),  # vs
    ],
)
def test_the_statistics_of_table_4_4(columns, mean: float, percent: float) -> None:
    assert np.mean(columns) == pytest.approx(mean, rel=2e-3)
    deviation = relative_scatter("deviation", np.array(columns).reshape(3, 2)).value
    assert round(100 * deviation, 1) == percent


def sets_of(values: Sequence[float], **more: object) -> list[MapSet]:
    """Maps that found these Coulomb torques (N m), in both directions alike."""
    sets = []
    for number, value in enumerate(values):
        told = Estimate("coulomb_torque", value, "N m", value - 1.0, value + 1.0, **more)
        found = {name: {"coulomb_torque": told} for name in ("positive", "negative")}
        sets.append(MapSet(str(number), "", None, found))
    return sets


def test_maps_do_not_average_a_wrong_torque_constant_away() -> None:
    """0.3 N m in each map is 0.3 N m in their mean; t(2) of 25, 26, 27 is 4.303 / sqrt(3)."""
    parts = (Systematic("torque constant", 0.3), Systematic("inertia"))
    mean = over_maps(sets_of([25.0, 26.0, 27.0], systematic=parts), "coulomb_torque")
    assert [part.source for part in mean.systematic] == ["torque constant", "inertia"]
    assert mean.systematic_uncertainty == pytest.approx(0.3)
    expected = np.hypot(4.303 / np.sqrt(3.0), 1.960 * 0.3)
    assert mean.half_width == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("origin", [Origin.AT_BOUND, Origin.NOT_DETERMINED])
def test_maps_that_do_not_determine_a_parameter_have_no_mean_with_an_interval(origin) -> None:
    """Three maps at 0.1 agree perfectly, and say nothing."""
    sets = [*sets_of([0.1, 0.1], origin=origin, reason=MADE_UP()), *sets_of([0.1])]
    for told in (over_maps(sets, "coulomb_torque"), deviation_of(sets, "coulomb_torque")):
        assert not told.has_interval
        assert told.origin is Origin.NOT_DETERMINED
        assert told.reason == DOUBTFUL(doubtful=4, values=6, origins=str(origin))
    assert over_maps(sets, "coulomb_torque").value == pytest.approx(0.1)


def coulomb(level: float):
    def edit(tree):
        friction = tree["friction"]["load"]
        friction["coulomb_torque"] = f"{26 * level} N m"
        friction["static_torque"] = f"{32 * level} N m"
        del tree["friction"]["motor"]

    return edit


@pytest.fixture(scope="module")
def three_days():
    """Three days with 1.00, 1.04 and 0.96 of the bench's friction torque."""
    done = []
    for day, level in enumerate((1.0, 1.04, 0.96), start=1):
        for item in execute(trials("repeatability", bench(coulomb(level)), FAST)):
            point = {**item.trial.point, "bench.variation.day": day}
            done.append(replace(item, trial=item.trial.model_copy(update={"point": point})))
    return done


def test_three_days_are_six_sets(three_days) -> None:
    """Mean 26 N m; the deviation of 1, 1.04, 0.96, each twice, is 0.04 sqrt(2/3) = 3.27 %."""
    result = analyse("repeatability", three_days)
    for name, level in (("1-2", 1.0), ("3-4", 1.04), ("5-6", 0.96)):
        for direction in ("positive", "negative"):
            found = finding(result, "coulomb_torque", set=name, direction=direction)
            assert found.value == pytest.approx(26.0 * level, rel=0.01)
    mean = finding(result, "coulomb_torque", statistic="mean")
    assert mean.value == pytest.approx(26.0, rel=0.01)
    deviation = finding(result, "coulomb_torque", statistic="relative standard deviation")
    assert deviation.value == pytest.approx(0.04 * np.sqrt(2 / 3), rel=0.05)
    assert deviation.unit == ""
    caption = next(figure.caption for figure in result.figures if figure.key == "scatter")
    assert "No parameter differs between the directions" in caption
    worst = finding(result, "relative_standard_deviation").value
    assert worst >= deviation.value
    columns = [column.name for column in table(result, "repeatability").columns]
    assert columns[2:8] == [
        f"{direction}_{name}"
        for name in ("1-2", "3-4", "5-6")
        for direction in ("negative", "positive")
    ]
    assert [figure.key for figure in result.figures] == ["sets", "scatter"]
    for figure in result.figures:
        for panel in figure.panels:
            for curve in panel.curves:
                assert curve.x.shape == curve.y.shape


def test_repetitions_are_sets_too(three_days) -> None:
    """Without a sweep, what tells the sets apart is the repetition."""
    again = []
    for item in three_days:
        day = item.trial.point["bench.variation.day"]
        point = {"speed": item.trial.point["speed"]}
        trial = item.trial.model_copy(update={"point": point, "repeat": day})
        again.append(replace(item, trial=trial))
    result = analyse("repeatability", again)
    for name in ("1-2", "3-4", "5-6"):
        assert finding(result, "static_torque", set=name, direction="positive").value > 0


def test_one_map_says_nothing_about_repeatability(three_days) -> None:
    one = [i for i in three_days if i.trial.point["bench.variation.day"] == 1]
    result = analyse("repeatability", one)
    assert not [f for f in result.findings if "statistic" in f.conditions]
    assert any("nothing about repeatability" in note for note in result.notes)


def test_a_map_that_cannot_be_fitted_is_left_out_and_said(three_days) -> None:
    few = [
        item
        for item in three_days
        if item.trial.point["bench.variation.day"] != 2
        or item.trial.point["speed"] < np.deg2rad(1.2)
    ]
    result = analyse("repeatability", few)
    assert any("Sets 3-4 have no fit" in note for note in result.notes)
    assert {f.conditions.get("set") for f in result.findings} == {"1-2", "5-6", None}
    assert analyse("repeatability", []).tables == ()


def test_every_number_has_an_interval_or_a_reason(three_days) -> None:
    """The mean of three days has t(2) about it, and their deviation a chi-square."""
    result = analyse("repeatability", three_days)
    assert all(found.known.says_enough for found in result.findings)
    for each in result.tables:
        for row in each.rows:
            cells = [row.get(c.name) for c in each.columns if not (c.exact or c.reason)]
            assert not [cell for cell in cells if isinstance(cell, int | float)]
    mean = finding(result, "coulomb_torque", statistic="mean").known
    # 1, 1.04 and 0.96 of 26 N m: a deviation of 1.04 N m, over the root of 3, times t(2) = 4.303.
    assert mean.half_width == pytest.approx(4.303 * 1.04 / np.sqrt(3), rel=0.02)
    told = finding(result, "coulomb_torque", statistic="relative standard deviation").known
    # 0.04 with two degrees of freedom: chi-square 7.378 and 0.0506.
    assert told.low == pytest.approx(0.04 * np.sqrt(2 / 7.378), rel=0.1)
    assert told.high == pytest.approx(0.04 * np.sqrt(2 / 0.0506), rel=0.1)


TC_DIFFERS = (
    "The directions differ in Tc by more than maps scatter (95 % for all parameters together)."
)


@pytest.mark.parametrize(
    ("apart", "told"),
    [
        ((2.0, 2.1, 1.9), TC_DIFFERS),
        ((-2.0, -2.1, -1.9), TC_DIFFERS),
        ((2.0, -1.0, 1.0), "No parameter differs between the directions"),
    ],
)
def test_directions_are_told_apart_by_their_difference_in_each_map(
    apart: tuple[float, ...], told: str
) -> None:
    """The level drifts by 10 N m from map to map, which both directions share."""
    sets = []
    for number, difference in enumerate(apart):
        level = 20.0 + 10.0 * number
        found = {
            name: {"coulomb_torque": Estimate("coulomb_torque", value, "N m", reason=MADE_UP())}
            for name, value in (("positive", level), ("negative", level + difference))
        }
        sets.append(MapSet(str(number), "", None, found))
    means = {"coulomb_torque": over_maps(sets, "coulomb_torque")}
    deviations = {"coulomb_torque": deviation_of(sets, "coulomb_torque")}
    shown = scatter_figure(sets, means, deviations, ())
    assert told in shown.caption
    dots = shown.panels[0].curves[:-1]
    assert [curve.x[0] for curve in dots] == [1.0, 2.0, 3.0] * 2, "the places of the maps"
    assert all(dot.aside * other.aside < 0 for dot, other in zip(dots[:3], dots[3:], strict=True))


def test_several_parameters_share_the_chance_of_being_wrong() -> None:
    """Differences of 2.6, 2 and 1.4: t is 5.77, beyond 4.30 for one test, within 6.21 for two."""
    sets = []
    for number, difference in enumerate((2.0, 2.6, 1.4)):
        found = {
            name: {
                parameter: Estimate(parameter, value, "N m", reason=MADE_UP())
                for parameter in ("coulomb_torque", "static_torque")
            }
            for name, value in (("positive", 20.0), ("negative", 20.0 + difference))
        }
        sets.append(MapSet(str(number), "", None, found))

    def caption(*parameters: str) -> str:
        means = {name: over_maps(sets, name) for name in parameters}
        deviations = {name: deviation_of(sets, name) for name in parameters}
        return scatter_figure(sets, means, deviations, ()).caption

    assert TC_DIFFERS in caption("coulomb_torque")
    assert "No parameter differs" in caption("coulomb_torque", "static_torque")
