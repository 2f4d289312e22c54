"""Stretches in which the axis sticks and slips are no points of a friction map, and are counted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from campaign.estimation.steadiness import STICK_SLIP
from campaign.experiments.friction_map import map_result, steady_recordings
from campaign.experiments.friction_map.points import Point
from campaign.experiments.friction_map.stretches import Stretch, StretchOptions
from tests.experiments.asked import data_of
from tests.physics.benches import bench

STEP = 1e-3
TIME = np.arange(4000) * STEP


class OneTrial:
    """What the parameters of a map ask a trial for."""

    trial = SimpleNamespace(
        recording={"made": "elsewhere"},
        bench=bench().model_dump(mode="json"),
        number=1,
        role="measurement",
        windows=(),
        options={},
    )
    ending = SimpleNamespace(outcome="completed")
    not_kept = ""

    @staticmethod
    def channel_names() -> frozenset[str]:
        return frozenset({"relative_rate", "drive_torque"})


def stretch(speed: float, *, slips: bool) -> Point:
    """Friction of 5 N m + 2 N m s/rad, at one speed or in slips of it, by an encoder of 16 bits."""
    pulses = np.maximum(0.0, np.sin(2 * np.pi * TIME / 0.4)) * np.pi
    rate = speed * (pulses if slips else np.ones_like(TIME))
    count = 2 * np.pi / 65536
    angle = np.round(np.cumsum(rate) * STEP / count) * count
    counted = np.diff(angle, prepend=angle[0]) / STEP
    noise = 0.01 * np.random.default_rng(round(1e4 * speed)).normal(size=len(TIME))
    torque = 5.0 + 2.0 * speed + noise - (1.0 if slips else 0.0)
    wrapped = np.angle(np.exp(1j * (angle + 3.0)))
    (trial,) = data_of([OneTrial()]).trials
    return Stretch(trial, TIME, counted, torque, wrapped, np.nan).point(None)


def identified(monkeypatch: pytest.MonkeyPatch, points: list[Point]) -> Any:
    monkeypatch.setattr(steady_recordings, "points_of", lambda *_: (points, None))
    options = StretchOptions.model_validate({"slowest": "1 mrad/s"})
    return map_result.identified(data_of([OneTrial()], model=options))


def test_they_are_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    steady = [stretch(speed, slips=False) for speed in (0.2, 0.5, 0.8, 1.2)]
    stuck = [stretch(speed, slips=True) for speed in (0.1, 0.15)]
    assert all(point.unsteady in STICK_SLIP for point in stuck)
    identification = identified(monkeypatch, [*stuck, *steady])
    (left,) = identification.identified.left_out
    assert left in steady_recordings.UNSTEADY
    assert dict(left.values) == {"count": 2, "total": 6, "why": STICK_SLIP.code}
    found = identification
    (told,) = (f for f in found.findings if f.quantity == "coulomb_torque_positive")
    assert told.estimate.value == pytest.approx(5.0, abs=0.01)
    rows = found.tables[0].rows
    assert [row["rate"].value > 0.18 for row in rows] == [not row["left_out"] for row in rows]


def test_where_all_are_the_reason_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="2 of 2 stretches are left out, for stick-slip"):
        identified(monkeypatch, [stretch(speed, slips=True) for speed in (0.1, 0.15)])
