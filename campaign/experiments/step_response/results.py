"""Table and figure of step responses: rise, settling, overshoot, remaining error."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from campaign.estimate import Estimate
from campaign.result import Array, Axis, Cell, Column, Curve, Figure, Mark, Panel, Table, Value

SHOWN = 2.5
"""The figure shows the step up to this many settling times."""


@dataclass(frozen=True)
class Step:
    """One step and what it says: time from the step, rate and command, shape (n,), SI.

    The command is None where it was not recorded; `level` is the rate (rad/s) before the step, and
    `options` are those of the test.
    """

    place: dict[str, Value]
    label: str
    series: str
    time: Array
    rate: Array
    command: Array | None
    level: float
    options: Any
    rise_from: float
    found: Mapping[str, Estimate]

    def value(self, name: str) -> float:
        """A characteristic by name; NaN where it was not seen."""
        return self.found[name].value if name in self.found else math.nan


def step_table(steps: Sequence[Step], extra: Sequence[str]) -> Table:
    """A row for each step; `extra`: swept paths with a column of their own."""
    rows: list[Mapping[str, Cell]] = []
    for step in steps:
        loop = "without friction" if step.options.linear else "with friction"
        rows.append({**step.place, "loop": loop, **step.found})
    band = 100 * steps[0].options.band
    return Table(
        key="step-response",
        title="Step response of the rate loop",
        columns=(
            Column("loop", "Loop"),
            Column("compensation", "Compensation"),
            *(Column(path, path, exact=True) for path in extra),
            Column("rise_time", "Rise time (10 to 90 %)", "s", "ms"),
            Column("settling_time", f"Settling time ({band:g} %)", "s", "ms"),
            Column("overshoot", "Overshoot", "", "percent"),
            Column("steady_state_error", "Steady-state error", "rad/s", "deg/s"),
        ),
        rows=tuple(rows),
        note="Times count from the start of the step. Each row is one step: the interval of its "
        "rise time is what its own noise leaves open. What repeats of it say together, with "
        "intervals, is among the findings.",
    )


def step_figure(steps: Sequence[Step]) -> Figure:
    """The steps over time, with what the first of them shows marked."""
    first = steps[0]
    times = [step.value("settling_time") for step in steps]
    settled = [time for time in times if math.isfinite(time)]
    end = min(SHOWN * max(settled), first.options.duration) if settled else first.options.duration
    height, level = first.options.step, first.level
    ends = sorted(level + height * (1 + sign * first.options.band) for sign in (-1, 1))
    curves = []
    if first.command is not None:
        curves.append(Curve(first.time, first.command, "command", "reference", "thin"))
    curves += [Curve(step.time, step.rate, step.label, step.series) for step in steps]
    band = 100 * first.options.band
    marks = [
        Mark(f"±{band:g} %", y=ends[0], until=ends[1]),
        *_marks(first),
    ]
    marked = f" Marked are numbers of: {first.label}." if len(steps) > 1 and marks[1:] else ""
    return Figure(
        key="step",
        title="Step response of the rate loop",
        caption="The rate rises to its command; it has settled once it stays within the shaded "
        f"band of ±{band:g} % of the step around it.{marked}",
        alt="Rate of the load over time after a step of the rate command, with the band in which "
        "it counts as settled; rise, overshoot and settling are marked where they are seen.",
        panels=(
            Panel(
                Axis("Time from the step", "s", "ms", limits=(-0.05 * end, end)),
                Axis("Rate", "rad/s", "deg/s"),
                curves,
                marks=tuple(marks),
            ),
        ),
        thesis=("4.7",),
    )


def _marks(step: Step) -> Iterator[Mark]:
    """Rise, overshoot and settling of one step, where they were seen."""
    rise, settled, over = (step.value(name) for name in ("rise_time", "settling_time", "overshoot"))
    if math.isfinite(rise + step.rise_from):
        start = step.rise_from
        yield Mark(f"rise {_time(rise)}", x=start, until=start + rise, series=step.series)
    if over > 0:
        # Only after the step: noise before it may lie as far out.
        share = np.where(step.time >= 0, step.rate / step.options.step, np.nan)
        peak = int(np.nanargmax(share))
        label = f"overshoot {100 * over:.3g} %"
        x, y = float(step.time[peak]), float(step.rate[peak])
        yield Mark(label, x=x, y=y, point=True, series=step.series)
    if math.isfinite(settled):
        yield Mark(f"settled {_time(settled)}", x=settled, series=step.series)


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"
