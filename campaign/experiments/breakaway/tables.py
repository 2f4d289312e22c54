"""Tables and findings of a breakaway test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from campaign.estimate import Estimate
from campaign.experiments.breakaway.means import QUANTITIES, Ramps, mean
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Table, Value

CHORD = Cause(
    "chord through a curve", "a chord through a curve: too low by far more than any scatter"
)
EXTREME = Cause(
    "extreme of the ramps",
    "the extreme of the ramps; each has its own interval in the table above",
)
SHARE = "bristle_stiffness_to_"
"""Prefix of the metric of a window, before its share of the breakaway torque."""


def findings_of(ramps: Ramps, means: Mapping[str, Mapping[str, Estimate]]) -> Iterator[Finding]:
    """Findings for each quantity of each ramp, then the means by direction.

    The nominal value is the mean of both directions.
    """
    for place, own in zip(ramps.places, ramps.found, strict=True):
        for quantity in QUANTITIES:
            if quantity in own:
                yield _finding(own[quantity], place)
    shared = {k: v for k, v in ramps.places[0].items() if k not in ("measurement", "position")}
    for direction, estimates in means.items():
        for estimate in estimates.values():
            yield _finding(estimate, {**shared, "direction": direction, "statistic": "mean"})


def _finding(estimate: Estimate, place: Mapping[str, Value]) -> Finding:
    # sigma1 is computed from sigma0 and assumed numbers: no ramp measures it.
    return Finding.of(estimate, place, recomputed=estimate.name == "bristle_damping")


def chord_of(value: float) -> Estimate:
    """A chord through the presliding curve (N m/rad), without interval."""
    return Estimate.without_interval("chord", value, "N m/rad", CHORD())


def table_of(ramps: Ramps, means: Mapping[str, Mapping[str, Estimate]]) -> Table:
    """Table 4.5: one row for each ramp, then the means."""
    rows: list[dict[str, Cell]] = [
        {
            "measurement": place.get("measurement"),
            "position": place.get("position"),
            "direction": place["direction"],
            **{name: own.get(name) for name in (*QUANTITIES, "chord")},
            "interfaces": int(own["interfaces"].value) if "interfaces" in own else None,
        }
        for place, own in zip(ramps.places, ramps.found, strict=True)
    ]
    for direction, estimates in means.items():
        chords = [each.value for each in ramps.values("chord", direction)]
        rows.append(
            {
                "measurement": "mean",
                "direction": direction,
                **estimates,
                "chord": chord_of(float(np.mean(chords))) if chords else None,
            }
        )
    return Table(
        key="presliding",
        title="Breakaway torque and presliding parameters by position",
        columns=(
            Column("measurement", "Measurement", exact=True),
            Column("position", "Position", "rad", "deg", exact=True),
            Column("breakaway_torque", "Breakaway torque", "N m", "N m"),
            Column("bristle_stiffness", "σ0 (after the first slip)", "N m/rad", "N m/rad"),
            Column("stiffness_at_rest", "Stiffness at rest", "N m/rad", "N m/rad"),
            Column("chord", "Straight chord", "N m/rad", "N m/rad"),
            Column("bristle_damping", "σ1 (assumed)", "N m s/rad", "N m s/rad"),
            Column("interfaces", "Interfaces seen", exact=True),
            Column("direction", "Direction"),
        ),
        rows=tuple(rows),
        thesis=("4.5",),
        note="σ0 is the stiffness of the interface that carries the largest torque; stiffness at "
        "rest is the slope before anything slips, the sum over all interfaces. σ1 is not "
        "measured: it follows from an assumed damping ratio (Equation 4.12).",
    )


def window_table(ramps: Ramps) -> Iterator[Table]:
    """Dependence of sigma0 on the end of the fitted window; no table if no ramp has a curve."""
    names = dict.fromkeys(name for own in ramps.found for name in own if name.startswith(SHARE))
    shares = {float(name.removeprefix(SHARE)): name for name in names}
    rows: list[dict[str, Cell]] = []
    for share in sorted(shares):
        stiffness = ramps.values(shares[share])
        values = np.array([each.value for each in stiffness])
        rows.append(
            {
                "share": share,
                "mean": mean("bristle_stiffness", stiffness),
                "lowest": float(values.min()),
                "highest": float(values.max()),
            }
        )
    if not rows:
        return
    yield Table(
        key="window",
        title="Effect of the fitted window on σ0",
        columns=(
            Column("share", "Fitted up to (share of breakaway)", exact=True),
            Column("mean", "σ0, mean", "N m/rad", "N m/rad"),
            Column("lowest", "Lowest", "N m/rad", "N m/rad", reason=EXTREME()),
            Column("highest", "Highest", "N m/rad", "N m/rad", reason=EXTREME()),
        ),
        rows=tuple(rows),
        note="These intervals include the scatter between ramps alone, to compare windows. The "
        "interval of σ0 in the table above also includes what shifts all ramps equally: torque "
        "constant, ramp rate, dwell.",
    )
