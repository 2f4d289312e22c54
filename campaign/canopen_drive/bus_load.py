"""How much of a CAN bus a trial takes, in bits of the worst case."""

from __future__ import annotations

from campaign.canopen_drive.objects import MAPPED, TARGET_VELOCITY
from campaign.canopen_drive.settings import cycle

LARGEST = 0.5
"""Of the bus. The rest is for SDO, emergency messages, and other nodes."""
PROMISED = 100.0
"""Hz that are recorded without a measurement of the jitter."""


def frame_bits(size: int) -> int:
    """Of a data frame with 11-bit identifier and `size` bytes, the 3 bits between frames included.

    34 + 8 size bits are subject to stuffing, at worst one bit in each four after the first
    (R. I. Davis et al., Controller Area Network schedulability analysis, 2007, eq. 1).
    """
    stuffed = 34 + 8 * size
    return stuffed + 13 + (stuffed - 1) // 4


def bus_load(sample_rate: float, bitrate: int, heartbeat: float) -> float:
    """Share of the bus: SYNC, target and answers of each sample, and both heartbeats.

    `sample_rate` in Hz, `bitrate` in bit/s; `heartbeat` (s) is the time that the drive waits.
    """
    answers = sum(frame_bits(sum(item.bits for item in pdo) // 8) for pdo in MAPPED)
    each = frame_bits(1) + frame_bits(TARGET_VELOCITY.bits // 8) + answers
    beats = 2 * frame_bits(1) * 4 / heartbeat
    return (each * sample_rate + beats) / bitrate


def beyond_bus(sample_rate: float, bitrate: int, heartbeat: float) -> str | None:
    """Why a bus cannot carry a trial; arguments as of `bus_load`."""
    try:
        cycle(1 / sample_rate)
    except ValueError as error:
        return f"task.sample_rate = {sample_rate:g} Hz: {error}; take {PROMISED:g} Hz"
    load = bus_load(sample_rate, bitrate, heartbeat)
    if load <= LARGEST:
        return None
    return (
        f"task.sample_rate = {sample_rate:g} Hz takes {load:.0%} of a bus of {bitrate:g} bit/s; "
        f"at most {LARGEST:.0%} is used: sample_rate = \"{PROMISED:g} Hz\""
    )  # fmt: skip
