"""Swept values in words: never raw SI."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.experiments.shared.swept_words import axis_of, name_of, quantity_of, words
from campaign.result import Axis
from tests.experiments.laboratory import trials
from tests.physics.benches import bench

BARE = frozenset({"frequency", "acceleration"})


def said(path: str, value: object) -> str:
    trial = trials("stabilization", bench(), {})[0]
    (text,) = words({path: value}, trial, BARE)  # type: ignore[dict-item]
    return text


@pytest.mark.parametrize(
    ("path", "value", "text"),
    [
        ("frequency", 0.24, "0.24 Hz"),
        ("acceleration", float(np.deg2rad(18.0)), "18 deg/s²"),
        ("cycles", 3, "cycles 3"),
        ("bench.axis.inertia", 36.0, "axis inertia 36 kg·m²"),
        ("bench.friction.load.coulomb_torque", 26.0, "load coulomb torque 26 N·m"),
        ("bench.no.such_thing", 0.5, "no such thing 0.5"),
        ("motion", "sea", "motion sea"),
        ("flag", True, "flag yes"),
    ],
)
def test_a_value_has_the_unit_of_its_option_or_of_its_bench(
    path: str, value: object, text: str
) -> None:
    assert said(path, value) == text


def test_an_axis_shows_a_readers_unit() -> None:
    trial = trials("stabilization", bench(), {})[0]
    found = axis_of("acceleration", trial)
    assert found == Axis("Acceleration", "rad/s^2", "deg/s^2")
    assert axis_of("cycles", trial) == Axis("Cycles")


def test_a_number_without_a_unit_has_no_quantity() -> None:
    trial = trials("stabilization", bench(), {})[0]
    assert quantity_of("cycles", trial) is None
    assert name_of("bench.gear.preload.torque") == "preload torque"
