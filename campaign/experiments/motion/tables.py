"""Tables and findings of recorded motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.experiments.motion.account import Motion
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Table

OF_ONE_RECORDING = Cause("describes one recording", "it describes one recording")
MEAN_OF_STRETCH = Cause("mean of a stretch", "mean of the stretch")

_SUMMARY = (
    Column("duration", "Duration", "s", "s", reason=OF_ONE_RECORDING()),
    Column("travel", "Travel", "rad", "deg", reason=OF_ONE_RECORDING()),
    Column("top_rate", "Largest rate", "rad/s", "deg/s", reason=OF_ONE_RECORDING()),
    Column("rms_torque", "Torque (RMS)", "N m", "N m", reason=OF_ONE_RECORDING()),
    Column("peak_torque", "Largest torque", "N m", "N m", reason=OF_ONE_RECORDING()),
    Column("rms_error", "Tracking error (RMS)", "rad", "mrad", reason=OF_ONE_RECORDING()),
    Column("peak_error", "Largest tracking error", "rad", "mrad", reason=OF_ONE_RECORDING()),
    Column("stretches", "Steady stretches", exact=True),
)


def summary_table(motions: Sequence[Motion]) -> Table:
    """What each recording is."""
    columns = [c for c in _SUMMARY if any(c.name in motion.found for motion in motions)]
    rows: list[dict[str, Cell]] = []
    for motion in motions:
        row: dict[str, Cell] = {"recording": motion.data.trial.number, **motion.place}
        for column in columns:
            known = motion.found.get(column.name)
            exact = column.name == "stretches" and known is not None
            row[column.name] = int(known.value) if exact and known is not None else known
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
            "coulomb": line.reported["coulomb_torque"],
            "viscous": line.reported["viscous_friction"],
            "stretches": line.stretches,
        }
        for motion in motions
        for direction, line in motion.lines.items()
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
        note="A straight line through the steady stretches of a direction; intervals are of their "
        "scatter. Between and beyond the speeds there are, friction may be another.",
    )


def friction_table(motion: Motion, suffix: str) -> Table:
    """Each steady stretch."""
    loaded = any(each.load is not None for each in motion.stretches)
    rows: list[dict[str, Cell]] = []
    for number, each in enumerate(motion.stretches, start=1):
        row: dict[str, Cell] = {
            "stretch": number,
            "first": each.first,
            "last": each.last,
            "rate": each.rate,
            "torque": each.torque,
        }
        if each.load is not None:
            row |= {"load": each.load, "coefficient": each.coefficient}
        rows.append(row)
    more = (
        Column("load", "Normal load", "N", "N", reason=MEAN_OF_STRETCH()),
        Column("coefficient", "Friction coefficient"),
    )
    return Table(
        f"steady-stretches{suffix}",
        f"Steady stretches of {motion.data.trial.label}",
        (
            Column("stretch", "Stretch", exact=True),
            Column("first", "From", "s", "s", exact=True),
            Column("last", "To", "s", "s", exact=True),
            Column("rate", "Rate", "rad/s", "deg/s"),
            Column("torque", "Friction torque", "N m", "N m"),
            *(more if loaded else ()),
        ),
        tuple(rows),
    )


def line_findings(motion: Motion) -> Iterator[Finding]:
    """Coulomb and viscous friction of each direction, under the recording's conditions."""
    for direction, line in motion.lines.items():
        told = {**motion.place, "direction": direction, "recording": motion.data.trial.number}
        yield from (Finding.of(each, told) for each in line.reported.values())
    told = {**motion.place, "recording": motion.data.trial.number}
    for direction, level in motion.levels.items():
        yield Finding.of(level, {**told, "direction": direction})
    for estimate in (motion.constant, motion.coefficient):
        if estimate is not None:
            yield Finding.of(estimate, told)


def _places(motions: Sequence[Motion]) -> Iterator[Column]:
    """What was set differently for the recordings, or is known of them."""
    for name in dict.fromkeys(name for motion in motions for name in motion.place):
        yield Column(name, name.replace("_", " ").capitalize(), exact=True)
