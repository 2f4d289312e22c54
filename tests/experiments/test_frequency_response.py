"""Stepped sines on benches whose response has a closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete

from campaign.estimate import Estimate
from campaign.experiments.frequency_response.experiment import EXPERIMENT, _point
from campaign.physics.limits import margins
from campaign.recording import Recording
from campaign.result import Figure, Result
from tests.estimation.coverage import holds
from tests.experiments.laboratory import (
    analyse,
    execute,
    failed,
    finding,
    table,
    table_of_estimates,
    trials,
)
from tests.physics.benches import DEG, INERTIA, KE, KIC, KIV, KPC, KPV, KT, RATIO, L, R, bench

KIND = "frequency_response"


def bode(result: Result) -> Figure:
    return next(figure for figure in result.figures if figure.key == "closed-loop")


NOTHING = Recording(np.empty(0), {})
SOME = {"frequencies": ["0.5 Hz", "3 Hz", "10 Hz", "40 Hz", "100 Hz"]}


def frictionless(tree: dict[str, Any]) -> None:
    tree["friction"] = {}


def sampled(tree: dict[str, Any]) -> None:
    frictionless(tree)
    tree["controller"] |= {"sample_rate": "1 kHz", "delay": "1 ms"}


def dry(tree: dict[str, Any]) -> None:
    coulomb = {"coulomb_torque": "26 N m", "static_torque": "26 N m"}
    load = {"model": "stribeck", "stribeck_velocity": "0.03 rad/s", **coulomb}
    tree["friction"] = {"load": load}


def current_to_rate(s: complex) -> complex:
    """Commanded current to load rate: motor, back-EMF and current controller."""
    controller, winding = KPC + KIC / s, R + L * s
    # i = (C i* - Ke N w) / (Z + C), J s w = N Kt i
    loop = RATIO * KT / (INERTIA * s) / (winding + controller)
    return controller * loop / (1 + KE * RATIO * loop)


def measured(edit: Any, options: dict[str, Any]) -> dict[float, complex]:
    """Response by frequency, as the analysis finds it."""
    done = execute(trials(KIND, bench(edit), options))
    assert {item.ending.outcome for item in done} == {"completed"}
    points = [_point(item) for item in done]
    return {point.frequency: point.response for point in points}


def test_closed_loop_of_a_continuous_bench_without_friction() -> None:
    for frequency, found in measured(frictionless, SOME).items():
        s = 2j * np.pi * frequency
        loop = KPV * DEG * (1 + KIV / s) * current_to_rate(s)
        assert found == pytest.approx(loop / (1 + loop), rel=2e-3)


def test_closed_loop_of_a_sampled_bench_without_friction() -> None:
    """Held current, one sample of delay, and a PI whose integral is summed backwards."""
    for frequency, found in measured(sampled, SOME).items():
        (loop,) = sampled_loop(np.exp([2j * np.pi * frequency * 1e-3]))
        assert found == pytest.approx(loop / (1 + loop), rel=2e-3)


def sampled_loop(z: np.ndarray) -> np.ndarray:
    """L of the bench `sampled`, shape (n,)."""
    # States: rate, current, integral of the current error; input: commanded current.
    a = np.array([[0, RATIO * KT / INERTIA, 0], [-KE * RATIO / L, -(R + KPC) / L, KIC / L]])
    a = np.vstack([a, [0, -1, 0]])
    b = np.array([[0.0], [KPC / L], [1.0]])
    ad, bd, *_ = cont2discrete((a, b, np.eye(3), np.zeros((3, 1))), 1e-3)
    plant = np.array([np.linalg.solve(one * np.eye(3) - ad, bd)[0, 0] / one for one in z])
    return KPV * DEG * (1 + KIV * 1e-3 * z / (z - 1)) * plant


def test_open_loop_of_a_free_axis_is_an_integrator_and_swings_around_the_middle() -> None:
    options = {"loop": "open", "torque": "60 N m", "frequencies": ["1 Hz", "20 Hz"]}
    done = execute(trials(KIND, bench(frictionless), options))
    for frequency, found in measured(frictionless, options).items():
        assert found == pytest.approx(1 / (2j * np.pi * frequency * INERTIA), rel=1e-3)
    swing = 60.0 / (INERTIA * (2 * np.pi) ** 2)
    angle = done[0].samples["relative_angle"]
    assert np.max(angle) == pytest.approx(swing, rel=0.02)
    assert np.min(angle) == pytest.approx(-swing, rel=0.02)


def test_coulomb_friction_in_sliding() -> None:
    """Sliding without sticking, Coulomb friction is a square wave, 4 Tc / pi at the frequency.

    A cos(wt) drives; the rate passes zero at w t0 = -asin(pi Tc / 2 A), from integrating the
    equation of motion over half a cycle (exact, unlike the describing function).
    """
    options = {"loop": "open", "torque": "150 N m", "frequencies": ["1 Hz"]}
    reversal = -np.arcsin(np.pi * 26.0 / (2 * 150.0))
    friction = -1j * np.exp(-1j * reversal) * 4 * 26.0 / np.pi
    expected = (1 - friction / 150.0) / (2j * np.pi * INERTIA)
    assert measured(dry, options)[1.0] == pytest.approx(expected, rel=2e-3)


def test_an_open_loop_drifts_little_even_where_friction_differs_by_direction() -> None:

    def lopsided(tree: dict[str, Any]) -> None:
        tree["friction"]["load"]["negative"] = {"coulomb_torque": "28 N m"}

    options = {"loop": "open", "torque": "60 N m", "frequencies": ["0.5 Hz", "5 Hz"]}
    for item in execute(trials(KIND, bench(lopsided), options)):
        assert np.max(np.abs(item.samples["relative_angle"])) < np.deg2rad(30)


def sweep(edit: Any = None, matrix: Any = ({},), **options: Any) -> Result:
    chosen = {"lowest": "1 Hz", "highest": "60 Hz", "step": "1 Hz", "cycles": 6, **options}
    return analyse(KIND, execute(trials(KIND, bench(edit), chosen, matrix)))


def test_margins_of_the_frictionless_loop() -> None:
    """From the exact open loop, on a grid far finer than the sweep."""
    result = sweep(frictionless)
    fine = 2j * np.pi * np.geomspace(0.5, 60, 100_000)
    loop = KPV * DEG * (1 + KIV / fine) * np.array([current_to_rate(s) for s in fine])
    hertz = fine.imag / (2 * np.pi)
    closed = np.abs(loop / (1 + loop))
    width = finding(result, "bandwidth", compensation="none").value
    assert width == pytest.approx(hertz[np.argmax(closed < 10**-0.15)], rel=5e-3)
    crossover = np.argmax(np.abs(loop) < 1)
    margin = finding(result, "phase_margin", compensation="none").value
    assert margin == pytest.approx(np.pi + np.angle(loop[crossover]), abs=np.deg2rad(0.5))


def test_friction_narrows_the_band_the_more_the_smaller_the_amplitude() -> None:
    options: dict[str, Any] = {"highest": "30 Hz"}
    large = sweep(amplitude="30 deg/s", **options)
    small = sweep(amplitude="1 deg/s", **options)
    free = sweep(frictionless, **options)
    widths = [finding(result, "bandwidth").value for result in (small, large, free)]
    assert widths == sorted(widths)
    assert widths[0] < widths[1] - 0.3


def test_where_limits_lower_the_amplitude_is_told() -> None:
    """360 deg/s^2 allow 30 deg/s up to 1.91 Hz, and 2.86 deg/s at 20 Hz."""
    notes = " ".join(sweep(frictionless, highest="20 Hz").notes)
    assert "30 deg/s below 2 Hz" in notes
    assert "2.86 deg/s at 20 Hz" in notes
    assert "amplitude was" not in " ".join(sweep(frictionless, highest="1 Hz").notes)


def test_what_compensation_changes_is_told() -> None:
    matrix = [{"compensation": "none"}, {"compensation": "lugre"}]
    result = sweep(matrix=matrix, highest="20 Hz")
    bare, with_model = (
        finding(result, "bandwidth", compensation=name).value for name in ("none", "lugre")
    )
    change = finding(result, "bandwidth_change", compensation="lugre")
    assert change.value == pytest.approx(with_model - bare)
    (row,) = table(result, "compensation-effect").rows
    assert row["compensation"] == "lugre"
    assert [(figure.key, figure.thesis) for figure in result.figures] == [
        ("servo-characteristics", ()),
        ("closed-loop", ("5.5",)),
        ("open-loop", ("5.6",)),
    ]


def test_the_elastic_mode_is_found_in_the_open_loop() -> None:
    """An appendage of 2 % that swings at 11 Hz when held resonates at 11 / sqrt(0.98)."""

    def elastic(tree: dict[str, Any]) -> None:
        tree["appendage"] = {"inertia": "0.7 kg m^2", "frequency": "11 Hz", "damping_ratio": 0.03}

    result = sweep(elastic, loop="open", step="0.5 Hz", torque="80 N m")
    found = finding(result, "elastic_mode_frequency", compensation="none")
    assert found.value == pytest.approx(11.0 / np.sqrt(0.98), rel=0.01)
    assert result.figures[0].thesis == ("4.5",)
    rigid = sweep(loop="open", step="0.5 Hz", torque="80 N m")
    assert not rigid.findings
    assert any("no elastic mode" in note for note in rigid.notes)


def test_the_thesis_sweep_and_its_amplitudes() -> None:
    """200 frequencies of 16 cycles, 30 deg/s until the acceleration would pass the limit."""
    planned = trials(KIND, bench(), {})
    assert len(planned) == 200
    frequencies = [trial.point["frequency"] for trial in planned]
    assert frequencies == pytest.approx(list(np.arange(1, 201) * 0.5))
    for trial in planned:
        command: Any = trial.task.command
        start, stop = trial.task.window
        assert (stop - start) * command.frequency == pytest.approx(16.0)
        largest = min(np.deg2rad(30), 0.9 * np.deg2rad(400) / (2 * np.pi * command.frequency))
        assert command.amplitude == pytest.approx(largest)
        assert not any(margin.broken for margin in margins(bench(), trial.task))


@pytest.mark.parametrize(
    ("edit", "options", "why"),
    [
        (sampled, {"highest": "450 Hz"}, "sample rate"),
        (None, {"lowest": "5 Hz", "highest": "1 Hz"}, "highest"),
        (None, {"step": "1e-6 Hz"}, "at most"),
        (None, {"loop": "open", "torque": "900 N m", "lowest": "0.1 Hz"}, "lower torque"),
    ],
)
def test_options_that_do_not_go_together(edit: Any, options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        trials(KIND, bench(edit), options)


def test_the_response_is_a_metric_of_its_trial_and_the_analysis_believes_it() -> None:
    """What was archived is read, not the samples: without them the numbers are the same."""
    options = {"lowest": "1 Hz", "highest": "20 Hz", "step": "1 Hz", "cycles": 4}
    done = execute(trials(KIND, bench(frictionless), options))
    measure = EXPERIMENT.measure
    assert measure is not None
    archived = [replace(item, estimates=tuple(measure(item)), samples=NOTHING) for item in done]
    names = {found.name for found in archived[0].estimates}
    assert names == {"response_real", "response_imag", "coherence"}
    told, measured_now = analyse(KIND, archived), analyse(KIND, done)
    assert told.findings == measured_now.findings
    assert told.tables == measured_now.tables
    moved = [
        replace(each, value=0.5 * each.value, low=None, high=None) for each in archived[0].estimates
    ]
    other = analyse(KIND, [replace(archived[0], estimates=tuple(moved)), *archived[1:]])
    assert bode(other).panels[0].curves[0].y[0] < -5


def test_only_the_window_is_measured_and_old_trials_have_one() -> None:
    """What is before it does not count; a trial without named windows has its task's."""
    (item,) = execute(trials(KIND, bench(frictionless), {"frequencies": ["10 Hz"], "cycles": 4}))
    (window,) = item.trial.windows
    assert (window.start, window.stop) == item.trial.task.window
    channels = {
        name: replace(channel, samples=np.where(item.samples.time < window.start, 9.0, samples))
        for name, channel in item.samples.channels.items()
        for samples in (channel.samples,)
    }
    spoilt = replace(item, samples=replace(item.samples, channels=channels))
    older = replace(spoilt, trial=item.trial.model_copy(update={"windows": ()}))
    assert _point(spoilt) == _point(item) == _point(older)


def test_a_sweep_to_100_hz_bounds_what_it_does_not_reach() -> None:
    """On `sampled`, phase -180 deg lies above 100 Hz: a hull of fits and a bound, and both hold."""
    at = {"frequencies": [f"{f} Hz" for f in (*range(2, 20), *range(20, 101, 4))], "cycles": 6}
    result = analyse(KIND, execute(trials(KIND, bench(sampled), at)))
    omega = 2 * np.pi * np.linspace(100, 400, 60_001)
    loop = sampled_loop(np.exp(1j * omega * 1e-3))
    turned = np.argmax(np.unwrap(np.angle(loop)) < -np.pi)
    margin = -20 * np.log10(abs(loop[turned]))
    known = finding(result, "gain_margin").known
    assert known.low is not None
    assert holds(known, margin)
    (row,) = table_of_estimates(result, "servo-characteristics").rows
    bound = row["gain_margin_bound"]
    assert isinstance(bound, Estimate)
    assert bound.kind == "at least"
    assert bound.value < margin
    (read,) = table(result, "crossovers").rows
    assert read["crossover"] == "extrapolated"


def test_failed_trials_leave_a_gap() -> None:
    done = list(execute(trials(KIND, bench(frictionless), SOME)))
    done[1] = failed(done[1])
    result = analyse(KIND, done)
    assert len(bode(result).panels[0].curves[0].x) == 4
    assert any("1 of 5 trials" in note for note in result.notes)


def test_a_response_of_fewer_than_three_counts_is_none() -> None:
    """Of a gyro of 0.1 deg/s: at 40 Hz the response is 0.03 deg/s, and a staircase of nothing."""

    def coarse(tree: dict[str, Any]) -> None:
        sampled(tree)
        tree["sensors"] = {"gyro": {"resolution": "0.1 deg/s"}}

    options = {"frequencies": ["3 Hz", "40 Hz"], "amplitude": "1 deg/s"}
    done = execute(trials(KIND, bench(coarse), options))
    exact = execute(trials(KIND, bench(sampled), options))
    sizes = [abs(_point(each).response) for each in exact]
    assert sizes[0] * 1.0 > 0.3 > sizes[1] * 1.0
    assert abs(_point(done[0]).response) == pytest.approx(sizes[0], rel=0.05)
    with pytest.raises(ValueError, match="below 3 counts"):
        _point(done[1])
    notes = " ".join(analyse(KIND, done).notes)
    assert "frequency=40 Hz]: its response is below 3 counts" in notes
