"""Bitwise difference of two recordings of one trial."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from campaign.recording import Array, Recording


def differences(was: Recording, now: Recording) -> list[str]:
    """Texts of all bitwise differences; empty for identical recordings.

    Channels are compared over the samples that both have. A missing channel, other lengths and
    another outcome are separate differences.
    """
    return list(_differences(was, now))


def changes(was: Recording, now: Recording) -> dict[str, float]:
    """By channel, the RMS of the change divided by the RMS before.

    Infinite for a change of an all-zero channel, for a channel in only one recording, and for
    another number of samples.
    """
    names = dict.fromkeys((*was.channels, *now.channels))
    both = was.channels.keys() & now.channels.keys()
    return {n: _change(was[n], now[n]) if n in both else math.inf for n in names}


def _change(was: Array, now: Array) -> float:
    if was.tobytes() == now.tobytes():
        return 0.0
    if len(was) != len(now):
        return math.inf
    gone, size = _rms(now - was), _rms(was)
    return gone / size if size > 0.0 else math.inf


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def _differences(was: Recording, now: Recording) -> Iterator[str]:
    if was.ending.outcome is not now.ending.outcome:
        yield f"outcome: {was.ending.outcome} → {now.ending.outcome}"
    if len(was.time) != len(now.time):
        yield f"samples: {len(was.time)} → {len(now.time)}; compared are those that both have"
    if difference := _compare(was.time, now.time):
        yield f"time [s]: {difference}"
    for name in dict.fromkeys((*was.channels, *now.channels)):
        if name not in now.channels or name not in was.channels:
            yield f"{name}: is only in the {'archive' if name in was.channels else 'repetition'}"
        elif difference := _compare(was[name], now[name]):
            yield f"{name} [{was.channels[name].unit}]: {difference}"


def _compare(was: Array, now: Array) -> str:
    """Number of different samples, first index, largest difference, as text; empty if none."""
    length = min(len(was), len(now))
    bits = [np.ascontiguousarray(a[:length], dtype="<f8").view("<u8") for a in (was, now)]
    different = np.flatnonzero(bits[0] != bits[1])
    if not len(different):
        return ""
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.abs(now[different] - was[different]).max()  # NaN when either of them is
    first = int(different[0])
    return (
        f"{len(different)} of {length} samples differ, the first at index {first}, by at most "
        f"{largest:.3g}"
    )
