"""What a test comes to: at least a sentence, from its own numbers, with no difference unshown."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.api.conclusion_sentences import remarks, sentence
from campaign.estimate import OF_ONE_TRIAL, Estimate, Origin
from campaign.estimation.stabilization_error import NO_SCATTER, quotient
from campaign.experiments import experiments
from campaign.experiments.breakaway.conclusions import breakaway_conclusions
from campaign.experiments.force_rate import force_rate_conclusions
from campaign.experiments.frequency_response.conclusions import closed_loop_conclusions
from campaign.experiments.friction_map.conclusions import map_conclusions, repeatability_conclusions
from campaign.experiments.interface import TestData
from campaign.experiments.observer_gain.conclusions import observer_conclusions
from campaign.experiments.sensitivity.conclusions import sensitivity_conclusions
from campaign.experiments.shared.conclusion_parts import (
    Settings,
    between,
    conclusion,
    held_at_once,
    ratio_of,
    setting,
)
from campaign.experiments.shared.friction_models import ConditionGroup
from campaign.experiments.stabilization.conclusions import stabilization_conclusions
from campaign.protocol import load_protocol, make_plan
from campaign.result import Amount, Conclusion, Factor, Finding, Result
from campaign.units import Quantity
from tests.experiments.laboratory import MADE_UP, analyse, execute, failed
from tests.experiments.test_channels import CASES, Case, analysed, done

PROTOCOLS = Path(__file__).parents[2] / "protocols"
MOST = 3
DIFFERENCE = re.compile(r"(times|%) (less|more)")
CONFINED = re.compile(r"times \w+ in this simulation")
SETTINGS = Settings({"frequency": Quantity("frequency", "Hz", "Hz", ("Hz",))})


def said(conclusions: tuple[Conclusion, ...]) -> list[str]:
    return [sentence(each) for each in conclusions]


# Every kind of experiment -------------------------------------------------------------------------


def estimates_of(result: Result) -> Iterator[Estimate]:
    yield from (finding.known for finding in result.findings)
    for table in result.tables:
        for row in table.rows:
            yield from (cell for cell in row.values() if isinstance(cell, Estimate))


def ends(estimate: Estimate) -> tuple[float, float | None, float | None]:
    return estimate.value, estimate.low, estimate.high


def unfounded(result: Result) -> list[str]:
    """Sentences with a number that is neither a finding nor in a table, nor was set.

    A ratio is founded on two such numbers: their quotient is its value.
    """
    known = list(estimates_of(result))
    whole = {ends(each) for each in known} | {(0.0, None, None)}
    values = [each.value for each in known if math.isfinite(each.value) and each.value]
    wrong = []
    for each in result.conclusions:
        for part in each.parts:
            if isinstance(part, str) or part.estimate.origin is Origin.GIVEN:
                continue
            value = part.estimate.value
            if isinstance(part, Amount):
                founded = ends(part.estimate) in whole or math.isnan(value)
            else:
                founded = math.isnan(value) or any(
                    math.isclose(one / other, value, rel_tol=1e-9)
                    for one in values
                    for other in values
                )
            if not founded:
                wrong.append(sentence(each))
    return wrong


def contradictory(conclusions: tuple[Conclusion, ...]) -> list[str]:
    """Sentences that call a ratio more or less though its interval does not.

    One without noise has none, and is confined to its simulation.
    """
    wrong = []
    for each in conclusions:
        decided = 0
        for part in each.parts:
            if isinstance(part, Factor):
                low, high = part.estimate.combined
                decided += (low is not None and low > 1) or (high is not None and high < 1)
        if len(DIFFERENCE.findall(CONFINED.sub("", sentence(each)))) != decided:
            wrong.append(sentence(each))
    return wrong


def check(result: Result) -> None:
    assert 1 <= len(result.conclusions) <= MOST
    for each in said(result.conclusions):
        assert re.match(r"[A-Z0-9]", each), each
        assert each.endswith("."), each
        assert ".." not in each, each
        assert "  " not in each, each
        assert "None" not in each, each
        assert "nan" not in each, each
    assert unfounded(result) == []
    assert contradictory(result.conclusions) == []
    assert not result.telling or result.telling in [figure.key for figure in result.figures]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_kind_comes_to_sentences_from_its_own_numbers(case: Case) -> None:
    check(analysed(case))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_kind_names_its_condition(case: Case) -> None:
    """Something that was set, or a direction or model: no sentence stands for all conditions."""
    first = analysed(case).conclusions[0]
    is_set = any(not isinstance(p, str) and p.estimate.origin is Origin.GIVEN for p in first.parts)
    assert is_set or case.kind == "stribeck_curve", "which tells the rates that were measured"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_trials_that_failed_cost_numbers_and_no_sentence_is_wrong(case: Case) -> None:
    trials = done(case)
    half = [failed(item) if number % 2 else item for number, item in enumerate(trials)]
    result = analyse(case.kind, half)
    assert unfounded(result) == []
    assert contradictory(result.conclusions) == []
    nothing = analyse(case.kind, [failed(item) for item in trials])
    assert unfounded(nothing) == []
    assert not DIFFERENCE.search(" ".join(said(nothing.conclusions)))


SHIPPED = sorted(
    {p.stem for p in PROTOCOLS.glob("*.toml")} - {"thesis", "draws", "calibrate-platform"}
)
QUICK = ("stabilization", "step_response", "stabilization_hardware", "model_output")


def _check_shipped(name: str) -> set[str]:
    protocol = load_protocol(PROTOCOLS / f"{name}.toml", experiments(), shipped=PROTOCOLS)
    plan = make_plan(protocol, seed=0)
    for test in plan.tests:
        trials = [trial for trial in plan.trials if trial.test == test.name]
        check(analyse(test.kind, execute(trials)))
    return {test.kind for test in plan.tests}


@pytest.mark.parametrize("name", QUICK)
def test_quick_shipped_protocols_come_to_sentences(name: str) -> None:
    _check_shipped(name)


@pytest.mark.soak
@pytest.mark.parametrize("name", [name for name in SHIPPED if name not in QUICK])
def test_every_shipped_protocol_comes_to_sentences(name: str) -> None:
    assert _check_shipped(name)


def test_what_was_identified_comes_before_what_was_measured() -> None:
    (case,) = [case for case in CASES if case.kind == "velocity_map"]
    result = analysed(case)
    assert [table.key for table in result.tables] == ["parameters", "models", "map"]
    assert [figure.key for figure in result.figures] == ["map", "fit", "one-point"]
    (case,) = [case for case in CASES if case.name == "frequency_response"]
    keys = [table.key for table in analysed(case).tables]
    assert keys[:2] == ["servo-characteristics", "compensation-effect"]


# Stabilization ------------------------------------------------------------------------------------


def error(method: str, value: float, share: float | None = 0.01, **where: object) -> Finding:
    """An error (mrad) with a standard error of a share of it, over 10 degrees of freedom."""
    conditions = {
        "compensation": method,
        "frequency": 0.5,
        "acceleration": math.radians(18),
        **where,
    }
    if share is None:
        told = Estimate("stabilization_error", 1e-3 * value, "rad", reason=MADE_UP())
        return Finding.of(told, conditions)
    half = 2.228 * share * value  # Student's t of 10 degrees of freedom
    told = Estimate(
        "stabilization_error", 1e-3 * value, "rad", 1e-3 * (value - half), 1e-3 * (value + half),
        0.95, standard_error=1e-3 * share * value, freedom=10,
    )  # fmt: skip
    return Finding.of(told, conditions)


def with_gains(*errors: Finding) -> tuple[Finding, ...]:
    from campaign.experiments.stabilization.comparisons import compared

    return (*errors, *compared(errors))


def stabilized(*errors: Finding) -> list[str]:
    quantities = {"frequency": "Hz", "acceleration": "rad/s^2"}
    known = {n: Quantity(n, u, u.replace("rad", "deg"), (u,)) for n, u in quantities.items()}
    known["bench.gear.preload.torque"] = Quantity("torque", "N m", "N m", ("N m",))
    return said(stabilization_conclusions(with_gains(*errors), Settings(known)))


def test_each_method_is_told_against_none() -> None:
    (told,) = stabilized(error("none", 0.74), error("lugre", 0.26))
    # 0.74/0.26 = 2.846; ln has the error 0.01 √2 with 20 degrees of freedom, t = 2.086: ± 2.99 %.
    assert told == (
        "At 0.5 Hz, 18 deg/s²: of an error (1σ) of 0.740 ± 0.016 mrad without compensation the"
        " LuGre model leaves 0.2600 ± 0.0058 mrad, 2.85 times less (2.76 to 2.93)."
    )


def test_a_method_that_makes_it_worse() -> None:
    (told,) = stabilized(error("none", 0.74), error("static", 0.84))
    assert ", 13.5 ± 3.3 % more" in told


def test_a_method_without_a_difference() -> None:
    (told,) = stabilized(error("none", 0.74), error("static", 0.73))
    assert "no difference that the data show (0.98 to 1.04 times)" in told
    assert not DIFFERENCE.search(told)


def test_the_high_pass_of_an_error_is_told_where_the_error_first_is() -> None:
    found = with_gains(error("none", 0.74), error("lugre", 0.26))
    (told,) = said(stabilization_conclusions(found, SETTINGS, high_pass=0.331))
    assert "of an error (1σ, seen through a high-pass at 0.331 Hz) of 0.740 ± 0.016 mrad" in told
    swept = [error(m, 0.5, frequency=f) for f in (0.2, 0.5) for m in ("none", "lugre")]
    every = said(stabilization_conclusions(with_gains(*swept), SETTINGS, high_pass=0.331))
    assert "high-pass" in every[0]
    assert "high-pass" not in "".join(every[1:])
    pair = [gain(0.0, 0.58), gain(2.0, 0.2)]
    assert "high-pass at 0.331 Hz" in said(observer_conclusions(pair, 2.0, "", 0.331))[0]
    single_change = [threshold("coulomb_torque", 0.158, 0.004), error("lugre", 0.14)]
    told, *_ = said(sensitivity_conclusions(single_change, 2e-4, {}, 0.331))
    assert "high-pass at 0.331 Hz" in told


def test_numbers_without_intervals_claim_nothing() -> None:
    (told,) = stabilized(error("none", 0.74, None), error("lugre", 0.26, None))
    assert "a ratio of 2.85 without an interval" in told
    assert not DIFFERENCE.search(told)


def test_without_an_uncompensated_trial_nothing_is_compared() -> None:
    (told,) = stabilized(error("static", 0.44), error("lugre", 0.19))
    assert told.endswith("; no trial without compensation says what that gains.")
    assert not DIFFERENCE.search(told)


def test_none_alone_is_its_error() -> None:
    (told,) = stabilized(error("none", 0.44))
    assert told.endswith("the error (1σ) is without compensation 0.4400 ± 0.0098 mrad.")


def test_of_a_sweep_its_range_and_the_most_important_contrasts() -> None:
    values = {0.2: (0.4, 0.1), 0.5: (0.8, 0.2), 2.0: (0.6, 0.5)}
    found = [
        error(method, value, frequency=frequency)
        for frequency, pair in values.items()
        for method, value in zip(("none", "lugre"), pair, strict=True)
    ]
    where, span, least = stabilized(*found)
    assert "is from 0.4000 ± 0.0089 mrad (frequency 0.2 Hz) to 0.800 ± 0.018 mrad" in span
    assert where.startswith(
        "At 18 deg/s², where the error is largest (frequency 0.5 Hz): of an error"
    )
    assert "4.0 times less" in where or "4.00 times less" in where
    assert least.startswith("The smallest ratio of all is that of the LuGre model (frequency 2 Hz)")
    # As the smallest of three: t of 1 - 0.05/6 with 20 degrees of freedom is 2.613, times 0.01 √2.
    assert ", 16.7 ± 3.1 % less" in least


def test_an_extreme_that_was_picked_has_to_be_surer() -> None:
    """One of twenty places has a ratio that is above 1 by itself, and not as the largest of 20."""
    found = [
        error(method, value, frequency=float(number))
        for number in range(1, 21)
        for method, value in (
            ("none", 1.0 + 0.001 * number),
            ("lugre", 1.046 if number == 7 else 1.0),
        )
    ]
    alone = quotient("r", found[12].known, found[13].known)
    assert alone.high is not None
    assert alone.high < 1, "told by itself it would be more"
    least = stabilized(*found)[-1]
    assert "frequency 7 Hz" in least
    assert "no difference that the data show" in least


def test_a_raised_preload_is_told_for_each_method() -> None:
    found = [
        error(method, value, average_friction=preload, **{"bench.gear.preload.torque": preload})
        for preload, values in ((33.0, (0.60, 0.15)), (50.0, (0.61, 0.21)))
        for method, value in zip(("none", "lugre"), values, strict=True)
    ]
    *_, growth = stabilized(*found)
    assert growth.startswith(
        "The error at an average friction of 50 N·m, against that at the lowest"
    )
    assert "without compensation no difference that the data show" in growth
    assert "with the LuGre model 1.40 times more (1.36 to 1.44)" in growth


def test_single_trials_are_called_so() -> None:
    pair = error("none", 0.74), error("lugre", 0.26)
    single = [Finding.of(replace(e.known, reason=OF_ONE_TRIAL()), e.conditions) for e in pair]
    (told,) = stabilized(*single)
    assert told.startswith("At 0.5 Hz, 18 deg/s², one trial each: of an error")


def single(finding: Finding) -> Finding:
    return Finding.of(replace(finding.known, reason=OF_ONE_TRIAL()), finding.conditions)


@pytest.mark.parametrize("value", [0.26, 0.70, 0.78])
@pytest.mark.parametrize("which", [(0,), (1,), (0, 1)])
def test_no_ratio_is_decided_by_single_trials(value: float, which: tuple[int, ...]) -> None:
    pair = [error("none", 0.74), error("lugre", value)]
    (told,) = stabilized(*(single(e) if n in which else e for n, e in enumerate(pair)))
    assert not DIFFERENCE.search(told)
    assert "no difference" not in told
    assert f"a ratio of {0.74 / value:.3g} without an interval" in told
    assert (", one trial each:" in told) == (len(which) == 2)
    assert (", some of one trial only:" in told) == (len(which) == 1)


def exact(finding: Finding) -> Finding:
    """As found where nothing scatters."""
    told = replace(finding.known, low=None, high=None, level=None, standard_error=None)
    return Finding.of(replace(told, reason=NO_SCATTER()), finding.conditions)


def test_a_ratio_without_noise_is_told_of_its_simulation_alone() -> None:
    """740 / 100 = 7.4 and 740 / 0.9 = 822; where the other side scatters it says nothing."""
    found = [error("none", 0.74), error("static", 0.1), error("lugre", 9e-4)]
    (told,) = stabilized(*map(exact, found))
    assert "0.1 mrad, 7.40 times less in this simulation (no noise, so no interval);" in told
    assert told.endswith(" mrad, 822 times less in this simulation.")
    (told,) = stabilized(exact(error("none", 0.1)), exact(error("static", 0.74)))
    assert "7.40 times more in this simulation (no noise, so no interval)" in told
    (told,) = stabilized(exact(error("none", 0.7401)), exact(error("static", 0.74)))
    assert "no difference in three digits in this simulation (no noise" in told
    (told,) = stabilized(exact(error("none", 0.74)), single(error("static", 0.1)))
    assert "in this simulation" not in told
    assert not DIFFERENCE.search(told)


def test_trials_that_cannot_scatter_are_not_counted() -> None:
    (told,) = stabilized(exact(error("none", 0.74)), single(error("lugre", 0.26)))
    assert ", one trial each: of an error" in told


def test_no_preload_is_called_worse_by_single_trials() -> None:
    found = [
        single(error("none", value, average_friction=at, **{"bench.gear.preload.torque": at}))
        for at, value in ((33.0, 0.60), (33.0001, 0.66))
    ]
    told = stabilized(*found)
    assert not DIFFERENCE.search(" ".join(told))
    assert "33.0001 N·m" in told[-1], "which is not the 33 N m it is told against"


def test_the_largest_is_one_of_several_where_intervals_overlap() -> None:
    found = [
        error(method, value, frequency=frequency)
        for frequency, least in ((0.2, 0.790), (0.5, 0.8))
        for method, value in (("none", least), ("lugre", 0.2))
    ]
    assert "where the error is among the largest (frequency 0.5 Hz): of" in stabilized(*found)[0]
    apart = [error("none", 0.7, frequency=0.2), *found[1:]]
    assert "where the error is largest (frequency 0.5 Hz): of" in stabilized(*apart)[0]
    assert "among the largest" in stabilized(*map(single, apart))[0]


@pytest.mark.parametrize(
    ("outcome", "why"),
    [("limit", "its trial ended at a limit"), ("interrupted", "its trial was interrupted")],
)
def test_a_method_whose_trial_failed_is_named(outcome: str, why: str) -> None:
    found = with_gains(error("none", 0.74), error("static", 0.5))
    lost = [(error("lugre", 1.0).conditions, outcome)]
    (told,) = said(stabilization_conclusions(found, SETTINGS, lost))
    assert told.endswith(f"; the LuGre model has no error: {why}.")


def test_a_method_that_did_not_run_at_a_place_is_named() -> None:
    found = [error(m, 0.5, frequency=f) for f in (0.2, 0.5) for m in ("none", "lugre")]
    _, span, *_ = stabilized(*found[:-1])
    assert span.endswith("; the LuGre model has no error: it was not executed.")


def test_a_failed_trial_is_named_by_its_experiment() -> None:
    (case,) = [case for case in CASES if case.name == "stabilization"]
    trials = [
        failed(item) if item.trial.options["compensation"] == "lugre" else item
        for item in done(case)
    ]
    told = " ".join(said(analyse(case.kind, trials).conclusions))
    assert "the LuGre model has no error: its trial ended at a limit" in told


def test_an_irregular_motion_is_named() -> None:
    pair = [Finding.of(e.known, {"compensation": e.conditions["compensation"], "motion": "ship"})
            for e in (error("none", 0.74), error("lugre", 0.26))]  # fmt: skip
    (told,) = stabilized(*pair)
    assert told.startswith("Under the roll of a ship: of an error")


# Maps, ramps, loops -------------------------------------------------------------------------------


def known(name: str, value: float, half: float, unit: str = "N m") -> Estimate:
    return Estimate(
        name, value, unit, value - half, value + half, 0.95, standard_error=half / 2, freedom=12
    )


def fitted(direction: str, coulomb: Estimate) -> Finding:
    return Finding.of(coulomb, {"direction": direction, "exponent": "free"})


@pytest.mark.parametrize(
    ("negative", "ratio"),
    [
        # The extremes of both intervals: 26.6/25.4 and 26.8/25.2.
        (26.7, "5.53 ± 0.81 % more"),
        (25.4, "no difference that the data show (0.996 to 1.012 times)"),
    ],
)
def test_asymmetry_needs_intervals_that_are_apart(negative: float, ratio: str) -> None:
    findings = [
        fitted("positive", known("coulomb_torque", 25.3, 0.1)),
        fitted("negative", known("coulomb_torque", negative, 0.1)),
    ]
    *_, told = said(map_conclusions(findings, (-1.0, 0.5, 1.0), SETTINGS))
    assert told.endswith(f"Coulomb friction Tc {ratio}.")


def test_a_map_without_a_fit_says_so() -> None:
    assert said(map_conclusions((), (1.0,), SETTINGS)) == [
        "No friction parameters were found: no map has a fit."
    ]


def test_one_map_does_not_repeat() -> None:
    findings = [Finding.of(known("coulomb_torque", 25.3, 0.1), {"direction": "positive"})]
    (told,) = said(repeatability_conclusions(findings, 1))
    assert told.startswith("One map says nothing of repeatability")


def ramp(direction: str, value: float, **more: object) -> Finding:
    where = {"direction": direction, **(more or {"statistic": "mean"})}
    return Finding.of(known("breakaway_torque", value, 0.2), where)


def test_ramps_that_did_not_show_a_stiffness_say_so() -> None:
    told = said(breakaway_conclusions([ramp("positive", 31.4)], [1.0], SETTINGS))
    assert told == [
        "On a ramp of 1 N·m/s the load breaks away at 31.40 ± 0.20 N·m in the positive direction.",
        "No presliding stiffness was found: no ramp shows enough of the curve of bristles.",
    ]
    assert said(breakaway_conclusions([], [1.0], SETTINGS)) == [
        "No ramp came to a breakaway torque."
    ]


def test_directions_are_told_apart_only_where_they_are() -> None:
    both = [ramp("both", 32.4), ramp("positive", 31.4), ramp("negative", 33.4)]
    told, *_ = said(breakaway_conclusions(both, [1.0], SETTINGS))
    assert "% more in the negative" in told
    both[2] = ramp("negative", 31.5)
    told, *_ = said(breakaway_conclusions(both, [1.0], SETTINGS))
    assert "no difference that the data show" in told
    assert not DIFFERENCE.search(told)


def test_one_ramp_in_each_direction_decides_nothing() -> None:
    means = [ramp("both", 32.4), ramp("positive", 31.4), ramp("negative", 33.4)]
    single_ramps = [
        ramp(way, value, position=0.0, measurement=number)
        for number, (way, value) in enumerate((("positive", 31.4), ("negative", 33.4)))
    ]
    found = breakaway_conclusions([*means, *single_ramps], [1.0], SETTINGS)
    told = said(found)
    assert not DIFFERENCE.search(" ".join(told))
    assert "a ratio of 1.06 without an interval" in told[0]
    assert not any(each.startswith("Over 2 ramps") for each in told), "the means told both"
    assert any("of that one trial" in each for each in remarks(found))
    more = [
        ramp(way, value, position=0.5, measurement=number)
        for number, (way, value) in enumerate((("positive", 31.3), ("negative", 33.5)), start=2)
    ]
    told = said(breakaway_conclusions([*means, *single_ramps, *more], [1.0], SETTINGS))
    assert "% more in the negative" in told[0]
    assert told[1].startswith("Over 4 ramps it is from 31.30")


@pytest.mark.parametrize(
    ("change", "half", "more"),
    [(0.5, 0.2, ""), (0.1, 0.2, " (none that the data show)"), (-0.5, 0.2, "")],
)
def test_a_change_of_bandwidth_is_one_where_its_interval_says_so(
    change: float, half: float, more: str
) -> None:
    findings = [
        Finding.of(known("bandwidth", 7.1, 0.1, "Hz"), {"compensation": "none"}),
        Finding.of(known("bandwidth", 7.1 + change, 0.1, "Hz"), {"compensation": "lugre"}),
        Finding.of(known("bandwidth_change", change, half, "Hz"), {"compensation": "lugre"}),
    ]
    told, _ = said(closed_loop_conclusions(findings, (0.5, 100.0), (), SETTINGS))
    shown = f"{change:.2f}".replace("-", "−")
    assert told.endswith(f"with the LuGre model bandwidth {shown} ± 0.20 Hz{more}.")


def threshold(parameter: str, value: float, half: float | None) -> Finding:
    if half is None:
        told = Estimate("sensitivity_threshold", value, "", kind="at least", reason=MADE_UP())
    else:
        told = known("sensitivity_threshold", value, half, "")
    return Finding.of(told, {"parameter": parameter})


@pytest.mark.parametrize(
    ("second", "said_of_order"),
    [
        (threshold("static_torque", 0.56, 0.02), ": Tc matters most."),
        (
            threshold("static_torque", 0.17, 0.02),
            "; whether Tc or Ts matters most, the intervals leave open.",
        ),
        (threshold("static_torque", 0.8, None), ": Tc matters most."),
        (
            threshold("static_torque", 0.1, None),
            "; whether Tc or Ts matters most, the intervals leave open.",
        ),
    ],
)
def test_the_parameter_that_matters_most_is_named_where_the_data_say_so(
    second: Finding, said_of_order: str
) -> None:
    unchanged = error("lugre", 0.14)
    symbols = {"coulomb_torque": "Tc", "static_torque": "Ts"}
    found = [threshold("coulomb_torque", 0.158, 0.004), second, unchanged]
    told = said(sensitivity_conclusions(found, 2e-4, symbols))
    assert told[0].startswith("At 0.5 Hz, 18 deg/s², the smallest change of a parameter with which")
    assert told[0].endswith(said_of_order)


def test_thresholds_that_need_every_trial_are_not_told() -> None:
    told = said(sensitivity_conclusions([error("lugre", 0.14)], 2e-4, {}))
    assert told[1] == "No threshold: it needs every trial."


def gain(corner: float, value: float) -> Finding:
    told = error("observer", value)
    where = {**told.conditions, "observer": "observer", "corner": corner}
    return Finding.of(replace(told.known, name="stabilization_error_at_gain"), where)


@pytest.mark.parametrize(
    ("own", "word"),
    [(0.26, "2.23 times less"), (0.70, "20.7 ± 3.6 % more"), (0.58, "no difference that the data")],
)
def test_the_observer_is_told_against_none(own: float, word: str) -> None:
    told = said(observer_conclusions([gain(0.0, 0.58), gain(2.0, own), gain(8.0, 0.1)], 2.0, ""))
    assert f"mrad of 0.580 ± 0.013 mrad, {word}" in told[0]
    assert told[1] == "The smallest error found is at a corner of 8 Hz: 0.1000 ± 0.0022 mrad."


@pytest.mark.parametrize(
    ("fast", "word"),
    [(1.0, "1.49 times less on the fastest"), (1.8, "20.8 ± 2.2 % more on the fastest")],
)
def test_what_a_faster_ramp_does_to_breakaway(fast: float, word: str) -> None:
    rows = [
        {"torque_rate": rate, "breakaway": known("breakaway_torque", value, 0.02)}
        for rate, value in ((0.1, 1.49), (50.0, fast))
    ]
    (told,) = said(force_rate_conclusions(rows, [ConditionGroup({}, "", ())], SETTINGS))
    assert f" N·m at 50 N·m/s, {word}" in told


def test_an_observer_whose_own_gain_is_unstable_has_no_error() -> None:
    without = error("none", 0.58, corner=0.0)
    found = [Finding.of(replace(without.known, name="stabilization_error_at_gain"),
                        {**without.conditions, "observer": "observer"})]  # fmt: skip
    told = said(observer_conclusions(found, 2.0, "the rate limit"))
    (own,) = told
    assert own == (
        "At 0.5 Hz, 18 deg/s², the observer with its own gain (corner 2 Hz), has no error that was "
        "measured: the rate limit."
    )


# Parts --------------------------------------------------------------------------------------------


def test_a_ratio_of_same_trials_is_never_narrower_than_one_of_independent_ones() -> None:
    one, other = known("a", 26.7, 0.3), known("a", 25.3, 0.2)
    free, together = ratio_of(one, other), ratio_of(one, other, of_same_trials=True)
    assert free.value == together.value == 26.7 / 25.3
    assert together.low == pytest.approx(26.4 / 25.5)
    assert together.high == pytest.approx(27.0 / 25.1)
    assert free.low is not None
    assert free.high is not None
    assert together.low < free.low < free.high < together.high


def bracket(low: float, value: float, high: float) -> Estimate:
    return Estimate("b", value, "N m", low, high, 0.95)


def test_a_ratio_of_brackets_holds_every_ratio_in_them() -> None:
    told = ratio_of(bracket(2.0, 2.1, 2.2), bracket(1.0, 1.1, 1.2))
    assert told.low == pytest.approx(2.0 / 1.2)
    assert told.high == pytest.approx(2.2 / 1.0)


@pytest.mark.parametrize(
    "other",
    [
        Estimate("a", 25.0, "N m", kind="at least", reason=MADE_UP()),
        Estimate("a", 25.0, "N m", reason=MADE_UP()),
        Estimate("a", 25.0, "N m", None, 26.0),
        bracket(-1.0, 25.0, 26.0),
    ],
)
def test_a_ratio_of_bounds_has_no_interval(other: Estimate) -> None:
    told = ratio_of(bracket(2.0, 2.1, 2.2), other)
    assert not told.has_interval
    assert told.reason


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_ratio_with_what_is_not_positive_is_not_determined(value: float) -> None:
    for pair in ((known("a", value, 0.1), known("a", 1.0, 0.1)),
                 (known("a", 1.0, 0.1), known("a", value, 0.1))):  # fmt: skip
        assert ratio_of(*pair).origin is Origin.NOT_DETERMINED


def test_what_was_picked_from_many_is_widened_by_bonferroni() -> None:
    """Of 5: the two-sided 99 % quantile of Student's t with 12 degrees of freedom is 3.0545."""
    told = held_at_once(known("a", 2.0, 0.1), 5)
    half = 3.0545 * 0.05 / 2.0
    assert told.low == pytest.approx(2.0 * math.exp(-half), rel=1e-4)
    assert told.high == pytest.approx(2.0 * math.exp(half), rel=1e-4)
    assert held_at_once(known("a", 2.0, 0.1), 1) == known("a", 2.0, 0.1)
    assert not held_at_once(bracket(1.0, 2.0, 3.0), 5).has_interval


def test_a_range_counts_what_is_not_determined() -> None:
    lost = Estimate("a", math.nan, "N m", reason=MADE_UP(), origin=Origin.NOT_DETERMINED)
    found = [
        Finding.of(each, {"frequency": float(number)})
        for number, each in enumerate((known("a", 2.0, 0.1), lost, known("a", 1.0, 0.1)))
    ]
    (told,) = said((conclusion("It is ", between(found, SETTINGS, ("frequency",))),))
    assert told == (
        "It is from 1.00 ± 0.10 N·m (frequency 2 Hz) to 2.00 ± 0.10 N·m (frequency 0 Hz)"
        "; 1 of 3 are not determined."
    )


def test_a_swept_number_of_the_bench_has_its_unit() -> None:
    (case,) = [case for case in CASES if case.kind == "stabilization"]
    point = {"bench.axis.inertia": 35.0, "bench.friction.load.static_torque": 32.0, "day": 2}
    swept = [
        replace(item, trial=item.trial.model_copy(update={"point": point})) for item in done(case)
    ]
    options = experiments()["stabilization"].options
    settings = Settings.of(TestData("t", "stabilization", {}, tuple(swept)), options)
    (told,) = said((conclusion(settings.place(point)),))
    assert told == "Axis inertia 35 kg·m², load static torque 32 N·m, day 2."
    assert settings.place({"model": "lugre", "noisy": True}) == (
        "model ",
        "lugre",
        ", ",
        "noisy ",
        "yes",
    )


def test_what_was_set_is_no_finding() -> None:
    assert setting(0.5, "Hz").estimate.origin is Origin.GIVEN
