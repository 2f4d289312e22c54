"""Identified compensations beside their originals, at each swept value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from campaign.estimate import Estimate
from campaign.estimation.stabilization_error import quotient
from campaign.physics.compensation.identified import stated_name
from campaign.result import Cell, Column, Table

Row = Mapping[str, Cell]
RATIO = "ratio"
ERROR = "stabilization_error"
OWN = ("compensation", "error", "peak", "stuck", "repeats", "spread", "next")
"""What of a row of errors is not the place it is of."""
PRELOAD_PATH = "bench.gear.preload.torque"
"""Said already by the average friction."""


def beside_rows(rows: Sequence[Row]) -> tuple[Row, ...]:
    """One for each twin at each place where what it is the twin of was tried, too."""
    return tuple(_pairs(rows))


def _pairs(rows: Sequence[Row]) -> Iterator[Row]:
    for row in rows:
        stated = stated_name(str(row["compensation"]))
        other = next((o for o in rows if o["compensation"] == stated and _at(o) == _at(row)), None)
        error, before = row["error"], None if other is None else other["error"]
        if not isinstance(error, Estimate) or not isinstance(before, Estimate):
            continue
        if not error.is_determined or not before.is_determined:
            continue
        yield {
            "compensation": stated,
            **_at(row),
            "stated": before,
            "identified": error,
            RATIO: quotient(RATIO, error, before),
        }


def _at(row: Row) -> dict[str, Cell]:
    return {name: value for name, value in row.items() if name not in OWN}


def beside_table(rows: Sequence[Row], extra: Sequence[str]) -> Table:
    """Of `beside_rows`; extra: paths that the test sweeps besides those which have columns."""
    columns = [Column("compensation", "Compensation")]
    if any("frequency" in row for row in rows):
        columns.append(Column("frequency", "Frequency", "Hz", "Hz", exact=True))
    if len({row.get("average_friction") for row in rows}) > 1:
        columns.append(Column("average_friction", "Preload", "N m", "N m", exact=True))
    columns += [Column(p, p, exact=True) for p in extra if p != PRELOAD_PATH]
    columns += [
        Column("stated", "Error (1σ), as stated", "rad", "mrad", quantity=ERROR),
        Column("identified", "Error (1σ), as identified", "rad", "mrad"),
        Column(RATIO, "Identified over stated"),
    ]
    return Table(
        "identified-beside-stated",
        "Compensations with identified values beside those they replace",
        tuple(columns),
        tuple(rows),
        note="Both have the same gain. A ratio below 1: what was identified leaves less.",
    )
