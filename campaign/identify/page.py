"""The folder of an identification: page, tables, figures, JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from campaign import __version__
from campaign.api.estimate_text import remarks
from campaign.api.estimates import row_of
from campaign.axis_kind import axis_terms, in_axis_terms
from campaign.identify.agreement import disagreements
from campaign.identify.identification import Identification, Section, widest
from campaign.identify.tables import changes_table, parameter_words, parameters_table
from campaign.parameter import Parameter
from campaign.report.article import write_article
from campaign.report.drawing.figures import series_of
from campaign.report.formats.interface import Format
from campaign.report.page.article import Article, PageParts, Part, problems_part
from campaign.report.page.pieces import Items, Paragraph, Piece
from campaign.report.palette import Look, looks_of_page
from campaign.result import Result

CURES = {
    "window": "it depends on how far a ramp is fitted; record the angle more finely",
    "angle": "slide over all of the travel, at several speeds in both directions",
    "band": "half the band finds otherwise: the model lacks something (look at what is left over); "
    "or the sensor's noise is in the motion (take a finer one, or move faster)",
    "exponent": "slide at more, and slower, speeds, or measure a velocity map",
    "what the model misses": "the model lacks something; look at what is left over",
    "friction, at this excitation": "excite with more torque, of which friction is less, "
    "and with a second amplitude, half of it",
    "slow": "record more motion at low speeds",
    "instruments": "reduce the noise of the measured motion, or accelerate more",
    "loop": "record the wanted motion as well (channel `reference`)",
    "presliding": "excite with more force, until the axis slides",
    "form of the curve": "friction follows another law; look at what is left over",
    "delay": "record faster, with sharper reversals, or with a reference signal on both channels",
}
"""Advice that makes a systematic part smaller, by its source."""
NAME = "identification"
PAGE = f"{NAME}.html"


@dataclass
class _Making(PageParts):
    looks: Mapping[str, Look] = field(default_factory=dict)
    """Looks of the series of all figures: a series has one look on the whole page."""


def write_identification(
    found: Identification,
    output: Path,
    packaged_templates: Path,
    command: str,
    bench: str = "",
    templates: Path | None = None,
    formats: Sequence[Format] = (),
) -> Path:
    """Write the identification into the folder `output`; return the page's path.

    bench: name of the written bench file; "" for none. Else as `write_article`.
    """
    make = partial(article_of, found, command, bench)
    return write_article(NAME, make, output, packaged_templates, templates, formats)


def article_of(found: Identification, command: str, bench: str = "") -> Article:
    """Page of an identification."""
    making = _Making(looks=_looks(found))
    chosen, header = found.chosen, found.chosen.run.header
    with axis_terms(found.bench.sides):
        parts = tuple(_parts(found, making))
    lede = f"Parameters of the rig from {chosen.name}"
    if found.validation:
        lede += f", held against {found.validation.name}, to which nothing was fitted"
    if found.compared:
        lede += f", and compared with {found.compared.name}"
    facts = (
        ("Run", chosen.name),
        ("Title", header.title),
        ("Samples from", header.source or header.backend or "not stated"),
        ("Digest", chosen.run.identity),
        ("Program", f"campaign {__version__}"),
        *([("Bench file", bench)] if bench else []),
    )
    return Article(
        kind="Identification",
        command=command,
        title=f"{found.bench.name}, {found.bench.axis.name}",
        lede=f"{lede}.",
        facts=(("", facts),),
        parts=(*problems_part("this page", making.problems), *parts),
        folder=making.folder,
        content=content_of(found),
    )


def _parts(found: Identification, making: _Making) -> Iterator[Part]:
    shown = [(each, each.result) for each in found.sections if each.result is not None]
    yield Part("found", "Findings", tuple(_found(found, shown, making)))
    for section, result in shown:
        summary = section.model.summary
        anchor = f"method-{section.model.name.replace('_', '-')}"
        pieces = tuple(_section(section, result, found, making))
        yield Part(anchor, f"{summary[:1].upper()}{summary[1:]}", pieces, role="test")
    refused = [each for each in found.sections if each.result is None]
    if refused:
        items = (f"{e.model.name} ({e.model.summary}): {e.problem.rstrip('.')}." for e in refused)
        yield Part("refused", "Not determined from these recordings", (Items(tuple(items)),))


def _found(
    found: Identification, shown: Sequence[tuple[Section, Result]], making: _Making
) -> Iterator[Piece]:
    for section, result in shown:
        for each in section.identified.warnings:
            yield Paragraph(f"{section.model.name}: {each.text}.", "warning")
        yield from (Paragraph(t, "note") for t in remarks(f.known for f in result.key_numbers))
    if shown:
        table = making.folder.shown_table(parameters_table(found.sections), (), "parameters")
        yield replace(table, stacked=True)
    else:
        yield Paragraph("Nothing: no method could use these recordings.", "lead")
    if advice := next_measurement(found):
        yield Paragraph(f"To measure next: {advice}")


def next_measurement(found: Identification) -> str:
    """Disagreements of methods, and the next measurement that halves the widest interval."""
    widest_one = widest(found.parameters)
    with axis_terms(found.bench.sides):
        advice = [] if widest_one is None else [_advice(widest_one)]
    return " ".join([*disagreements(found.sections), *advice])


def _advice(parameter: Parameter) -> str:
    estimate = parameter.estimate
    scatter = 0.0
    if estimate.low is not None and estimate.high is not None:
        scatter = 0.5 * (estimate.high - estimate.low)
    share = abs(estimate.half_width / estimate.value)
    name = parameter_words(estimate.name)
    begin = f"The widest interval is that of {name}: ± {100 * share:.2g} % of it."
    parts = [part for part in estimate.systematic if part.standard_uncertainty]
    parts.sort(key=lambda part: -(part.standard_uncertainty or 0.0))
    if parts and 2.0 * estimate.systematic_uncertainty > scatter:
        source = in_axis_terms(parts[0].source)
        cure = CURES.get(parts[0].source, f"know the {source} better")
        return (
            f"{begin} Most of it is systematic ({source}); a longer recording does not reduce "
            f"it: {cure}."
        )
    longer = "four times as much of the same motion halves it"
    return f"{begin} To halve it, {parameter.advice}; or {longer}." if parameter.advice else (
        f"{begin} It scatters: {longer}."
    )  # fmt: skip


def _section(
    section: Section, result: Result, found: Identification, making: _Making
) -> Iterator[Piece]:
    name, folder = section.model.name, making.folder
    if section.problem:
        yield Paragraph(f"Not compared: {section.problem}.", "note")
    if section.changes and found.compared is not None:
        changes = changes_table(found.chosen.name, found.compared.name, section)
        yield folder.shown_table(changes, (), changes.key)
    for figure in result.figures:
        if drawn := making.drawn(figure, f"{name}-", making.looks):
            yield drawn
    yield from (folder.shown_table(each, (), f"{name}-{each.key}") for each in result.tables)
    if result.notes:
        yield Items(result.notes)


def _looks(found: Identification) -> Mapping[str, Look]:
    series: list[list[str]] = []
    for section in found.sections:
        for figure in section.result.figures if section.result else ():
            with suppress(Exception):  # of a plug-in; the page reports it at the figure
                series.append(series_of(figure))
    return looks_of_page(series)


def content_of(found: Identification) -> dict[str, Any]:
    """JSON tree: every parameter with its interval, origin, method and trials."""
    return {
        "run": found.chosen.name,
        "digest": found.chosen.run.identity,
        "validation": found.validation.name if found.validation else None,
        "compared": found.compared.name if found.compared else None,
        "bench": found.bench.name,
        "methods": [_method_tree(each) for each in found.sections],
        "next": next_measurement(found),
    }


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
