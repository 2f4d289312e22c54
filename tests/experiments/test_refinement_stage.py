"""The refinement of a frequency response: where it looks, and that it keeps to its bound."""

from __future__ import annotations

import random

import numpy as np
import pytest
from scipy.optimize import brentq

from campaign.estimation.refinement import MOST
from campaign.experiments import experiments
from campaign.experiments.frequency_response.experiment import (
    EXPERIMENT,
    FrequencyResponseOptions,
    _refined_range,
    _request,
)
from campaign.experiments.interface import TestData, options_of
from campaign.physics.bench import Bench
from campaign.trial import Trial
from tests.experiments.laboratory import Done, analyse, execute, failed, finding, trials
from tests.experiments.test_frequency_response import current_to_rate, frictionless, sampled
from tests.physics.benches import DEG, KIV, KPV, bench

(STAGE,) = EXPERIMENT.stages
COARSE = {"frequencies": ["2 Hz", "5 Hz", "9 Hz", "16 Hz", "30 Hz"], "refine": True}


def closed_form_bandwidth() -> float:
    """Hz at which the frictionless loop falls below -3 dB."""

    def level(frequency: float) -> float:
        s = 2j * np.pi * frequency
        loop = KPV * DEG * (1 + KIV / s) * current_to_rate(s)
        return float(20 * np.log10(abs(loop / (1 + loop)))) + 3.0

    return float(brentq(level, 5.0, 40.0))


def refined(rig: Bench, done: tuple[Done, ...]) -> list[Trial]:
    """The trials that follow, as the program numbers them."""
    first = done[0].trial
    options = options_of(EXPERIMENT, first.options)
    requests = STAGE.trials(options, rig, TestData("", "", first.options, done))
    update = [{"task": r.task, "point": {**first.point, **r.point}} for r in requests]
    return [first.model_copy(update=each) for each in update]


def test_the_refined_bandwidth_has_a_narrower_interval_that_holds() -> None:
    rig = bench(frictionless)
    done = execute(trials("frequency_response", rig, COARSE))
    following = refined(rig, done)
    assert len(following) == 14  # around -3 dB and around 0 dB
    true = closed_form_bandwidth()
    widths = []
    for measured in (done, (*done, *execute(following))):
        found = finding(analyse("frequency_response", measured), "bandwidth").estimate
        assert found is not None
        low, high = found.combined
        assert low < true < high
        widths.append(high - low)
    assert widths[1] < widths[0] / 3, "what is read between the frequencies is known better"


def test_a_sweep_that_failed_or_was_not_to_be_refined_leads_nowhere() -> None:
    rig = bench(frictionless)
    done = execute(trials("frequency_response", rig, COARSE))
    assert refined(rig, tuple(failed(item) for item in done)) == []
    for options in ({}, {"refine": True, "loop": "open"}):
        chosen = FrequencyResponseOptions.model_validate(options)
        assert STAGE.most(chosen, rig).trials == 0


def drawn(chance: random.Random) -> FrequencyResponseOptions:
    first = chance.uniform(0.2, 20.0)
    sweep = [first * 1.3**k for k in range(chance.randint(1, 8))]
    return FrequencyResponseOptions.model_validate(
        {
            "frequencies": sweep,
            "cycles": chance.randint(1, 20),
            "settle_cycles": chance.randint(0, 5),
            "settle_time": chance.choice([0.0, 0.3, 2.0]),
            "samples_per_cycle": chance.randint(8, 60),
            "refine": True,
        },
        context={"si": True},
    )


@pytest.mark.parametrize("rig", [bench(frictionless), bench(sampled)], ids=["continuous", "1 kHz"])
def test_it_keeps_to_what_it_announced_wherever_the_crossings_are(rig: Bench) -> None:
    chance = random.Random(20261122)
    for _ in range(300):
        options = drawn(chance)
        most = STAGE.most(options, rig)
        lowest, highest = _refined_range(options, rig)
        asked = [
            _request(options, rig, chance.uniform(lowest, min(highest, 1.5 * lowest))).task
            for _ in range(MOST)
        ]
        asked[:2] = [_request(options, rig, frequency).task for frequency in (lowest, highest)]
        assert len(asked) == most.trials
        assert sum(task.duration for task in asked) <= most.duration
        assert sum(task.samples for task in asked) <= most.samples


def test_the_shipped_protocols_refine_nothing() -> None:
    assert FrequencyResponseOptions().refine is False
    assert experiments()["frequency_response"].stages == (STAGE,)
