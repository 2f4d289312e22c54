"""A limit that the resolution of the sensors alone would break is named in the plan."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.backends.sim import BACKEND, SimOptions
from campaign.cli.plan import show_plan
from campaign.cli.prepare import Request
from campaign.errors import LimitError
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.physics.limit_watch import judged_samples
from campaign.physics.limits import Margin
from campaign.physics.resolution import rate_of_one_count, resolution_margins
from campaign.protocol import Plan, check_limits, load_protocol, make_plan
from campaign.recording import MemoryRecorder, Outcome
from campaign.trial import Task
from tests.physics.benches import SIMULINK, bench, task

from .conftest import SHIPPED

COUNT = 2 * np.pi / 4096


def coarse(**limits: str) -> Bench:
    """A 12-bit encoder and a loop at 2 kHz without filter: one count per sample is 175.8 deg/s."""

    def edit(tree: dict[str, Any]) -> None:
        tree["controller"]["sample_rate"] = "2 kHz"
        tree["sensors"] = {"encoder": {"resolution": f"{COUNT!r} rad"}}
        tree["limits"] |= {"rate": "150 deg/s", **limits}

    return bench(edit)


def rate_margin(on: Bench, what: Task) -> Margin:
    return next(margin for margin in resolution_margins(on, what) if margin.limit == "rate")


def fast(**changes: Any) -> Task:
    return task(sample_rate=2000.0, **changes)


def test_one_count_is_the_resolution_over_the_judging_time() -> None:
    """Which is 1 % of 90 deg at 150 deg/s: 6 ms."""
    margin = rate_margin(coarse(), fast())
    assert margin.value == pytest.approx(COUNT / 6e-3)
    assert not margin.broken
    alone = rate_margin(coarse(rate_time="0.5 ms"), fast())
    assert np.rad2deg(alone.value) == pytest.approx(175.78, abs=0.01)
    assert alone.broken


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("low_pass", [0.0, 0.4e-3, 3e-3, 0.1])
@pytest.mark.parametrize("rate_time", [0.0005, 0.004, 0.01])
def test_against_a_count_that_is_filtered_and_averaged(
    every: int, low_pass: float, rate_time: float
) -> None:
    """The controller's own recursion, stepped, and every mean of its recorded values."""
    told = {"rate_time": f"{rate_time} s", "angle": "1000 deg"}
    on = coarse(**told)
    controller = on.controller.model_copy(update={"relative_rate_filter": low_pass})
    on = on.model_copy(update={"controller": controller})
    what = task(sample_rate=2000.0 / every)
    pole = np.exp(-0.5e-3 / low_pass) if low_pass else 0.0
    rate, rates = 0.0, []
    for sample in range(8000):
        rate = pole * rate + (1 - pole) * (COUNT / 0.5e-3 if sample == 400 else 0.0)
        rates.append(rate)
    count = judged_samples(on.limits, what.sample_rate)
    means = [
        np.convolve(rates[first::every], np.full(count, 1 / count))[: 8000 // every].max()
        for first in range(every)
    ]
    assert rate_of_one_count(on, what.sample_rate, 2000.0) == pytest.approx(max(means), rel=1e-9)


def test_the_other_sensors_are_held_against_their_limits() -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["controller"]["sample_rate"] = "1 kHz"
        tree["sensors"] = {"encoder": {"resolution": "1 deg"}, "current": {"resolution": "0.5 A"}}
        tree["limits"] |= {"current": "0.4 A", "torque": "5 N m", "angle": "0.5 deg"}

    found = {margin.limit: margin for margin in resolution_margins(bench(edit), task())}
    assert {limit for limit, margin in found.items() if margin.broken} == {
        "angle", "rate", "torque", "current",
    }  # fmt: skip
    assert found["torque"].value == pytest.approx(0.5 * 141.176 * 0.086)


def test_where_nothing_is_sensed_there_is_nothing_coarse() -> None:
    assert resolution_margins(bench(), task()) == ()
    assert resolution_margins(coarse(), fast(mode="spring", spring_stiffness=1.0)) == ()


PROTOCOL = """
[[test]]
name = "sea"
kind = "stabilization"
bench = "bench.toml"
seed = 1
cycles = 1
settle_cycles = 1
sample_rate = "2 kHz"
"""


def written(folder: Path, rate_time: str) -> Path:
    text = SIMULINK.read_text().replace('rate = "90 deg/s"', 'rate = "150 deg/s"')
    text = text.replace("[limits]\n", f'[limits]\nrate_time = "{rate_time}"\n')
    text += '\n[controller]\nsample_rate = "2 kHz"\n'
    text += f'\n[sensors.encoder]\nresolution = "{COUNT!r} rad"\n'
    (folder / "bench.toml").write_text(text)
    path = folder / "sea.toml"
    path.write_text(PROTOCOL)
    return path


def planned(folder: Path, rate_time: str) -> Plan:
    path = written(folder, rate_time)
    return make_plan(load_protocol(path, experiments(), shipped=SHIPPED))


def test_a_12_bit_encoder_at_2_khz_runs(tmp_path: Path) -> None:
    """Every such trial ended within 33 ms when each sample was judged alone."""
    plan = planned(tmp_path, "10 ms")
    check_limits(plan)
    [trial] = plan.trials
    recorder = MemoryRecorder()
    with BACKEND.open(SimOptions()) as backend:
        ending = backend.execute(trial, recorder, lambda: False)
    assert ending.outcome is Outcome.COMPLETED
    rate = recorder.recording(ending)["relative_rate"]
    assert np.rad2deg(np.max(np.abs(rate))) > 175


def test_one_sample_is_refused_with_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = planned(tmp_path, "0.5 ms")
    with pytest.raises(LimitError) as refused:
        check_limits(plan)
    said = str(refused.value)
    assert refused.value.exit_code == 3
    assert "sea: one count of the encoder reads as a rate of 175.8 deg/s, limit 150 deg/s" in said
    assert "limits.rate_time" in said
    assert "trial-00001" in said
    with pytest.raises(LimitError):
        show_plan(Request(str(tmp_path / "sea.toml")), tmp_path / "results", as_json=False)
    assert "117% of the rate limit: one count of the encoder" in capsys.readouterr().out


def test_what_comes_close_has_a_line_in_the_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, "1 ms")
    show_plan(Request(str(path)), tmp_path / "results", as_json=False)
    out = capsys.readouterr().out
    assert "59% of the rate limit: one count of the encoder reads as a rate of 87.89 deg/s" in out
    show_plan(Request(str(path)), tmp_path / "results", as_json=True)
    [test] = json.loads(capsys.readouterr().out)["tests"]
    [use] = test["coarse"]
    assert (use["limit"], use["sensor"], use["broken"]) == ("rate", "encoder", False)
    assert all(not use["sensor"] for use in test["limits"])
    show_plan(Request(str(written(tmp_path, "10 ms"))), tmp_path / "results", as_json=False)
    assert "one count" not in capsys.readouterr().out
