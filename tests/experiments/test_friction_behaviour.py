"""The behaviour experiments against the 1995 paper's numbers, closed forms and scipy."""

from __future__ import annotations

import itertools
import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from campaign.channels import DRIVE_TORQUE, FRICTION_TORQUE, LOAD_RATE, RELATIVE_ANGLE
from campaign.estimate import Systematic
from campaign.estimation.sampled_curve import ALIKE, LOST
from campaign.execution.trial_metrics import checked
from campaign.experiments import experiments
from campaign.experiments.model_output.experiment import NO_REVERSAL
from campaign.experiments.shared.friction_models import with_model
from campaign.experiments.stick_slip import TOO_FEW_SLIPS
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.result import Result
from tests.experiments.laboratory import Done, analyse, execute, failed, finding, table, trials
from tests.physics.benches import bench

SPECIMEN = (
    Path(__file__).parents[2] / "protocols" / "benches" / "specimen-lugre-1995.toml"
).read_text(encoding="utf-8")
BOTH = ["lugre", "stribeck"]
FC, FS, VS, S0, S1, S2 = 1.0, 1.5, 1e-3, 1e5, math.sqrt(1e5), 0.4
KINDS = ("force_rate", "stribeck_curve", "friction_lag", "presliding_hysteresis", "stick_slip")


def specimen() -> Bench:
    return Bench.model_validate(tomllib.loads(SPECIMEN))


def result_of(kind: str, **options: Any) -> Result:
    return analyse(kind, execute(trials(kind, specimen(), options)))


PEAKS = {
    0.1: 1.4852,
    1.0: 1.4324,
    2.0: 1.3944,
    5.0: 1.3132,
    10.0: 1.2200,
    20.0: 1.0986,
    50.0: 1.0075,
}
"""N m/s to N m, by an implicit Runge-Kutta method at tight tolerance."""


def test_breakaway_falls_with_the_force_rate() -> None:
    rates = [f"{rate} N m/s" for rate in PEAKS]
    result = result_of("force_rate", torque_rates=rates, peak_torque="4 N m", models=BOTH)
    for rate, peak in PEAKS.items():
        found = finding(result, "breakaway_torque", model="lugre", torque_rate=rate)
        assert found.value == pytest.approx(peak, rel=5e-4)
        static = finding(result, "breakaway_torque", model="stribeck", torque_rate=rate)
        assert static.value == pytest.approx(FS, rel=1e-6)
    assert result.figures[0].thesis == ("2.8",)
    assert not result.notes


def test_a_ramp_that_ends_too_early_is_said() -> None:
    result = result_of("force_rate", torque_rates=["1 N m/s"], peak_torque="1 N m")
    assert not result.findings
    assert "raise peak_torque" in result.notes[0]


def test_the_stribeck_curve_is_reached() -> None:
    speeds = ["0.2 mrad/s", "1 mrad/s", "3 mrad/s", "1 rad/s"]
    result = result_of("stribeck_curve", speeds=speeds, settle_angle="0.3 mrad")
    rows = table(result, "stribeck-curve").rows
    assert len(rows) == 8
    for row in rows:
        v = float(str(row["rate"]))
        expected = np.sign(v) * (FC + (FS - FC) * math.exp(-((v / VS) ** 2))) + S2 * v
        assert row["torque"] == pytest.approx(expected, rel=1e-6)
    assert finding(result, "stribeck_deviation").value < 1e-6
    (shown,) = result.figures
    drawn = [curve.low for panel in shown.panels for curve in panel.curves if curve.low is not None]
    assert not any(np.isfinite(low).any() for low in drawn)
    assert "interval" not in shown.caption, "nothing scatters, and no bars are drawn"


def lag_width(frequency: float, mean: float, amplitude: float) -> float:
    """Friction rising less falling at the mean rate, in the fourth cycle, by scipy."""

    def rate(t: float) -> float:
        return mean - amplitude * math.cos(2 * math.pi * frequency * t)

    def bristle(t: float, z: np.ndarray) -> np.ndarray:
        v = rate(t)
        return np.asarray(v - S0 * abs(v) * z / (FC + (FS - FC) * math.exp(-((v / VS) ** 2))))

    moments = [(3.0 + phase) / frequency for phase in (0.25, 0.75)]
    span = (0.0, 4.0 / frequency)
    solved = solve_ivp(
        bristle, span, [FS / S0], method="LSODA", rtol=1e-10, atol=1e-15, t_eval=moments
    )
    torques = [
        S0 * z + S1 * float(bristle(t, np.array(z))) + S2 * rate(t)
        for t, z in zip(moments, solved.y[0], strict=True)
    ]
    return torques[0] - torques[1]


def test_friction_lags_and_more_at_higher_frequency() -> None:
    result = result_of(
        "friction_lag",
        mean_rate="1.3 mrad/s",
        amplitude="1.1 mrad/s",
        frequencies=["0.16 Hz", "1.6 Hz", "4 Hz"],
        models=BOTH,
    )
    widths = []
    for frequency in (0.16, 1.6, 4.0):
        found = finding(result, "friction_lag_width", model="lugre", frequency=frequency)
        assert found.value == pytest.approx(lag_width(frequency, 1.3e-3, 1.1e-3), rel=5e-3)
        widths.append(found.value)
        static = finding(result, "friction_lag_width", model="stribeck", frequency=frequency)
        assert static.value == pytest.approx(0.0, abs=1e-9)
    assert 0 < widths[0] < widths[1] < widths[2]


def test_presliding_takes_the_energy_of_the_closed_form() -> None:
    """Slow presliding at s = Ts: W = 4 Ts (a - Ts/s0 tanh(s0 a/Ts)), and pi s1 w a^2 of damping.

    The first is the steady loop of an exponential branch, the second small at this frequency.
    """
    frequency = 0.02
    result = result_of(
        "presliding_hysteresis",
        amplitudes=["3 urad", "12 urad", "48 urad"],
        frequency=f"{frequency} Hz",
        cycles=10,
        models=BOTH,
    )
    for amplitude in (3e-6, 12e-6, 48e-6):
        reach = FS / S0
        energy = 4 * FS * (amplitude - reach * math.tanh(amplitude / reach))
        damping = math.pi * S1 * 2 * math.pi * frequency * amplitude**2
        assert damping < 0.01 * energy
        found = finding(result, "hysteresis_energy", model="lugre", amplitude=amplitude)
        assert found.value == pytest.approx(energy + damping, rel=3e-3)
        box = finding(result, "hysteresis_energy", model="stribeck", amplitude=amplitude)
        assert box.value == pytest.approx(4 * FS * amplitude, rel=1e-3)
    factors = [row["loss_factor"] for row in table(result, "presliding-hysteresis").rows]
    assert factors[3:] == pytest.approx([4 / math.pi] * 3, rel=1e-3)


def test_stick_slip() -> None:
    """Period 6.3627 s, first slip at 7.478 s, spring peak 1.508 N, top speed 0.3698 m/s."""
    result = result_of("stick_slip", stiffness="2 N m/rad", pull_rate="0.1 rad/s", duration="35 s")
    expected = {"period": 6.3627, "first_slip": 7.478, "peak_torque": 1.508, "top_rate": 0.3698}
    for quantity, value in expected.items():
        found = finding(result, f"stick_slip_{quantity}")
        assert found.value == pytest.approx(value, rel=3e-4)  # the sample time is 1 ms
    assert table(result, "stick-slip").rows[0]["slips"] == 5


def test_one_slip_has_no_period() -> None:
    result = result_of("stick_slip", stiffness="2 N m/rad", pull_rate="0.1 rad/s", duration="9 s")
    assert finding(result, "stick_slip_first_slip").value == pytest.approx(7.478, rel=3e-4)
    period = finding(result, "stick_slip_period")
    assert math.isnan(period.value)
    assert period.known.reason in TOO_FEW_SLIPS
    assert "fewer than three slips" in result.notes[0]


def test_static_and_lugre_output_without_a_plant() -> None:
    result = analyse("model_output", execute(trials("model_output", bench(), {})))
    static, lugre = table(result, "model-output").rows
    steady = float(sum(part[0] for part in steady_friction(bench(), np.array([0.2]))))
    assert static["at_amplitude"] == pytest.approx(steady, rel=1e-9)
    assert lugre["at_amplitude"] == pytest.approx(steady, rel=1e-6)
    assert static["at_reversal"] == 0.0  # the middle of a jump
    assert float(str(lugre["at_reversal"])) > 30  # the bristles are still bent
    assert [figure.thesis for figure in result.figures] == [("4.10",), ("4.14",)]


def test_varied_parameters_are_told_apart_by_what_they_do() -> None:
    """Figure 5.12 has sigma0 and sigma1, which steady sliding does not know; 5.13 the others."""
    names = ["bristle_stiffness", "bristle_damping", "coulomb_torque", "static_torque"]
    names += ["stribeck_velocity", "viscous_friction"]
    options = {"models": ["lugre"], "vary": names, "factors": [0.5, 2.0]}
    result = analyse("model_output", execute(trials("model_output", bench(), options)))
    dynamic, static = result.figures
    assert (dynamic.thesis, static.thesis) == (("5.12",), ("5.13",))
    assert [panel.title[-2:] for panel in dynamic.panels] == ["σ0", "σ1"]
    assert [panel.title[-2:] for panel in static.panels] == ["Tc", "Ts", "vs", "σ2"]
    assert all(len(panel.curves) == 3 for figure in result.figures for panel in figure.panels)
    rows = {row["source"]: row for row in table(result, "model-output").rows}
    gain = 26.0 + 141.176 * 0.03  # Tc at the load; at 0.2 rad/s nothing is left of Ts - Tc
    more = float(str(rows["Coulomb torque Tc × 2.0"]["at_amplitude"]))
    assert more - float(str(rows["unchanged"]["at_amplitude"])) == pytest.approx(gain, rel=1e-6)


def test_compensations_are_shown_on_request() -> None:
    options = {"models": [], "compensation": ["static", "lugre"]}
    result = analyse("model_output", execute(trials("model_output", bench(), options)))
    own, static, lugre = (row["peak"] for row in table(result, "model-output").rows)
    assert lugre == pytest.approx(own)  # this bench's compensators know the friction exactly
    assert float(str(static)) > float(str(own))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"compensation": ["observer"]}, "no friction model"),
        ({"compensation": ["lugr"]}, "it has static, lugre, observer"),
        ({"vary": ["stifness"]}, "'stifness' to vary"),
        ({"models": ["lugr"]}, "did you mean 'lugre'"),
    ],
)
def test_what_cannot_be_shown_is_said(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        trials("model_output", bench(), options)


def test_a_model_that_needs_more_than_the_bench_says_is_refused() -> None:
    static = Bench.model_validate(with_model(specimen(), "stribeck"), context={"si": True})
    assert not hasattr(static.friction["load"], "bristle_stiffness")
    with pytest.raises(ValueError, match=r"cannot be described by .*'lugre'.* bristle_stiffness"):
        with_model(static, "lugre")


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        ("friction_lag", {"mean_rate": "1 deg/s", "amplitude": "1 deg/s"}, "the load stops"),
        ("stribeck_curve", {"speeds": ["-1 deg/s"]}, "positive"),
        ("stribeck_curve", {"window_time": "1 us"}, "no sample"),
        ("presliding_hysteresis", {"frequency": "50 Hz"}, "100 samples per cycle"),
        ("force_rate", {"torque_rates": ["0 N m/s"]}, "positive"),
    ],
)
def test_options_that_do_not_go_together(kind: str, options: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        trials(kind, specimen(), options)


@pytest.mark.parametrize("kind", [*KINDS, "model_output"])
def test_failed_trials_are_left_out(kind: str) -> None:
    options = {"speeds": ["1 rad/s"]} if kind == "stribeck_curve" else {}
    options |= {"duration": "1 s"} if kind == "stick_slip" else {}
    options |= {"torque_rates": ["1000 N m/s"]} if kind == "force_rate" else {}
    options |= {"frequency": "1 Hz"} if kind == "presliding_hysteresis" else {}
    done = execute(trials(kind, bench(), options))
    result = analyse(kind, [failed(item) for item in done])
    assert not result.figures
    assert "did not complete" in result.notes[0]


def test_defaults_suit_the_shipped_axis() -> None:
    """Every experiment shows something on a full-size axis without being told anything."""
    for kind in KINDS:
        options = {"speeds": ["0.1 deg/s", "10 deg/s"]} if kind == "stribeck_curve" else {}
        result = analyse(kind, execute(trials(kind, bench(), options)))
        assert len(result.figures) == 1
        assert all(np.isfinite(f.value) for f in result.findings), kind
        assert experiments()[kind].summary.endswith(")")


def test_scatter_of_what_another_model_lacks_goes_with_it() -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["variation"] = {
            "day": 1,
            "day_to_day": {"bristle_stiffness": 0.1, "static_torque": 0.1},
        }

    changed = Bench.model_validate(with_model(bench(edit), "stribeck"), context={"si": True})
    assert changed.variation is not None
    assert [line.name for line in changed.variation.days] == ["static_torque"]


ROUNDED = 0.5e-4
"""N m, and of the others in their units: half of the last digit that is published."""


def test_brackets_hold_what_was_published() -> None:
    """Peaks of the LuGre model and of stick-slip, within half of the last digit they have."""
    rates = [f"{rate} N m/s" for rate in PEAKS]
    ramps = result_of("force_rate", torque_rates=rates, peak_torque="4 N m", models=["lugre"])
    found = {float(str(f.conditions["torque_rate"])): f.known for f in ramps.findings}
    pull = result_of("stick_slip", stiffness="2 N m/rad", pull_rate="0.1 rad/s", duration="35 s")
    slips = {f.quantity: f.known for f in pull.findings}
    held = [(found[rate], peak, ROUNDED) for rate, peak in PEAKS.items()]
    held += [(slips["stick_slip_period"], 6.3627, ROUNDED)]
    held += [(slips["stick_slip_first_slip"], 7.478, 10 * ROUNDED)]
    held += [(slips["stick_slip_peak_torque"], 1.508, 10 * ROUNDED)]
    held += [(slips["stick_slip_top_rate"], 0.3698, ROUNDED)]
    for estimate, published, rounded in held:
        low, high = estimate.combined
        assert low is not None
        assert high is not None
        assert low - rounded <= published <= high + rounded, estimate
        assert high - low < 1e-3 * published, estimate
        assert Systematic("time step of the simulation") in estimate.systematic


@pytest.mark.parametrize(
    ("kind", "options", "key"),
    [
        ("force_rate", {"torque_rates": ["5 N m/s", "50 N m/s"], "peak_torque": "4 N m"}, None),
        ("friction_lag", {"frequencies": ["5 Hz", "20 Hz"]}, None),
        ("stribeck_curve", {"speeds": ["1 mrad/s"]}, None),
        ("stick_slip", {"stiffness": "2 N m/rad", "pull_rate": "0.1 rad/s"}, "slips"),
        ("model_output", {"models": ["lugre"]}, None),
    ],
)
def test_repeats_are_one_row_and_one_finding(
    kind: str, options: dict[str, Any], key: str | None
) -> None:
    done = execute(trials(kind, specimen(), options))
    once, thrice = analyse(kind, done), analyse(kind, [*done, *done, *done])
    assert len(thrice.tables[0].rows) == len(once.tables[0].rows)
    assert len(thrice.findings) == len(once.findings)
    for one, three in zip(once.findings, thrice.findings, strict=True):
        assert three.value == pytest.approx(one.value, rel=1e-12, nan_ok=True)
    if key is not None:
        assert thrice.tables[0].rows[0][key] == once.tables[0].rows[0][key]


def test_a_ripple_over_position_is_the_scatter_of_the_cycles() -> None:
    """Of 2 % and 400 periods per turn: cycles at different places differ, and the interval says so.

    Without it they agree to the last digit, and there is no scatter to speak of.
    """

    def rippled(tree: dict[str, Any]) -> None:
        tree["friction"]["load"]["ripple"] = {"amplitude": 0.02, "periods": 400.0}

    options = {"frequencies": ["1 Hz"], "cycles": 9}
    plain = analyse("friction_lag", execute(trials("friction_lag", bench(), options)))
    waved = analyse("friction_lag", execute(trials("friction_lag", bench(rippled), options)))
    (smooth,), (rough,) = plain.findings, waved.findings
    assert smooth.known.reason == ALIKE(digits=9)
    assert rough.known.freedom == 7  # the first cycle is not measured
    low, high = rough.known.combined
    assert low is not None
    assert high is not None
    assert low < smooth.value < high


DAMAGED = {
    "friction_lag": {"frequencies": ["20 Hz"]},
    "stick_slip": {"stiffness": "200 N m/rad", "pull_rate": "0.1 rad/s", "duration": "3 s"},
    "model_output": {"models": ["lugre"]},
}


def damaged(item: Done, channel: str, lost: slice) -> Done:
    """The same trial with samples of a channel lost, and with the metrics that are archived then.

    Samples that were lost are NaN.
    """
    samples = item.samples
    values = samples[channel].copy()
    values[lost] = math.nan
    info = samples.channels[channel]
    channels = {**samples.channels, channel: replace(info, samples=values)}
    hurt = replace(item, samples=replace(samples, channels=channels))
    measure = experiments()[item.trial.kind].measure
    assert measure is not None
    return replace(hurt, estimates=checked(measure(hurt)))


@pytest.mark.parametrize(
    ("kind", "channel", "gone"),
    [
        ("friction_lag", LOAD_RATE, {"friction_lag_width"}),
        ("friction_lag", FRICTION_TORQUE, {"friction_lag_width"}),
        ("stick_slip", LOAD_RATE, {"stick_slip_first_slip", "stick_slip_top_rate"}),
        ("stick_slip", DRIVE_TORQUE, {"stick_slip_peak_torque"}),
        ("model_output", LOAD_RATE, {"model_at_reversal"}),
        ("model_output", FRICTION_TORQUE, {"model_peak"}),
    ],
)
@pytest.mark.parametrize("lost", [slice(-30, -20), slice(None)], ids=["some", "all"])
@pytest.mark.parametrize("both", [False, True], ids=["one", "both"])
def test_samples_that_were_lost_cost_their_numbers_and_no_analysis(
    kind: str, channel: str, gone: set[str], lost: slice, both: bool
) -> None:
    """Of two repeats, one or both are damaged, at the end of what is looked at or everywhere."""
    (item,) = execute(trials(kind, bench(), DAMAGED[kind]))
    hurt = damaged(item, channel, lost)
    result = analyse(kind, [hurt, hurt] if both else [item, hurt])
    reasons = {
        each.quantity: each.estimate.reason
        for each in result.findings
        if math.isnan(each.value) and each.estimate is not None
    }
    assert gone <= set(reasons)
    assert all(reasons[name] in LOST or reasons[name] in NO_REVERSAL for name in gone)
    few = any("fewer than three slips" in note for note in result.notes)
    assert not (few and channel == LOAD_RATE), "nobody knows how many there were"


@pytest.mark.parametrize("viscous", [0.1, 0.4])
@pytest.mark.parametrize(("overtakes", "rests"), [(1.6, True), (0.1, False)])
def test_a_rest_is_a_fifth_of_a_period(viscous: float, overtakes: float, rests: bool) -> None:
    """Let go at Fs, a load on a spring K overtakes the pull v by (Fs - Fc) / sqrt(K J), `overtakes`
    times v. Without damping, its rate is zero again after a phase of 2 pi - 2 atan(overtakes), and
    it rests for one of 2 overtakes.
    """
    pull = 20.0 * VS
    stiffness = ((FS - FC) / pull / overtakes) ** 2
    tree = tomllib.loads(SPECIMEN)
    tree["friction"]["load"]["viscous_friction"] = f"{viscous} N m s/rad"
    period = 2.0 * math.pi / math.sqrt(stiffness)
    options = {
        "models": ["stribeck"],
        "stiffness": f"{stiffness} N m/rad",
        "pull_rate": f"{pull} rad/s",
        "slip_rate": f"{pull} rad/s",
        "duration": f"{FS / (stiffness * pull) + 20.0 * period} s",
    }
    bench = Bench.model_validate(tree)
    found = analyse("stick_slip", execute(trials("stick_slip", bench, options)))
    (row,) = table(found, "stick-slip").rows
    assert (row["rests"] > 9) is rests
    if rests:
        phase = 2.0 * (math.pi - math.atan(overtakes) + overtakes)
        assert row["period"] == pytest.approx(phase / math.sqrt(stiffness), rel=0.05)


def test_many_pulls_over_two_numbers_are_a_map() -> None:
    tree = tomllib.loads(SPECIMEN)
    tree["limits"]["torque"] = "1e6 N m"
    bench, done = Bench.model_validate(tree), []
    for stiffness, rate in itertools.product((2.0, 20.0, 1e4), (0.02, 0.1, 0.2)):
        sizes = {"stiffness": f"{stiffness} N m/rad", "pull_rate": f"{rate} rad/s"}
        options = {"models": ["stribeck"], "duration": "20 s", **sizes}
        (trial,) = trials("stick_slip", bench, options)
        point = {**trial.point, "stiffness": stiffness, "pull_rate": rate}
        done += execute([trial.model_copy(update={"number": 1 + len(done), "point": point})])
    (figure,) = analyse("stick_slip", done).figures
    (panel,) = figure.panels
    assert panel.title == "stribeck"
    assert [len(curve.x) for curve in panel.curves] == [3, 3, 3]
    assert [panel.x.label, panel.y.label] == ["stiffness", "pull rate"]
    unseen = [
        replace(
            item,
            samples=replace(
                item.samples,
                channels={k: v for k, v in item.samples.channels.items() if k != RELATIVE_ANGLE},
            ),
        )
        for item in done
    ]
    (panel,) = analyse("stick_slip", unseen).figures[0].panels
    assert [curve.label for curve in panel.curves] == ["not determined"]


def test_a_model_keeps_what_another_has_within_tables_too() -> None:
    tree = tomllib.loads(SPECIMEN)
    tree["friction"]["load"]["negative"] = {"coulomb_torque": "1.1 N m", "static_torque": "1.6 N m"}
    described: Any = with_model(Bench.model_validate(tree), "dahl")
    assert described["friction"]["load"]["negative"] == {
        "coulomb_torque": 1.1,
        "viscous_friction": None,
    }
