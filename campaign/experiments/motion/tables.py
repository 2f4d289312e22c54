"""Tables and findings of recorded motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.experiments.friction_map.curves import FEWEST_SPEEDS
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.tables import curve_findings
from campaign.experiments.motion.account import Motion
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Table

OF_ONE_RECORDING = Cause("describes one recording", "it describes one recording")

_SUMMARY = (
    Column("duration", "Duration", "s", "s", reason=OF_ONE_RECORDING()),
    Column("travel", "Travel", "rad", "deg", reason=OF_ONE_RECORDING()),
    Column("top_rate", "Largest rate", "rad/s", "deg/s", reason=OF_ONE_RECORDING()),
    Column("rms_torque", "Torque (RMS)", "N m", "N m", reason=OF_ONE_RECORDING()),
    Column("peak_torque", "Largest torque", "N m", "N m", reason=OF_ONE_RECORDING()),
    Column("rms_error", "Tracking error (RMS)", "rad", "mrad", reason=OF_ONE_RECORDING()),
    Column("peak_error", "Largest tracking error", "rad", "mrad", reason=OF_ONE_RECORDING()),
)


def summary_table(motions: Sequence[Motion]) -> Table:
    """What each recording is."""
    columns = [c for c in _SUMMARY if any(c.name in motion.found for motion in motions)]
    rows: list[dict[str, Cell]] = []
    for motion in motions:
        row: dict[str, Cell] = {"recording": motion.data.trial.number, **motion.place}
        row |= {column.name: motion.found.get(column.name) for column in columns}
        row["stretches"] = len(motion.sliding.points)
        row["coefficient"] = motion.coefficient
        rows.append(row)
    loaded = any(motion.coefficient is not None for motion in motions)
    return Table(
        "recordings",
        "Recorded motions",
        (
            Column("recording", "Trial", exact=True),
            *_places(motions),
            *columns,
            Column("stretches", "Steady stretches", exact=True),
            *((Column("coefficient", "Friction coefficient"),) if loaded else ()),
        ),
        tuple(rows),
    )


def line_table(motions: Sequence[Motion]) -> Table:
    """Coulomb and viscous friction of each direction."""
    rows = [
        {
            "recording": motion.data.trial.number,
            **motion.place,
            "direction": direction,
            "coulomb": coulomb,
            "viscous": motion.sliding.found[direction]["viscous_friction"],
            "stretches": sum(
                point.sign == DIRECTIONS[direction] for point in motion.sliding.points
            ),
        }
        for motion in motions
        for direction, coulomb in motion.coulomb.items()
    ]
    return Table(
        "friction-lines",
        "Coulomb and viscous friction by direction",
        (
            Column("recording", "Trial", exact=True),
            *_places(motions),
            Column("direction", "Direction"),
            Column("coulomb", "Coulomb friction", "N m", "N m"),
            Column("viscous", "Viscous friction", "N m s/rad", "N m s/rad"),
            Column("stretches", "Stretches", exact=True),
        ),
        tuple(rows),
        note="Of a straight line through the steady stretches of a direction, or of a Stribeck "
        f"curve where there are {FEWEST_SPEEDS} speeds or more; intervals are of their scatter. "
        "Between and beyond the speeds there are, friction may be another.",
    )


def motion_findings(motion: Motion) -> Iterator[Finding]:
    """Friction of each direction, under the recording's conditions."""
    place = {**motion.place, "recording": motion.data.trial.number}
    yield from curve_findings(motion.sliding.found, place)
    for estimate in (motion.constant, motion.coefficient):
        if estimate is not None:
            yield Finding.of(estimate, place)


def _places(motions: Sequence[Motion]) -> Iterator[Column]:
    """What was set differently for the recordings, or is known of them."""
    for name in dict.fromkeys(name for motion in motions for name in motion.place):
        yield Column(name, name.replace("_", " ").capitalize(), exact=True)
