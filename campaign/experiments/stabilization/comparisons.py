"""Comparisons of stabilization errors: methods, preloads, identified compensations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from campaign.estimate import Estimate
from campaign.estimation.stabilization_error import decrease, quotient
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.stabilization.errors import COMPENSATION, FOUND, QUANTITY
from campaign.physics.compensation.identified import stated_name
from campaign.result import Cell, Column, Finding, Table, Value

Row = Mapping[str, Cell]
RATIO = "ratio"
PRELOAD_PATH = "bench.gear.preload.torque"
"""Swept path of the preload, which the column `average_friction` shows already."""
_BEHIND = {COMPENSATION: (), "average_friction": (PRELOAD_PATH,)}


def preload_of(data: TrialData) -> dict[str, Value]:
    """The condition `average_friction` (N m), where the bench has an adjustable preload."""
    gear = bench_of(data.trial).gear
    if gear is None or gear.preload is None:
        return {}
    return {"average_friction": gear.preload.torque}


def compared(errors: Sequence[Finding]) -> Iterator[Finding]:
    """Findings from pairs of errors that differ in one condition only.

    error_reduction: error without compensation over error with it.
    error_decrease: share by which a method's error is below that of the method `against`.
    error_growth: error at a raised preload over that at the lowest, same method.
    """
    for one in errors:
        for other in errors:
            if one is other or not one.value > 0 or not other.value > 0:
                continue
            if _only_differ_in("compensation", one, other):
                against = other.conditions["compensation"]
                if against == "none":
                    reduction = quotient("error_reduction", other.known, one.known)
                    yield Finding.of(reduction, one.conditions)
                less = decrease("error_decrease", one.known, other.known)
                yield Finding.of(less, {**one.conditions, "against": against})
            elif _only_differ_in("average_friction", one, other) and _lowest(other, errors):
                growth = quotient("error_growth", one.known, other.known)
                yield Finding.of(growth, one.conditions)


def _only_differ_in(name: str, one: Finding, other: Finding) -> bool:
    """Whether all conditions but `name` (and the swept path behind it) are equal."""

    def rest(finding: Finding) -> dict[str, Value]:
        return {k: v for k, v in finding.conditions.items() if k not in (name, *_BEHIND[name])}

    return one.conditions.get(name) != other.conditions.get(name) and rest(one) == rest(other)


def _lowest(finding: Finding, errors: Sequence[Finding]) -> bool:
    here = finding.conditions["average_friction"]
    preloads = [e.conditions.get("average_friction") for e in errors]
    return here == min(v for v in preloads if isinstance(v, int | float))


def beside_rows(rows: Sequence[Row]) -> Iterator[Row]:
    """One row for each identified compensation whose stated one has an error there, too."""
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
    return {name: cell for name, cell in row.items() if name not in FOUND | {COMPENSATION}}


def beside_table(rows: Sequence[Row], extra: Sequence[str]) -> Table:
    """Table of `beside_rows`; extra: further swept paths, one column each."""
    columns = [Column("compensation", "Compensation")]
    if any("frequency" in row for row in rows):
        columns.append(Column("frequency", "Frequency", "Hz", "Hz", exact=True))
    if len({row.get("average_friction") for row in rows}) > 1:
        columns.append(Column("average_friction", "Preload", "N m", "N m", exact=True))
    columns += [Column(p, p, exact=True) for p in extra if p != PRELOAD_PATH]
    columns += [
        Column("stated", "Error (1σ), as stated", "rad", "mrad", quantity=QUANTITY),
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
