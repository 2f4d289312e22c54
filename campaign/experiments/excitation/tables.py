"""Tables of excitations: requested and reached."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from campaign.estimate import Estimate
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.common import OF_RECORDING
from campaign.physics.complete import limits_of
from campaign.result import Cell, Column, Table

Account = tuple[TrialData, Mapping[str, Estimate]]
USED = (("top_angle", "angle"), ("top_rate", "rate"), ("peak_torque", "torque"))
"""Metrics, and the limits that they are held against."""


def reached_tables(accounts: Sequence[Account]) -> Iterator[Table]:
    """What was asked beside what was reached, trial by trial; one table for each mode."""
    modes = dict.fromkeys(data.trial.task.mode for data, _ in accounts)
    for mode in modes:
        own = [each for each in accounts if each[0].trial.task.mode == mode]
        yield _reached(own, mode, f"-{mode}" if len(modes) > 1 else "")


def _reached(accounts: Sequence[Account], mode: str, suffix: str) -> Table:
    in_torque = mode == "torque"
    unit, display = ("N m", "N m") if in_torque else ("rad/s", "deg/s")
    asked = () if in_torque else (Column("asked_angle", "Angle asked", "rad", "deg", exact=True),)
    return Table(
        key=f"reached{suffix}",
        title="What was asked, and what was reached",
        columns=(
            Column("trial", "Trial"),
            Column("realisation", "Realisation", exact=True),
            Column("command_peak", "Largest command", unit, display, exact=True),
            Column("command_rms", "RMS", unit, display, exact=True),
            Column("crest_factor", "Crest factor", exact=True),
            *asked,
            Column("top_angle", "Angle reached", "rad", "deg", reason=OF_RECORDING()),
            Column("top_rate", "Rate reached", "rad/s", "deg/s", reason=OF_RECORDING()),
            Column("peak_torque", "Torque reached", "N m", "N m", reason=OF_RECORDING()),
            Column("used", "Of its limit", "", "percent", reason=OF_RECORDING()),
            Column("limit", "Nearest limit"),
        ),
        rows=tuple(_row(data, found) for data, found in accounts),
        note="Largest magnitudes; the crest factor is the largest command over its RMS. What came "
        "nearest to its limit is in the last two columns.",
    )


def _row(data: TrialData, found: Mapping[str, Estimate]) -> dict[str, Cell]:
    limits = limits_of(bench_of(data.trial))
    shares = {
        name: found[metric].value / getattr(limits, name)
        for metric, name in USED
        if metric in found and math.isfinite(found[metric].value)
    }
    nearest = max(shares, key=lambda name: shares[name], default=None)
    realisation = data.trial.point.get("realisation")
    return {
        "trial": data.trial.name,
        "realisation": realisation if isinstance(realisation, int) else None,
        **{name: found[name].value for name in ("command_peak", "command_rms", "crest_factor")},
        "asked_angle": found["asked_angle"].value if "asked_angle" in found else None,
        **{name: found.get(name) for name, _ in USED},
        "used": None if nearest is None else shares[nearest],
        "limit": nearest,
    }
