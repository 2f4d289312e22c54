"""The identification as a folder: one self-contained page, its tables and figures, and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from campaign import __version__
from campaign.access.estimates import row_of
from campaign.access.plain_json import json_text
from campaign.access.sentences import remarks, sentence
from campaign.axis_kind import speaking_of, words_here
from campaign.estimate import Estimate
from campaign.identify.agreement import disagreements
from campaign.identify.identification import Identification, Section, widest
from campaign.identify.tables import changes_table, parameters_table
from campaign.parameter import Parameter
from campaign.report.drawing.drawn import Drawn
from campaign.report.drawing.figures import draw, series_of
from campaign.report.output import refuse_other, write_page
from campaign.report.page.folder import ShownFigure, ShownTable
from campaign.report.page.making import Making
from campaign.report.page.packaged import fill_packaged
from campaign.report.palette import Look, looks_of_page, variables
from campaign.result import Figure, Result
from campaign.text import words

CURES = {
    "window": "it depends on how far a ramp is fitted; record the angle more finely",
    "angle": "slide over all of a turn, at several speeds in both directions",
    "band": "half the band finds otherwise, so that either the model lacks something (look at what "
    "is left over) or the sensor's noise is in the motion (a finer one, or faster motion)",
    "what the model misses": "the model lacks something; look at what is left over",
    "friction, at this excitation": "excite with more torque, of which friction is less, "
    "and with a second amplitude, half of it",
    "slow": "record more motion at low speeds",
    "instruments": "reduce the noise of the measured motion, or accelerate more",
    "loop": "record the wanted motion as well (channel `reference`)",
    "delay": "record faster, with sharper reversals, or with a reference signal on both channels",
}
"""What makes a systematic part smaller, by its source."""
PAGE, DATA = "identification.html", "identification.json"


@dataclass(frozen=True)
class ShownSection:
    """One method on the page."""

    anchor: str
    section: Section
    warnings: tuple[str, ...]
    conclusions: tuple[str, ...]
    remarks: tuple[str, ...]
    figures: tuple[ShownFigure, ...]
    tables: tuple[ShownTable, ...]
    changes: ShownTable | None


@dataclass
class _Making(Making):
    looks: Mapping[str, Look] = field(default_factory=dict)
    """Of the series of all figures: the same series looks the same all over the page."""


def write_identification(
    found: Identification, output: Path, packaged_templates: Path, command: str, bench: str = ""
) -> Path:
    """Write the page, its data, tables and figures into the folder `output`; the page's path.

    bench: name of the bench file that was written; "" for none. The same archives give the same
    bytes. Raises UsageError when `output` is something else than an identification.
    """
    refuse_other(output, PAGE)
    making = _Making(looks=_looks(found))
    with speaking_of(found.bench.sides):
        parameters = parameters_table(found.sections)
        first = making.folder.shown_table(parameters, (), "parameters")  # as on the page
        shown = [
            _section(each, each.result, found, making)
            for each in found.sections
            if each.result is not None
        ]
        context = {
            "found": found,
            "parameters": first,
            "shown": shown,
            "refused": [each for each in found.sections if each.result is None],
            "next": next_measurement(found),
            "problems": making.problems,
            "command": command,
            "bench_file": bench,
            "version": __version__,
            "colours": variables(),
        }
        html = fill_packaged("identify.html", context, packaged_templates)
    files = {PAGE: html, DATA: as_json(found, command), **making.folder.files}
    return write_page(output, PAGE, files)


def next_measurement(found: Identification) -> str:
    """About what methods disagree, and what to measure next to halve the widest interval."""
    widest_one = widest(found.parameters)
    with speaking_of(found.bench.sides):
        advice = [] if widest_one is None else [_advice(widest_one)]
    return " ".join([*disagreements(found.sections), *advice])


def _advice(parameter: Parameter) -> str:
    estimate = parameter.estimate
    scatter = 0.0
    if estimate.low is not None and estimate.high is not None:
        scatter = 0.5 * (estimate.high - estimate.low)
    share = abs(estimate.half_width / estimate.value)
    begin = f"The widest interval is that of {words(estimate.name)}: ± {100 * share:.2g} % of it."
    parts = [part for part in estimate.systematic if part.standard_uncertainty]
    parts.sort(key=lambda part: -(part.standard_uncertainty or 0.0))
    if parts and 2.0 * estimate.systematic_uncertainty > scatter:
        source = words_here(parts[0].source)
        cure = CURES.get(parts[0].source, f"know the {source} better")
        return (
            f"{begin} Most of it is systematic ({source}), and no longer recording makes that "
            f"smaller: {cure}."
        )
    longer = "four times as much of the same motion halves it"
    return f"{begin} To halve it, {parameter.advice}; or {longer}." if parameter.advice else (
        f"{begin} It scatters: {longer}."
    )  # fmt: skip


def _section(
    section: Section, result: Result, found: Identification, making: _Making
) -> ShownSection:
    name = section.model.name
    folder = making.folder
    figures = [
        making.attempt(f"{name}: {figure.key}", partial(_drawn, figure, name, making))
        for figure in result.figures
    ]
    tables = [folder.shown_table(each, (), f"{name}-{each.key}") for each in result.tables]
    changes = None
    if section.changes and found.compared is not None:
        table = changes_table(found.chosen.name, found.compared.name, section)
        changes = folder.shown_table(table, (), table.key)
    return ShownSection(
        anchor=f"method-{name.replace('_', '-')}",
        section=section,
        warnings=tuple(f"{name}: {each.text}" for each in section.identified.warnings),
        conclusions=tuple(sentence(each) for each in result.conclusions),
        remarks=tuple(remarks(result.conclusions)),
        figures=tuple(filter(None, figures)),
        tables=tuple(tables),
        changes=changes,
    )


def _looks(found: Identification) -> Mapping[str, Look]:
    series: list[list[str]] = []
    for section in found.sections:
        for figure in section.result.figures if section.result else ():
            with suppress(Exception):  # a plug-in's, which is told where it is shown
                series.append(series_of(figure))
    return looks_of_page(series)


def _drawn(figure: Figure, name: str, making: _Making) -> ShownFigure:
    drawn = Drawn.of(draw(figure, chosen=making.looks), figure)
    return making.folder.figure(figure, drawn, (), f"{name}-{figure.key}", trials=figure.trials)


def as_json(found: Identification, command: str) -> str:
    """Every parameter with its interval and origin, and what it came from, for machines."""
    tree = {
        "schema": 1,
        "program": f"campaign {__version__}",
        "command": command,
        "run": found.chosen.name,
        "digest": found.chosen.run.identity,
        "validation": found.validation.name if found.validation else None,
        "compared": found.compared.name if found.compared else None,
        "bench": found.bench.name,
        "methods": [_method_tree(each) for each in found.sections],
        "next": next_measurement(found),
    }
    return json_text(tree)


def _method_tree(section: Section) -> dict[str, Any]:
    tree: dict[str, Any] = {
        "method": section.model.name,
        "options": section.options.model_dump(mode="json"),
        "trials": list(section.trials),
        "problem": section.problem,
    }
    if section.result is None:
        return tree
    return tree | {
        "parameters": [
            {**row_of(each.estimate), "meaning": each.meaning, "bench": each.bench,
             "advice": each.advice}
            for each in section.identified.parameters
        ],
        "correlations": [
            [*pair, share] for pair, share in section.identified.correlations.items()
        ],
        "tables": {
            table.key: [
                {name: row_of(cell) if isinstance(cell, Estimate) else cell
                 for name, cell in row.items()}
                for row in table.rows
            ]
            for table in section.result.tables
        },
        "notes": list(section.result.notes),
        "warnings": [
            {"code": each.code, "text": each.text, "values": dict(each.values)}
            for each in section.identified.warnings
        ],
        "changes": [
            {"before": row_of(each.reference), "after": row_of(each.other),
             "difference": row_of(each.found.difference), "p": each.found.p,
             "adjusted": each.adjusted, "verdict": each.outcome}
            for each in section.changes
        ],
    }  # fmt: skip
