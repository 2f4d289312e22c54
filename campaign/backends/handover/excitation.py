"""Excitation of a trial as series: command and hull motion over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from campaign.axis_kind import sides_in
from campaign.channels import COMMAND, VOCABULARY, axis_of, info
from campaign.importing.derived_channels import RigFacts
from campaign.physics.base_motion import base_rate
from campaign.physics.bench import Bench
from campaign.recording import Array
from campaign.trial import Trial
from campaign.units import convert


@dataclass(frozen=True)
class Series:
    """One column of an excitation: `name` in `unit` (SI), `values` of shape (n,)."""

    name: str
    unit: str
    values: Array

    @property
    def heading(self) -> str:
        """Heading in the CSV file."""
        return f"{self.name} ({self.unit})"


def shown(trial: Trial, channel: str, value: float) -> str:
    """Text of a channel's value (SI) in its display unit."""
    if channel not in VOCABULARY:
        return f"{value:.6g}"
    axis = axis_of(channel, sides_in(trial.bench))
    what = info(channel, trial.task.mode, axis=axis)
    number = f"{convert(value, what.unit, what.display_unit) if what.unit else value:.6g}"
    return f"{number} {what.display_unit}".rstrip()


def facts_of(trial: Trial) -> RigFacts:
    """Facts of the trial's bench to derive channels; empty without a valid bench."""
    try:
        return RigFacts.of(Bench.model_validate(trial.bench, context={"si": True}))
    except ValidationError:
        return RigFacts()


def excitation(trial: Trial) -> Sequence[Series]:
    """Time, command and, for a moving hull, its acceleration and rate."""
    task, axis = trial.task, sides_in(trial.bench).load
    time = np.arange(task.samples) / task.sample_rate
    unit = info(COMMAND, task.mode, axis=axis).unit
    series = [Series("time", "s", time), Series(COMMAND, unit, task.command.sample(time))]
    if task.base_acceleration.shape != "zero":
        rate = info("base_rate", axis=axis).unit
        moved = task.base_acceleration
        series.append(Series("base_acceleration", f"{rate}^2", moved.sample(time)))
        series.append(Series("base_rate", rate, base_rate(moved, time)))
    return series


def write_csv(series: Sequence[Series], path: Path) -> None:
    """Write a line per sample with all digits of a float, units in the heading."""
    rows = zip(*(each.values.tolist() for each in series), strict=True)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(each.heading for each in series) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def write_mat(series: Sequence[Series], trial: Trial, attempt: int, path: Path) -> None:
    """Write MAT version 5, numbers only: a column per series, and numbers of the trial."""
    from scipy.io import savemat

    task = trial.task
    numbers = {
        "trial": trial.number,
        "attempt": attempt,
        "sample_rate": task.sample_rate,
        "duration": task.duration,
        "start_angle": task.start_angle,
    }
    variables = {name: float(number) for name, number in numbers.items()}
    columns = {each.name: each.values for each in series}
    savemat(path, {**variables, **columns}, do_compression=True, oned_as="column")
