"""A test with several draws of a random bench, analyzed draw by draw.

Every experiment can be swept over draws without code of its own: each draw is analysed alone, and
this module combines the results.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from campaign.published.draws import SEED, by_draw, together
from campaign.result import Cell, Column, Finding, Result, Table, Value
from campaign.trial import Trial

NOTES = 12
"""Most notes of draws other than the first."""


def draws_of(trials: Iterable[Trial]) -> tuple[Value, ...]:
    """Seeds that a test sweeps, in plan order; empty without a swept seed."""
    seeds = (trial.point[SEED] for trial in trials if SEED in trial.point)
    return tuple(dict.fromkeys(seed for seed in seeds if isinstance(seed, int)))


def merged(results: Mapping[Value, Result]) -> Result:
    """Combine results by seed: findings, notes and doubts of all, tables and figures of one.

    A further table shows the distribution of each quantity that several draws have.
    """
    seed = next((own for own, result in results.items() if result.tables), next(iter(results)))
    first = results[seed]
    others = [result for own, result in results.items() if own != seed]
    findings = tuple(
        replace(finding, conditions={**finding.conditions, SEED: own})
        for own, result in results.items()
        for finding in result.findings
    )
    summary = f"{len(results)} draws of the bench's scatter; tables and figures are of seed {seed}."
    more = dict.fromkeys(note for result in others for note in result.notes)
    notes = [note for note in more if note not in first.notes]
    if len(notes) > NOTES:
        notes = [*notes[:NOTES], f"{len(notes) - NOTES} more notes are of other draws."]
    table = _table(findings, tuple(results))
    return Result(
        (table, *first.tables) if table.rows else first.tables,
        first.figures,
        findings,
        (summary, *first.notes, *notes),
        telling=first.telling,
        doubts=tuple(doubt for result in results.values() for doubt in result.doubts),
    )


def _table(found: Iterable[Finding], seeds: tuple[Value, ...]) -> Table:
    return Table(
        key="draws",
        title="Results of the draws",
        columns=(
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("draws", "Draws", exact=True),
            Column("spread", "Median, interval of one further draw"),
        ),
        rows=tuple(_rows(found, seeds)),
        note=f"Each draw is the bench with another seed of its scatter ({SEED}). The interval "
        "is that of one further draw, such as the one in a document; that of the mean is narrower.",
    )


def _rows(found: Iterable[Finding], seeds: tuple[Value, ...]) -> Iterator[Mapping[str, Cell]]:
    for group in by_draw(found):
        if len(group) < 2:
            continue
        combined = together(group, seeds)
        yield {
            "quantity": combined.quantity.replace("_", " "),
            "conditions": _words(combined.conditions),
            "unit": combined.unit,
            "draws": len(group),
            "spread": combined.known,
        }


def _words(conditions: Mapping[str, Value]) -> str:
    shown = (
        f"{name.replace('_', ' ')} {f'{value:.6g}' if isinstance(value, float) else value}"
        for name, value in conditions.items()
        if value is not None
    )
    return ", ".join(shown)
