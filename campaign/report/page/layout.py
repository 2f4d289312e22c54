"""Data of the templates: complete, numbered, in the order of the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from shlex import quote

from campaign.api.analysis import NOT_EXECUTED, AnalysedTest
from campaign.axis_kind import axis_terms
from campaign.published.scoreboard import COLUMNS, Scoreboard, to_csv
from campaign.published.values import Published, PublishedTable
from campaign.report.content.conditions import conditions_of, summary_of
from campaign.report.content.document import Document
from campaign.report.content.lines import ScoredTable, scored_tables, shown_line
from campaign.report.content.lines import closeness as closeness_table
from campaign.report.content.published_columns import as_compared, with_published
from campaign.report.content.references import ReferenceComparison
from campaign.report.content.run_problems import without_trials
from campaign.report.content.symbols import SYMBOLS, Symbol, symbols_for
from campaign.report.content.written_units import TestUnits
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.page.article import PageParts
from campaign.report.page.drawings import OVERVIEW, Drawable, Drawing, Key, Overview, drawings_of
from campaign.report.page.folder import (
    Comparison,
    Download,
    Folder,
    Section,
    ShownFigure,
    ShownTable,
)
from campaign.report.page.names import figure_name, stood_for
from campaign.report.page.pictures import changes_figure, draws, overview
from campaign.result import Figure, Table
from campaign.trial import Role

OF_A_TABLE = (*COLUMNS[1:8], "reason", "test", *COLUMNS[8:])
"""Columns of the file of one published table."""
Drawn = Callable[[Key], DrawingFiles | None]
"""Waits for a started drawing; None when it is not available."""
DrawAll = Callable[[Mapping[Key, Drawable]], Drawn]
"""Starts drawings."""


def draw_on_demand(drawings: Mapping[Key, Drawable]) -> Drawn:
    """Start no drawing: each drawing is made during layout."""
    return lambda key: None


@dataclass(frozen=True)
class Layout:
    """A document with its figures and tables drawn and numbered, for all formats.

    Attributes:
        picture: picture of the scoreboard; None without a comparison.
        strips: published values among draws; None without draws.
        closeness: counts of published values by deviation; None without any.
        scoreboard_download: None without published values.
        incident_figures, incident_tables: incidents of the run.
        problems: items that could not be shown or compared, one line each, without damage.
        scored: summary of each published table, in the order of the scoreboard.
        symbols: symbols of the source document, and their names in files.
    """

    document: Document
    folder: Folder
    picture: ShownFigure | None
    strips: ShownFigure | None
    closeness: ShownTable | None
    scoreboard_download: Download | None
    sections: tuple[Section, ...]
    incident_figures: tuple[ShownFigure, ...]
    incident_tables: tuple[ShownTable, ...]
    problems: tuple[str, ...]
    scored: tuple[ScoredTable, ...] = ()
    symbols: tuple[Symbol, ...] = SYMBOLS

    @property
    def figures(self) -> tuple[ShownFigure, ...]:
        """All figures of the page, sorted by number."""
        overview = (each for each in (self.picture, self.strips) if each is not None)
        of_tests = (figure for section in self.sections for figure in section.figures)
        every = (*overview, *of_tests, *self.incident_figures)
        return tuple(sorted(every, key=lambda figure: figure.number))

    @property
    def groups(self) -> tuple[tuple[str, tuple[Section, ...]], ...]:
        """Sections of the tests by group; "" for tests before the first named group."""
        groups: list[tuple[str, list[Section]]] = []
        for section in self.sections:
            if not groups or section.test.group not in ("", groups[-1][0]):
                groups.append((section.test.group, []))
            groups[-1][1].append(section)
        return tuple((name, tuple(own)) for name, own in groups)

    @property
    def figure_groups(self) -> tuple[tuple[ShownFigure, ...], ...]:
        """The figures in groups of ten or more, for short navigation."""
        figures = self.figures
        size = max(10, math.isqrt(len(figures)) + 1)
        return tuple(figures[n : n + size] for n in range(0, len(figures), size))

    @property
    def tests_of_figures(self) -> Mapping[str, str]:
        """Title of the test by a figure's anchor: figures of several tests may share a title."""
        of = (
            (section.test.title, figure) for section in self.sections for figure in section.figures
        )
        return {figure.anchor: title for title, figure in of}

    @property
    def long_tables(self) -> tuple[ShownTable, ...]:
        """Tables with further rows in the appendix."""
        of_tests = (item for section in self.sections for item in section.items)
        tables = (
            each for each in (*of_tests, *self.incident_tables) if isinstance(each, ShownTable)
        )
        return tuple(each for each in tables if each.content.as_text)

    @property
    def telling(self) -> ShownFigure | None:
        """The figure on top of the page."""
        wanted = self.document.opening.telling
        shown = ((s.test.name, figure) for s in self.sections for figure in s.figures)
        return next((f for name, f in shown if f.data and (name, f.data.key) == wanted), None)


def lay_out(document: Document, draw_all: DrawAll = draw_on_demand, command: str = "") -> Layout:
    """Draw and number everything, in the order of the page; `draw_all` starts the drawings.

    command: shown command for this report; default: from the run's name.
    """
    folder, scoreboard = Folder(), document.scoreboard
    command = command or f"campaign report {quote(document.run.header.name)}"
    drawings, top = drawings_of(document.tests, document.published), Overview(scoreboard)
    drawn = draw_all({**drawings, OVERVIEW: top})
    makers = _makers(document, folder, command, drawings, drawn)
    _make_first(document, makers)
    download = scoreboard_download(scoreboard, folder) if scoreboard.lines else None
    picture, strips = (
        None if shown is None else replace(shown, command=command)
        for shown in (
            overview(scoreboard, folder, drawn(OVERVIEW) or top.made()),
            draws(scoreboard, folder),
        )
    )
    close = closeness_table(scoreboard)
    closeness = None if close is None else folder.shown_table(close, (), close.key)
    sections = _sections(document, makers)
    happened = document.incidents
    figures = tuple(
        folder.figure(each, Drawing(each).made(), (), f"incidents-{each.key}", command=command)
        for each in happened.figures
    )
    shown = tuple(folder.shown_table(each, (), f"incidents-{each.key}") for each in happened.tables)
    problems = (
        *without_trials(document.run, document.tests),
        *(f"{s.test.name}: {p}" for s in sections for p in _problems(s)),
        *scoreboard.problems,
        *document.references.problems,
        *happened.problems,
    )
    places = {table.table: table.anchor for s in sections for table in s.comparisons}
    return Layout(
        document,
        folder,
        picture,
        strips,
        closeness,
        download,
        sections,
        figures,
        shown,
        problems,
        scored_tables(scoreboard, document.published, places),
        symbols_for(test.sides for test in document.tests),
    )


def _problems(section: Section) -> Iterator[str]:
    """Problems of a test, and the trials that its analysis does not use."""
    reported = (*section.left_out, NOT_EXECUTED)
    yield from (each for each in section.problems if each not in reported)
    yield from section.test.account


def _makers(
    document: Document,
    folder: Folder,
    command: str,
    drawings: Mapping[Key, Drawing],
    drawn: Drawn,
) -> Mapping[str, _Maker]:
    """Maker of figures and tables, by test."""
    return {
        test.name: _Maker(
            folder=folder,
            problems=[test.problem] if test.problem else [],
            test=test,
            units=document.units[test.name],
            command=f"{command} --only-figure",
            drawings=drawings,
            awaited=drawn,
            published=document.published,
        )
        for test in document.tests
    }


def _make_first(document: Document, makers: Mapping[str, _Maker]) -> None:
    """Make the leading figure first, for number 1; its test reports it if it cannot be shown."""
    wanted = document.opening.telling
    for test in document.tests:
        for figure in test.result.figures:
            if (test.name, figure.key) == wanted:
                with suppress(Exception):
                    makers[test.name].figure(figure)


def _sections(document: Document, makers: Mapping[str, _Maker]) -> tuple[Section, ...]:
    """Sections in the protocol's order; each published table is in that of its first test."""
    used: set[str] = set()
    sections = []
    for place, test in enumerate(document.tests, start=1):
        names = [n for n in document.published if n in test.reproduces and n not in used]
        used.update(names)
        own = [document.published[name] for name in names]
        sections.append(_section(place, makers[test.name], document, own))
    return tuple(sections)


def scoreboard_download(scoreboard: Scoreboard, folder: Folder) -> Download:
    """Add `tables/scoreboard.csv`, and a file with the repeated results of cells."""
    download = folder.table(to_csv(scoreboard.lines), "scoreboard")
    if scoreboard.further:
        folder.table(to_csv(scoreboard.further, (*COLUMNS, "test")), "scoreboard-runs")
    return download


def _changes(compared: ReferenceComparison, maker: _Maker) -> ShownFigure | None:
    """Picture of a comparison of two or more numbers; None for fewer."""
    if len(compared.pairs) < 2:
        return None
    key = f"{maker.test.name}-{compared.table.key}"
    return maker.attempt(key, lambda: changes_figure(compared.pairs, maker.folder, key))


def _section(
    place: int, maker: _Maker, document: Document, published: Sequence[PublishedTable]
) -> Section:
    """Section of a test; `published`: tables that are compared in this section."""
    test, scoreboard, folder = maker.test, document.scoreboard, maker.folder
    left_out = tuple(_left_out(test))
    truth, stated = document.truths.get(test.name), document.references.stated.get(test.name)
    files = document.references.files.get(test.name, ())
    with axis_terms(test.sides):
        comparisons = [_comparison(table, scoreboard, folder) for table in published if table.cells]
        prediction = None if stated is None else maker.table(stated.table)
        references = [maker.table(each.table) for each in files]
        changes = [_changes(each, maker) for each in (stated, *files) if each is not None]
        figures = [
            maker.attempt(each.key, partial(maker.figure, each)) for each in test.result.figures
        ]
        shown_tables = [
            maker.attempt(each.key, partial(maker.table, each)) for each in test.result.tables
        ]
        return Section(
            anchor=f"test-{place}",
            test=test,
            conditions=tuple(conditions_of(test, maker.units)),
            figures=tuple(filter(None, (*changes, *figures))),
            tables=tuple(filter(None, shown_tables)),
            comparisons=tuple(comparisons),
            problems=(*left_out, *maker.problems),
            left_out=left_out,
            truth=None if truth is None else maker.table(truth),
            prediction=prediction,
            references=tuple(references),
            summary=summary_of(test),
        )


def _left_out(test: AnalysedTest) -> Iterator[str]:
    """Damage of the test's trials, and whether the trial is omitted."""
    used = {archived.trial.name for archived in test.trials}
    for damage in test.damaged:
        is_what = "is damaged" if damage.trial in used else "is left out"
        yield f"{damage.trial or test.name} {is_what}: {damage}"


@dataclass(kw_only=True)
class _Maker(PageParts):
    """Makes the figures and tables of one test; `problems`: reasons for missing ones.

    Attributes:
        command: command that draws one of its figures, without the figure's name.
        drawings: drawings of all tests.
        awaited: waits for a drawing of another process.
        published: published values of the run, by table.
        shown: figures that are already made, by key.
    """

    test: AnalysedTest
    units: TestUnits
    command: str
    drawings: Mapping[Key, Drawing]
    awaited: Drawn
    published: Published
    shown: dict[str, ShownFigure] = field(default_factory=dict)

    def figure(self, figure: Figure) -> ShownFigure:
        if figure.key not in self.shown:
            self.shown[figure.key] = self._new_figure(figure)
        return self.shown[figure.key]

    def _new_figure(self, figure: Figure) -> ShownFigure:
        test = self.test
        numbers = stood_for(figure.thesis, test.reproduces, "figure ")
        key = test.name, figure.key
        drawing = self.drawings.get(key) or Drawing(figure)
        return self.folder.figure(
            drawing.figure,
            self.awaited(key) or drawing.made(),
            numbers,
            *figure_name(numbers, test.name, figure.key),
            trials=tuple(figure.trials or _measurements(test)),
            command=f"{self.command} {quote(f'{test.name}/{figure.key}')}",
            looks=drawing.looks,
        )

    def table(self, table: Table) -> ShownTable:
        numbers = stood_for(table.thesis, self.test.reproduces, "")
        reproduced = [self.published[n] for n in self.test.reproduces if n in self.published]
        table = with_published(table, reproduced, self.test.evidence().known)
        page = self.units.table(as_compared(table))
        table = self.units.in_si(table)
        return self.folder.shown_table(table, numbers, f"{self.test.name}-{table.key}", page=page)


def _measurements(test: AnalysedTest) -> list[int]:
    """Numbers of the completed measurements of a test, or of all completed trials without any.

    A test that seeks instability also uses trials that did not complete.
    """
    sought = test.experiment is not None and test.experiment.seeks_instability
    failed = () if sought else {each.trial.number for each in test.failed}
    every = [archived.trial for archived in test.trials]
    trials = [each for each in every if each.role is Role.MEASUREMENT] or every
    return [each.number for each in trials if each.number not in failed]


def _comparison(table: PublishedTable, scoreboard: Scoreboard, folder: Folder) -> Comparison:
    lines = scoreboard.of_table(table.name)
    place = folder.next_table()
    return Comparison(
        number=place,
        anchor=f"table-{place}",
        table=table.name,
        heading=table.heading,
        title=table.title,
        source=table.source,
        lines=tuple(shown_line(line) for line in lines),
        download=folder.table(to_csv(lines, OF_A_TABLE), table.slug),
    )
