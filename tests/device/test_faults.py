"""Faults as they are written, and what they do to bytes."""

from __future__ import annotations

import pytest

from campaign.device.faults import FaultName, FaultSpec, parse_fault, parse_faults
from campaign.device.noise import BadLine, ByteNoise
from campaign.errors import UsageError

DATA = bytes(range(256)) * 400


def test_a_fault_has_a_name_a_value_a_trial_and_a_time() -> None:
    assert parse_fault("reboot@trial=2@time=1.5") == FaultSpec(
        FaultName.REBOOT, seconds=0.2, trial=2, time=1.5
    )
    assert parse_fault("drop=1e-4") == FaultSpec(FaultName.DROP, rate=1e-4)
    assert parse_fault("sensor=motor_current").channel == "motor_current"


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("rebot", "reboot"),
        ("drop", "rate"),
        ("drop=2", "rate"),
        ("drop=1e-4@time=1", "@trial=N"),
        ("reboot@trial=0", "@trial=N"),
        ("sensor=load_rate", "gyro_rate"),
        ("limit-switch=3", "no value"),
        ("stall=nan", "seconds"),
    ],
)
def test_what_cannot_be_meant_is_refused(text: str, word: str) -> None:
    with pytest.raises(UsageError, match=word):
        parse_fault(text)


@pytest.mark.parametrize(
    ("name", "length"), [(FaultName.DROP, -1), (FaultName.DUPLICATE, 1), (FaultName.CORRUPT, 0)]
)
def test_bytes_are_met_at_the_rate_that_was_asked_for(name: FaultName, length: int) -> None:
    damaged = ByteNoise({name: 0.01}, (1,))(DATA)
    if length:
        hits = (len(damaged) - len(DATA)) * length
    else:
        hits = sum(a != b for a, b in zip(damaged, DATA, strict=True))
    assert 0.008 < hits / len(DATA) < 0.012


def test_swapped_bytes_are_still_all_there() -> None:
    damaged = ByteNoise({FaultName.REORDER: 0.01}, (1,))(DATA)
    assert damaged != DATA
    assert sorted(damaged) == sorted(DATA)


def test_which_bytes_are_met_does_not_depend_on_the_chunks() -> None:
    rates = {FaultName.DROP: 0.01, FaultName.CORRUPT: 0.01}
    whole = ByteNoise(rates, (3,))(DATA)
    noise = ByteNoise(rates, (3,))
    pieces = b"".join(noise(DATA[i : i + 97]) for i in range(0, len(DATA), 97))
    assert pieces == whole


def test_a_line_is_bad_in_the_trial_that_was_named_only() -> None:
    line = BadLine(parse_faults(["drop=0.5@trial=2"]), 1)
    assert line.sent(DATA) == DATA
    line.enter(2)
    assert line.sent(DATA) != DATA
    line.enter(None)
    assert line.sent(DATA) == DATA


def test_blocks_are_lost_at_their_rate() -> None:
    line = BadLine(parse_faults(["lost-blocks=0.1"]), 1)
    lost = sum(line.loses_block() for _ in range(10_000))
    assert 900 < lost < 1100
