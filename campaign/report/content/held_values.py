"""True, stated and identified values of compensations.

`campaign identify` adds a twin to a compensation, with the identified values. Both model the total
friction. A true value is therefore a sum over the interfaces, or the number of one interface; the
table states which. If the bench was made from a document, published values and the remarks on them
stand beside both.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from campaign.api.analysis import AnalysedTest
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import axis_terms, axis_unit
from campaign.estimate import Estimate
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import why_altered
from campaign.physics.bench_knowledge import NORMAL_95
from campaign.physics.compensation.identified import identified_name
from campaign.physics.true_values import true_of, true_value
from campaign.published.values import Cell as PublishedCell
from campaign.published.values import Published, heading_of
from campaign.report.content.lines import cell_name
from campaign.report.content.published_columns import cell_of
from campaign.report.content.truth import COUNTED, SIMULATED, Benches, held, inside
from campaign.result import Cell, Column, Table, Value
from campaign.text import quantity_words

Row = Mapping[str, Cell]
AT_REST, STRONGEST, DAMPING = "stiffness_at_rest", "bristle_stiffness", "bristle_damping"
INERTIA = "inertia"
BRISTLES = {AT_REST: "N m/rad", STRONGEST: "N m/rad", DAMPING: "N m s/rad"}
CURVE = {
    "coulomb_torque": "N m",
    "static_torque": "N m",
    "stribeck_velocity": "rad/s",
    "stribeck_exponent": "",
    "viscous_friction": "N m s/rad",
}
UNITS = {**BRISTLES, INERTIA: "kg m^2", **CURVE}
"""SI units of a rotary axis, in row order: first quantities that a sliding curve does not show."""
OF_ONE = (STRONGEST, "stribeck_velocity", "stribeck_exponent")
"""Quantities of one interface; for all others a compensation has the sum."""
DIRECTIONS = ("positive", "negative")
SAME = 1e-4
"""Relative tolerance between a sum of parts and the same number written as a whole."""
LEVEL = 0.95


@dataclass(frozen=True)
class HeldValue:
    """A number of a compensation, stated and identified by its twin (SI)."""

    compensation: str
    quantity: str
    conditions: Mapping[str, str]
    stated: float | None
    found: Estimate


def held_tables(
    run: RunReader, tests: Iterable[AnalysedTest], published: Published
) -> dict[str, Table]:
    """Table of compensation values, by test; of equal tables only the first is kept.

    Applies to runs on `sim` and compensations with a twin.
    """
    if run.header.backend != SIMULATED:
        return {}
    benches = Benches(run.header.truth.plants)
    shown: list[tuple[HeldValue, ...]] = []
    tables = {}
    for test in tests:
        tried = {each.trial.task.compensation for each in test.trials}
        numbers = () if test.bench is None else held_by(test.bench, tried)
        if not numbers or numbers in shown:
            continue
        shown.append(numbers)
        with axis_terms(test.sides):
            table = _table(numbers, test, benches, published)
        if table is not None:
            tables[test.name] = table
    return tables


def held_by(bench: Bench, tried: Container[str]) -> tuple[HeldValue, ...]:
    """Identified values of the executed compensations; equal values of several are merged.

    The merged value has the narrowest interval: a sum of parts is less certain than the total.
    """
    values: list[HeldValue] = []
    for name in bench.compensation:
        for each in _of_twin(bench, name) if identified_name(name) in tried else ():
            place = next((n for n, other in enumerate(values) if _alike(each, other)), None)
            if place is None:
                values.append(each)
                continue
            narrow = min(values[place], each, key=lambda held: held.found.half_width)
            both = f"{values[place].compensation}, {name}"
            values[place] = replace(narrow, compensation=both)
    order = list(UNITS)
    return tuple(sorted(values, key=lambda each: order.index(each.quantity)))  # stable


def _alike(one: HeldValue, other: HeldValue) -> bool:
    return one.stated == other.stated and _identified_alike(one, other)


def _identified_alike(one: HeldValue, other: HeldValue) -> bool:
    return (one.quantity, one.conditions) == (other.quantity, other.conditions) and math.isclose(
        one.found.value, other.found.value, rel_tol=SAME
    )


def _of_twin(bench: Bench, name: str) -> Iterator[HeldValue]:
    twin = identified_name(name)
    if twin not in bench.compensation or why_altered(bench, twin):
        return
    stated, identified = _as_bench(bench, name), _as_bench(bench, twin)
    if stated is None or identified is None:
        return
    if bench.compensation[twin].method == "observer":
        asked: list[tuple[str, dict[str, str]]] = [(INERTIA, {})]
    else:
        several = len(identified.friction) > 1
        asked = [(each, {}) for each in BRISTLES if several or each != STRONGEST]
        asked += [(each, {"direction": way}) for each in CURVE for way in DIRECTIONS]
    for quantity, conditions in asked:
        value = _number(identified, quantity, conditions)
        sigma = _uncertainty(bench, identified, twin, quantity, conditions)
        if value is None or sigma is None:
            continue
        half = NORMAL_95 * sigma
        estimate = Estimate(quantity, value, UNITS[quantity], value - half, value + half, LEVEL)
        yield HeldValue(name, quantity, conditions, _number(stated, quantity, conditions), estimate)


def _as_bench(bench: Bench, name: str) -> Bench | None:
    """Bench with the parameters of a compensation; None if these are not friction at the load."""
    options = bench.compensation[name]
    if options.method == "observer":
        inertia = bench.axis.inertia if options.inertia is None else options.inertia
        return bench.model_copy(update={"axis": bench.axis.model_copy(update={"inertia": inertia})})
    if options.method != "friction-model":
        return None
    if any(bench.at_load(each) != (1.0, 1.0) for each in options.friction.values()):
        return None
    return bench.model_copy(update={"friction": options.friction})


def _number(bench: Bench, quantity: str, conditions: Mapping[str, str]) -> float | None:
    """True value of a bench; for bristle damping, the sum of the bristles' own damping."""
    if quantity != DAMPING:
        return true_value(bench, quantity, conditions)
    dampings = []
    for options in bench.friction.values():
        own = getattr(options, DAMPING, None)
        if own is None:
            return None
        torque, rate = bench.at_load(options)
        dampings.append(torque * rate * own)
    return math.fsum(dampings) if dampings else None


def _uncertainty(
    bench: Bench, identified: Bench, twin: str, quantity: str, conditions: Mapping[str, str]
) -> float | None:
    """1 sigma of a twin's number with independent parts; None if that of a part is unknown."""
    if quantity == INERTIA:
        return bench.known_uncertainty(f"compensation.{twin}.inertia")
    key = STRONGEST if quantity == AT_REST else quantity
    way = "negative." if conditions.get("direction") == "negative" else ""
    names = list(identified.friction)
    if quantity in OF_ONE:
        names = [max(names, key=lambda each: identified.friction[each].static_torque)]
    parts = []
    for name in names:
        sigma = bench.known_uncertainty(f"compensation.{twin}.friction.{name}.{way}{key}")
        if sigma is not None:
            parts.append(sigma)
        elif getattr(identified.friction[name], key, None):  # a zero needs no uncertainty
            return None
    return math.hypot(*parts) if parts else None


def _table(
    numbers: Sequence[HeldValue],
    test: AnalysedTest,
    benches: Benches,
    published: Published,
) -> Table | None:
    simulated = {id(each): each for t in test.trials if (each := benches.of(t.trial))}
    printed = published if test.bench and test.bench.known.document else {}
    known = test.evidence().known
    cells = [_printed(each, printed, known) for each in numbers]
    rows = [
        {
            **_row(each, cell, list(simulated.values())),
            COUNTED: not any(_identified_alike(each, other) for other in numbers[:place]),
        }
        for place, (each, cell) in enumerate(zip(numbers, cells, strict=True))
    ]
    if not any(row["true"] is not None for row in rows):
        return None
    shown = [cell for cell in cells if cell is not None]
    columns = [
        Column("quantity", "Quantity"),
        Column("direction", "Direction"),
        Column("compensation", "Held by"),
        Column("unit", "Unit"),
        Column("published", "Printed", exact=True),
        Column("printed_in", "Printed in"),
        Column("held", "As stated", exact=True),
        Column("found", "As identified"),
        Column("true", "True", exact=True),
        Column("of", "Applies to"),
        Column("inside", "True value in the interval"),
    ]
    note = f"{held(rows)} (last column). " if held(rows) else ""
    note += "The parts of a sum count as independent. "
    if shown:
        note += (
            f"What the document, or a remark on it, says of its numbers: {' '.join(_how(shown))}"
        )
    return Table(
        key="truth",
        title="What compensations hold: published, stated, identified and true",
        columns=tuple(c for c in columns if shown or c.name not in ("published", "printed_in")),
        rows=tuple(rows),
        note=note.rstrip(),
    )


def _row(number: HeldValue, cell: PublishedCell | None, simulated: Sequence[Bench]) -> Row:
    """Row of a number; no true value if the simulated benches have none, or several."""
    true = {_number(bench, number.quantity, number.conditions) for bench in simulated}
    value = true.pop() if len(true) == 1 else None
    unit = axis_unit(UNITS[number.quantity])
    # The bristles' own damping applies to the same interfaces as their stiffness at rest.
    like = AT_REST if number.quantity == DAMPING else number.quantity
    return {
        "quantity": quantity_words(number.quantity),
        "direction": number.conditions.get("direction", ""),
        "compensation": number.compensation,
        "unit": unit,
        "published": None if cell is None else cell.in_unit(unit),
        "printed_in": "" if cell is None else heading_of(cell.table),
        "held": number.stated,
        "found": replace(number.found, unit=unit),
        "true": value,
        "of": "" if value is None else true_of(simulated[0], like),
        "inside": inside(number.found, value),
    }


def _printed(
    number: HeldValue, published: Published, known: Mapping[str, Value]
) -> PublishedCell | None:
    """Published cell of a number; for the stiffness at rest, that of the bristle stiffness."""
    quantity = STRONGEST if number.quantity == AT_REST else number.quantity
    conditions = {**number.conditions, "statistic": "mean"}
    return cell_of(quantity, conditions, published.values(), known)


def _how(cells: Sequence[PublishedCell]) -> Iterator[str]:
    """Sentences with the reasons and remarks on published cells, grouped by table."""
    remarks: dict[tuple[str, str], dict[str, None]] = {}
    for cell in cells:
        for reason in filter(None, (cell.reason, *cell.notes)):
            remarks.setdefault((heading_of(cell.table), reason), {})[cell_name(cell)] = None
    for (heading, reason), names in remarks.items():
        yield f"{heading}, {', '.join(names)}: {reason}."
