"""Stiffness and share of interfaces that slip one after the other, from torque ramps."""

from __future__ import annotations

import pytest

from campaign.estimation.presliding import Presliding
from campaign.experiments.breakaway import experiment as breakaway
from campaign.experiments.interface import TrialData
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.result import Result
from tests.experiments.asked import asked, suitable
from tests.experiments.laboratory import execute, trials
from tests.physics.benches import RATIO, bench

RAMPS = {
    "torque_rate": "1 N m/s",
    "peak_torque": "60 N m",
    "sliding_rate": "0.005 rad/s",
    "directions": ["positive"],
    "rest": "0.5 s",
    "positions": ["-30 deg", "0 deg", "30 deg"],
}


def identified(on: Bench) -> Result:
    return asked("ramps", execute(trials("breakaway", on, RAMPS)))


def test_the_strongest_interface_and_what_slips_before_it() -> None:
    result = identified(load_bench("platform"))
    found = {e.estimate.name: e.estimate for e in result.identified.parameters}
    assert found["strongest_stiffness"].value == pytest.approx(15284.0, rel=0.03)
    others = 2 * RATIO * 0.03143 + 2.99
    assert found["weaker_share"].value == pytest.approx(others / (20.84 + others), abs=0.02)
    assert found["weaker_share"].has_interval
    assert {part.source for part in found["weaker_share"].systematic} == {"ramp rate", "dwell"}


def test_one_interface_alone_has_no_weaker_ones() -> None:
    result = identified(bench(lambda tree: tree["friction"].pop("motor")))
    names = {e.estimate.name for e in result.identified.parameters}
    assert "breakaway_torque" in names
    assert "weaker_share" not in names


def test_a_ramp_whose_numbers_overflow_costs_that_ramp(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = breakaway.curve_of

    def curve_of(data: TrialData, torque: float) -> Presliding:
        if data.trial.number == 2:
            raise OverflowError("math range error")
        return whole(data, torque)

    monkeypatch.setattr(breakaway, "curve_of", curve_of)
    result = identified(bench(lambda tree: tree["friction"].pop("motor")))
    assert [row["measurement"] for row in result.tables[0].rows] == [1, 3, "mean"]
    assert [note for note in result.notes if "(trial 2): OverflowError" in note]


def test_trials_of_another_kind_do_not_do() -> None:
    other = execute(trials("stabilization", bench(), {"cycles": 1}))
    assert suitable("ramps", other) == (
        [],
        "there is no trial of breakaway with drive_torque and gyro_rate",
    )
