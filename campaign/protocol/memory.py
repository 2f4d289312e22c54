"""Memory of a plan, estimated before it is made.

The bytes are measured (trial, margins, seed, place; a bench with its tree and its loops) and
rounded up. A plan above the bound is refused, even with `--allow-large`: a wrong digit must not
exhaust the memory of the machine that moves a bench.
"""

from __future__ import annotations

from campaign.protocol.matrix import count_points
from campaign.protocol.schema import Test
from campaign.signals import MultiSine, Polyline, Signal
from campaign.trial import Task

MOST = 10**9
"""Maximum bytes of a plan."""
SURELY = 10
"""Factor above the remaining memory at which the expansion stops without further points."""
TRIAL = 7_000
"""Bytes of a trial that shares bench and options with others."""
BENCH = 50_000
"""Bytes of each different bench."""
KNOT = 64
"""Bytes of a point of a command."""


def least(test: Test) -> int:
    """Minimum bytes of the plan of `test`; an experiment may request more trials."""
    benches = count_points([axis for axis in test.axes if axis.of_bench])
    return count_points(test.axes) * test.entry.repeat * TRIAL + benches * BENCH


def of_task(task: Task) -> int:
    """Bytes of a trial with `task`."""
    signals = (task.command, task.base_acceleration, task.disturbance)
    return TRIAL + KNOT * sum(map(_knots, signals))


def _knots(signal: Signal) -> int:
    match signal:
        case Polyline(times=times):
            return len(times)
        case MultiSine(amplitudes=amplitudes):
            return len(amplitudes)
    return 0


def refusal(test: Test, bytes_needed: int) -> str:
    """Message for a test whose plan would need too much memory."""
    points = count_points(test.axes)
    repeated = f", {test.entry.repeat} times" if test.entry.repeat > 1 else ""
    whole = f"{points} point{'s' if points != 1 else ''} of its matrix{repeated}"
    return (
        f"test '{test.entry.name}' ({whole}) needs about {_amount(bytes_needed)} of memory; a plan "
        f"may take {_amount(MOST)}, about {MOST // TRIAL} trials: sweep less, or lower 'repeat'"
    )


def _amount(count: int) -> str:
    return f"{count / 1e9:.3g} GB" if count < 10**15 else f"10^{len(str(count // 10**9)) - 1} GB"
