"""Intervals of the stabilization test end to end: metrics, windows, and how often they hold.

On the virtual hardware, whose friction differs from trial to trial.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from campaign.estimate import Estimate, Window
from campaign.estimation.sampled_curve import LOST
from campaign.estimation.stabilization_error import OF_ONE_TRIAL
from campaign.experiments.stabilization.experiment import EXPERIMENT, OF_A_RECORD
from campaign.physics.bench import Bench
from campaign.reason import NONE
from campaign.trial import Trial
from tests.estimation.coverage import holds, rejected
from tests.experiments.laboratory import Done, analyse, execute, finding, table_of_estimates, trials

BENCHES = Path(__file__).parents[2] / "protocols" / "benches"
METHODS = [{"compensation": name} for name in ("none", "static", "lugre", "observer")]
SHORT = {"cycles": 2, "settle_cycles": 2, "sample_rate": "200 Hz"}
REDUCTION = ("none", "lugre")


@cache
def platform() -> Bench:
    return Bench.model_validate(tomllib.loads((BENCHES / "platform.toml").read_text()))


@pytest.fixture(scope="module")
def done() -> tuple[Done, ...]:
    return execute(trials("stabilization", platform(), {"cycles": 3}, METHODS * 3))


def test_repeats_say_where_the_mean_and_where_one_more_trial_lies(done) -> None:
    result = analyse("stabilization", done)
    for name in ("none", "static", "lugre", "observer"):
        mean = finding(result, "stabilization_error", compensation=name).estimate
        single = finding(result, "stabilization_error_of_one_trial", compensation=name).estimate
        assert (mean.freedom, mean.reason) == (2, NONE)
        wide = np.log([single.high / single.low, mean.high / mean.low])
        assert wide[0] / wide[1] == pytest.approx(2.0)  # sqrt(3 + 1)
    for row in table_of_estimates(result, "stabilization-error").rows:
        assert row["peak"].freedom == 2
        assert row["peak"].kind == "quantile"


def test_a_single_trial_says_that_its_interval_is_of_that_trial(done) -> None:
    result = analyse("stabilization", done[:4])
    for quantity in ("stabilization_error", "error_reduction", "error_decrease"):
        found = [f.estimate for f in result.findings if f.quantity == quantity]
        assert found
        for estimate in found:
            assert estimate.has_interval
            assert estimate.reason in OF_ONE_TRIAL
    rows = table_of_estimates(result, "stabilization-error").rows
    assert all(row["peak"].reason in OF_A_RECORD for row in rows)


def test_the_load_of_the_virtual_hardware_hardly_sticks_and_the_sensors_show_it(done) -> None:
    """True share by the simulator's own rate; one encoder count would say 1 to 2 %."""
    rows = table_of_estimates(analyse("stabilization", done[:4]), "stabilization-error").rows
    for item, row in zip(done[:4], rows, strict=True):
        cut = item.samples.window(*item.trial.task.window)
        true = np.abs(cut["load_rate"] - cut["base_rate"])
        assert holds(row["stuck"], float(np.mean(true < 1e-3 * np.max(np.abs(cut["base_rate"])))))
        assert row["stuck"].value < 1.5e-3


def test_metrics_of_a_recording_are_what_the_analysis_builds_on(done) -> None:
    (measured,) = (EXPERIMENT.measure(item) for item in done[:1])
    names = [estimate.name for estimate in measured]
    assert names == ["stabilization_error", "largest_error", "time_stuck"]
    assert all(np.isfinite(estimate.value) for estimate in measured)
    archived = [replace(item, estimates=tuple(EXPERIMENT.measure(item))) for item in done[:4]]
    assert (
        analyse("stabilization", archived).findings == analyse("stabilization", done[:4]).findings
    )
    twice = replace(measured[0], value=2e-3, low=1.9e-3, high=2.1e-3)
    told = analyse("stabilization", [replace(archived[0], estimates=(twice,))])
    assert finding(told, "stabilization_error").estimate == twice


def test_a_trial_has_its_windows_and_one_of_an_older_program_gets_them(done) -> None:
    trial = done[0].trial
    assert [window.name for window in trial.windows] == ["measured", "shown"]
    assert (trial.windows[0].start, trial.windows[0].stop) == trial.task.window
    assert trial.windows[1].stop == pytest.approx(trial.task.window[0] + 1.5 / 0.24)
    older = replace(done[0], trial=trial.model_copy(update={"windows": ()}))
    assert EXPERIMENT.measure(older) == EXPERIMENT.measure(done[0])
    other = Window("measured", trial.windows[0].start, 10.0)
    moved = replace(done[0], trial=trial.model_copy(update={"windows": (other,)}))
    assert EXPERIMENT.measure(moved) != EXPERIMENT.measure(done[0])


def test_an_error_along_a_sweep_has_bars_and_a_caption_says_what_is_shown() -> None:
    frequencies = (0.5, 1.0, 2.0)
    planned = trials(
        "stabilization", platform(), SHORT, [{"frequency": f"{f} Hz"} for f in frequencies]
    )
    points = ({"point": {"frequency": f}} for f in frequencies)  # SI, as a plan has them
    swept = [t.model_copy(update=point) for t, point in zip(planned, points, strict=True)]
    result = analyse("stabilization", execute(swept))
    figures = {figure.key: figure for figure in result.figures}
    (curve,) = figures["error-over-frequency"].panels[0].curves
    assert np.all(curve.low < curve.y)
    assert np.all(curve.y < curve.high)
    largest = frequencies[int(np.argmax(curve.y))]
    told = f"Shown at {largest:g} Hz, 18 deg/s², one of 3 conditions."
    assert figures["position-error"].caption.endswith(told)
    (number,) = (t.number for t in swept if t.point["frequency"] == largest)
    assert figures["position-error"].trials == (number,)


def test_lost_samples_leave_a_number_out_and_say_so(done) -> None:
    channel = done[0].samples.channels["pointing_error"]
    samples = channel.samples.copy()
    samples[-100] = np.nan
    holed = {**done[0].samples.channels, "pointing_error": replace(channel, samples=samples)}
    item = replace(done[0], samples=replace(done[0].samples, channels=holed))
    (row,) = table_of_estimates(analyse("stabilization", [item]), "stabilization-error").rows
    assert (row["error"].origin, row["error"].reason) == ("not determined", LOST())


# How often the truth is held.


def errors_of(method: str, count: int, first_seed: int, **options: object) -> list[Estimate]:
    """Stabilization errors of trials that differ in nothing but their seeds."""
    (trial,) = trials("stabilization", platform(), {**SHORT, **options}, [{"compensation": method}])
    found = []
    for seed in range(first_seed, first_seed + count):
        (item,) = execute([trial.model_copy(update={"seed": seed})])
        found.append(EXPERIMENT.measure(item)[0])
    return found


def _together(planned: Sequence[Trial], values: Sequence[float]) -> list[Done]:
    """Trials with made metrics, as an archive would give them."""
    (some,) = execute(planned[:1])
    return [
        replace(some, trial=trial, estimates=(Estimate("stabilization_error", value, "rad"),))
        for trial, value in zip(planned, values, strict=True)
    ]


draws = pytest.mark.parametrize(
    "count",
    [pytest.param(60, id="sample"), pytest.param(600, id="all", marks=pytest.mark.statistics)],
)


@pytest.mark.slow
@draws
def test_repeated_trials_hold_the_error_of_the_bench(count: int) -> None:
    """Mean and ratio of 3 and of 5 trials; the truth is the mean of all that were made.

    The intervals of single trials do not: they are of their own trial.
    """
    values = {m: np.array([e.value for e in errors_of(m, count, 7000)]) for m in REDUCTION}
    truth = {method: float(np.exp(np.mean(np.log(found)))) for method, found in values.items()}
    matrix = [{"compensation": method} for method in REDUCTION]
    held: dict[str, list[bool]] = {}
    for repeats in (3, 5):
        planned = trials("stabilization", platform(), SHORT, matrix * repeats)
        for start in range(0, count - repeats + 1, repeats):
            pairs = [values[m][start + k] for k in range(repeats) for m in REDUCTION]
            result = analyse("stabilization", _together(planned, pairs))
            for method in REDUCTION:
                mean = finding(result, "stabilization_error", compensation=method).estimate
                held.setdefault(f"{method}, {repeats}", []).append(holds(mean, truth[method]))
            ratio = finding(result, "error_reduction").estimate
            expected = truth["none"] / truth["lugre"]
            held.setdefault(f"reduction, {repeats}", []).append(holds(ratio, expected))
    assert rejected(held, "less") == {}


@pytest.mark.slow
@draws
def test_half_cycles_hold_the_error_of_their_own_trial(count: int) -> None:
    """The truth is what thirty cycles of the same trial come to."""
    held: dict[str, list[bool]] = {}
    for method in REDUCTION:
        (trial,) = trials(
            "stabilization", platform(), {**SHORT, "cycles": 30}, [{"compensation": method}]
        )
        for seed in range(8000, 8000 + count // 10):
            (item,) = execute([trial.model_copy(update={"seed": seed})])
            truth = EXPERIMENT.measure(item)[0].value
            start, stop = trial.task.window
            for cycles, share in ((2, 2 / 30), (3, 3 / 30)):
                part = Window("measured", start, start + share * (stop - start))
                cut = trial.model_copy(update={"windows": (part,)})
                one = EXPERIMENT.measure(replace(item, trial=cut))[0]
                held.setdefault(f"{method}, {cycles} cycles", []).append(holds(one, truth))
    assert rejected(held, "less", 0.9) == {}
