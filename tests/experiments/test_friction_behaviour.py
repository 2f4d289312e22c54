"""The behaviour experiments against the 1995 paper's numbers, closed forms and scipy."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from campaign.experiments import experiments
from campaign.experiments.friction_models import with_model
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.result import Result
from tests.experiments.laboratory import analyse, execute, failed, finding, table, trials
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
    assert math.isnan(finding(result, "stick_slip_period").value)
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
