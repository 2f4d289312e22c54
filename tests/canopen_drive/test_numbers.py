"""Units, targets, frames: numbers by hand."""

from __future__ import annotations

import math
from typing import Any

import pytest

from campaign.canopen_drive import objects as od
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.player import fault_of
from campaign.canopen_drive.settings import bus_load, cycle, frame_bits
from campaign.canopen_drive.targets import targets_of
from campaign.canopen_drive.units import Scale, scale_of
from campaign.recording import Fault
from campaign.trial import Task

TURN = 2 * math.pi


def scale(found: dict[od.Item, int], **given: Any) -> Scale:
    options: dict[str, Any] = {
        "ratio": 1.0, "reverse": False, "units_per_turn": None, "rate_units": None,
        "rated_torque": 2.0, "rated_current": 4.0, **given,
    }  # fmt: skip
    return scale_of(found.get, **options)


def test_increments_through_a_gear_of_the_bench() -> None:
    """4096 increments of the motor, gear of 10: 40960 per turn of the load, velocity in rpm."""
    found = {od.ENCODER_INCREMENTS: 4096, od.ENCODER_TURNS: 1, od.VELOCITY_UNIT: 0x00B44700}
    made = scale(found, ratio=10.0)
    assert made.position * TURN == pytest.approx(40960)
    assert made.rate * TURN == pytest.approx(600)  # 1 turn/s of the load: 600 rpm of the motor
    assert 1 / made.torque == pytest.approx(2.0e-3 * 10)  # N m at the load of 1 per mille
    assert 1 / made.current == pytest.approx(4e-3)
    assert made.motor_rate == pytest.approx(600 / TURN)


def test_a_gear_in_the_drive_is_not_counted_twice() -> None:
    found = {
        od.FEED: 36000, od.FEED_TURNS: 1, od.GEAR_MOTOR: 10, od.GEAR_SHAFT: 1,
        od.VELOCITY_NUMERATOR: 1, od.VELOCITY_DIVISOR: 60,
    }  # fmt: skip
    made = scale(found, ratio=10.0)
    assert made.position * TURN == pytest.approx(36000)
    assert made.rate * TURN == pytest.approx(600)
    with pytest.raises(DriveError, match="6091h"):
        scale(found, ratio=7.0)


def test_degrees_with_a_prefix_and_a_reversed_axis() -> None:
    """60A8h in 1/1000 degree: its last byte but one is 41h, its first -3."""
    made = scale({od.POSITION_UNIT: 0xFD410000}, reverse=True, rate_units=1.0)
    assert made.position * TURN == pytest.approx(-360e3)
    assert made.torque < 0


def test_what_the_drive_does_not_say_is_asked_for_by_option() -> None:
    with pytest.raises(DriveError, match="units_per_turn"):
        scale({})
    with pytest.raises(DriveError, match="rated_torque"):
        scale({}, units_per_turn=1000.0, rate_units=1.0, rated_torque=None)
    with pytest.raises(DriveError, match="rate_units"):
        scale({od.VELOCITY_UNIT: 0x00010300}, units_per_turn=1000.0)  # m/s


def test_frames_of_the_literature() -> None:
    """Davis et al. (2007): 8 bytes take at most 135 bits, none 55."""
    assert (frame_bits(8), frame_bits(0)) == (135, 55)
    assert bus_load(1000.0, 1_000_000, 0.2) < 0.5 < bus_load(1000.0, 500_000, 0.2)


def task(times: list[float], values: list[float]) -> Task:
    command = {"shape": "polyline", "times": times, "values": values}
    return Task.model_validate(
        {"mode": "rate", "command": command, "duration": 1.0, "window": (0, 1), "sample_rate": 10}
    )


def test_the_drive_makes_ramps_of_one_slope_itself() -> None:
    made = targets_of(task([0.2, 0.4, 0.6, 0.8], [0.0, 1.0, 1.0, 0.0]))
    assert made.slope == pytest.approx(5.0)
    assert made.values.tolist() == [0, 0, 1, 1, 1, 1, 0, 0, 0, 0]


def test_other_commands_are_reached_at_the_next_sync() -> None:
    made = targets_of(task([0.0, 0.5, 1.0], [0.0, 1.0, 0.5]))
    assert made.values[:6].tolist() == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0, 0.9])
    assert made.slope == pytest.approx(2.1)


def test_periods_that_60c2h_can_hold() -> None:
    assert cycle(0.01) == (10, -3)
    assert cycle(0.0005) == (5, -4)
    with pytest.raises(ValueError, match="60C2h"):
        cycle(1 / 30)


def test_error_codes() -> None:
    found = [fault_of(code) for code in (0x4210, 0x7305, 0x8130, 0x2310)]
    assert found == [Fault.OVER_TEMPERATURE, Fault.SENSOR, Fault.HEARTBEAT, Fault.DRIVE]
