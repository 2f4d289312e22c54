"""`report.json`: every number of the page, for other programs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, TypeAdapter

from campaign import __version__, result
from campaign.api.estimates import row_of
from campaign.api.results import code_of
from campaign.archive.reading.damage_words import in_words
from campaign.axis_kind import axis_terms
from campaign.estimate import Estimate
from campaign.published.headline import LIMITS, headline
from campaign.published.scoreboard import Line
from campaign.report.content import lines, tables
from campaign.report.content.document import Document
from campaign.report.drawing.decimate import kept
from campaign.report.formats import report_data as data
from campaign.report.page.article import Article, Part
from campaign.report.page.folder import Comparison, Section, ShownFigure, ShownTable
from campaign.report.page.layout import Layout
from campaign.report.page.pieces import FoldedSection, Items, Paragraph, Piece
from campaign.units import factor

POINTS = 400
"""Maximum number of points of a curve; the drawing has more, the results beside the run all."""
DIGITS = 7
"""Digits of the numbers of a curve."""


M = TypeVar("M", bound=BaseModel)


def _as(model: type[M], /, *sources: object, **more: Any) -> M:
    """Model of `more`; other fields are attributes of the first of `sources` with that name."""
    fields = {
        name: plain(getattr(source, name))
        for source in reversed(sources)
        for name in model.model_fields
        if hasattr(source, name) and name not in more
    }
    return model.model_validate(fields | more)


def article_json(article: Article) -> str:
    """JSON text of a comparison, trends or an identification."""
    page = data.ArticleData(
        kind=article.kind.lower(),
        program=f"campaign {__version__}",
        command=article.command,
        title=article.title,
        facts=tuple(
            tuple(data.Said(name=name, text=text) for name, text in pairs)
            for _, pairs in article.facts
        ),
        sections=tuple(map(_part, article.parts)),
        content=plain(article.content),
    )
    return _text(page)


def _part(part: Part) -> data.Section:
    pieces = tuple(_unfolded(part.pieces))
    sentences: list[str] = []
    for piece in pieces:
        if isinstance(piece, Paragraph):
            sentences.append(piece.text)
        elif isinstance(piece, Items):
            sentences += piece.texts
    return data.Section(
        anchor=part.anchor,
        heading=part.heading,
        sentences=tuple(sentences),
        figures=tuple(_figure(each) for each in pieces if isinstance(each, ShownFigure)),
        tables=tuple(_table(each) for each in pieces if isinstance(each, ShownTable)),
    )


def _unfolded(pieces: Iterable[Piece]) -> Iterator[Piece]:
    for piece in pieces:
        if isinstance(piece, FoldedSection):
            yield from _unfolded(piece.pieces)
        else:
            yield piece


def _text(page: BaseModel) -> str:
    tree = page.model_dump(mode="json")
    return json.dumps(tree, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def read_report(text: str) -> data.ReportData:
    """Parse the JSON of a report. Raises ValueError when it violates the schema."""
    return data.ReportData.model_validate_json(text)


def report_schema() -> dict[str, Any]:
    """JSON Schema of `report.json`, and of the JSON of other pages."""
    return TypeAdapter(data.ReportData | data.ArticleData).json_schema()


def report_json(layout: Layout) -> str:
    """Text of `report.json`, deterministic."""
    document = layout.document
    page = data.ReportData(
        run=_run(document),
        opening=document.opening,
        scoreboard=_scoreboard(layout),
        tests=tuple(map(_test, layout.sections)),
        incidents=data.Incidents(
            figures=tuple(map(_figure, layout.incident_figures)),
            tables=tuple(map(_table, layout.incident_tables)),
        ),
        failed=tuple(_as(data.FailedTrial, each.trial, each.ending) for each in document.failed),
        problems=layout.problems,
        damaged=tuple(in_words(damage) for damage in document.damaged),
        provenance=_provenance(document),
    )
    return _text(page)


def number(estimate: Estimate) -> data.Number:
    """An estimate as data."""
    row = {name: value for name, value in row_of(estimate).items() if name != "systematic"}
    systematic = {part.source: part.standard_uncertainty for part in estimate.systematic}
    fields = {name: plain(value) for name, value in row.items()}
    return data.Number.model_validate(
        {**fields, "level": estimate.level, "systematic": plain(systematic)}
    )


def plain(value: Any) -> Any:
    """Convert a value to JSON types; a number that is not finite becomes null."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, int | str) else str(value)


def _run(document: Document) -> data.Run:
    run = document.run
    return _as(
        data.Run,
        run,
        run.header,
        file=run.path.name,
        title=document.title,
        planned=len(run.plan),
        executed=len(run.trials),
        not_completed=len(document.failed),
        not_readable=document.lost,
        not_executed=document.not_executed,
    )


def _test(section: Section) -> data.Test:
    test, outcome = section.test, section.test.result
    with axis_terms(test.sides):
        return _as(
            data.Test,
            section,
            test,
            outcome,
            trials=tuple(each.trial.number for each in test.trials),
            conditions=tuple(data.Said(name=n, text=text) for n, text in section.conditions),
            key_numbers=tuple(map(_finding, outcome.key_numbers)),
            findings=tuple(map(_finding, outcome.findings)),
            comparisons=tuple(map(_comparison, section.comparisons)),
            figures=tuple(map(_figure, section.figures)),
            tables=tuple(map(_table, section.tables)),
            truth=None if section.truth is None else _table(section.truth),
            prediction=None if section.prediction is None else _table(section.prediction),
            references=tuple(map(_table, section.references)),
        )


def _finding(finding: result.Finding) -> data.Finding:
    return _as(data.Finding, finding, number=number(finding.known))


def _table(shown: ShownTable) -> data.Table:
    table = shown.data
    if table is None:
        raise TypeError(f"{shown.anchor}: a table without its data")
    return _as(
        data.Table,
        table,
        shown,
        place=shown.number,
        file=shown.download.file,
        remarks=tuple(tables.remarks(table)),
        columns=tuple(_as(data.Column, each, **_display(each)) for each in table.columns),
        rows=tuple(
            {each.name: _cell(row.get(each.name)) for each in table.columns} for row in table.rows
        ),
    )


def _cell(cell: result.Cell) -> Any:
    return number(cell) if isinstance(cell, Estimate) else plain(cell)


def _figure(shown: ShownFigure) -> data.Figure:
    figure = shown.data
    return _as(
        data.Figure,
        shown,
        key="" if figure is None else figure.key,
        place=shown.number,
        trials=shown.trial_numbers,
        panels=() if figure is None else tuple(map(_panel, figure.panels)),
    )


def _panel(panel: result.Panel) -> data.Panel:
    return data.Panel(
        title=panel.title,
        x=_as(data.Axis, panel.x, **_display(panel.x)),
        y=_as(data.Axis, panel.y, **_display(panel.y)),
        curves=tuple(map(_curve, panel.curves)),
        marks=tuple(_as(data.Mark, each) for each in panel.marks),
    )


def _curve(curve: result.Curve) -> data.Curve:
    x, y = (np.asarray(each, dtype=float) for each in (curve.x, curve.y))
    chosen = kept(x, y, POINTS)

    def shortened(values: Any) -> Any:
        if values is None:
            return None
        shown = np.asarray(values, dtype=float)[chosen].tolist()
        rounded = (float(f"{each:.{DIGITS}g}") for each in shown)
        return tuple(each if math.isfinite(each) else None for each in rounded)

    return _as(
        data.Curve,
        curve,
        points=len(x),
        x=shortened(x),
        y=shortened(y),
        low=shortened(curve.low),
        high=shortened(curve.high),
        lower_edge=shortened(curve.y_low),
    )


def _comparison(shown: Comparison) -> data.Comparison:
    of_table = {line.table for line in shown.lines}
    return _as(
        data.Comparison,
        shown,
        table=next(iter(of_table), ""),
        place=shown.number,
        file=shown.download.file,
    )


def _scoreboard(layout: Layout) -> data.Scoreboard:
    document = layout.document
    board, counted = document.scoreboard, headline(document.scoreboard)
    pictures = [each for each in (layout.picture, layout.strips) if each is not None]
    return data.Scoreboard(
        agreement=lines.agreement(board),
        counts=tuple(
            _as(
                data.Count,
                each,
                within_percent=dict(zip(map(str, LIMITS), each.within, strict=True)),
            )
            for each in counted.counts
        ),
        closeness=None if layout.closeness is None else _table(layout.closeness),
        not_reached=len(counted.not_reached),
        not_found=len(counted.not_found),
        not_run=len(counted.not_run),
        lines=tuple(map(_line, board.lines)),
        further=tuple(map(_line, board.further)),
        statuses={name: count for name, _, _, count in lines.statuses(board)},
        sources=document.sources,
        altered=board.altered,
        contradictions=tuple(
            data.Contradiction(table=table, cells=cells, reason=reason)
            for table, cells, reason in lines.contradictions(board)
        ),
        figures=tuple(map(_figure, pictures)),
        file="" if layout.scoreboard_download is None else layout.scoreboard_download.file,
    )


def _line(line: Line) -> data.Line:
    cell, found = line.cell, line.found
    return _as(
        data.Line,
        line,
        cell,
        cell=lines.cell_name(cell),
        published=plain(cell.value),
        low=None if found is None else plain(found.low),
        high=None if found is None else plain(found.high),
        kind="" if found is None else found.kind,
        deviation_percent=plain(line.deviation),
        status="" if line.status is None else str(line.status),
        notes=tuple(note for note in (cell.reason, *cell.notes) if note),
        place=None if line.place is None else number(line.place),
    )


def _provenance(document: Document) -> data.Provenance:
    run, header = document.run, document.run.header
    plants: Iterable[Mapping[str, Any]] = header.truth.plants.values()
    return _as(
        data.Provenance,
        header,
        sha256=run.sha256,
        seal=run.root,
        command=document.command,
        seeds=document.seeds,
        measured_by=document.measured_by,
        truths=tuple(dict.fromkeys(str(plant.get("name", "")) for plant in plants)),
        truth_sources=header.truth.sources,
        program=__version__,
        code=code_of(document.tests),
    )


def _display(shown: result.Column | result.Axis) -> dict[str, Any]:
    """Display unit, and the factor that converts a number to it."""
    same = shown.shown_unit == shown.unit
    scale = 1.0 if same else float(factor(shown.unit, shown.shown_unit))
    return {"display": shown.shown_unit, "factor": scale}
