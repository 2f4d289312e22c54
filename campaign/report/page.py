"""What the templates are given: plain, numbered, ordered data, nothing left to decide."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, get_args

from campaign.experiments.interface import options_of
from campaign.experiments.preparing.swept_tables import table_names
from campaign.options import Options
from campaign.plain_text import on_a_page
from campaign.published.scoreboard import Scoreboard, to_csv
from campaign.published.values import Published, PublishedTable
from campaign.report import tables
from campaign.report.analysis import AnalysedTest, one_line
from campaign.report.figures import draw, inline
from campaign.report.lines import ShownLine, shown_line
from campaign.report.names import Names, figure_name, stood_for
from campaign.report.overview import draw_overview
from campaign.report.strips import draw_strips
from campaign.report.text import number, pretty_unit
from campaign.result import Figure, Table
from campaign.trial import canonical_json
from campaign.units import Quantity, convert

LINKED = 300_000
"""Characters of a CSV file up to which the page carries it; a longer one is only a file."""
LISTED = 12
"""Most values of a sweep that are written out."""


@dataclass(frozen=True)
class ShownFigure:
    """A figure on the page. `svg` is markup that is safe to write as it stands."""

    number: int
    anchor: str
    title: str
    caption: str
    svg: str
    file: str
    published: tuple[str, ...] = ()


@dataclass(frozen=True)
class Download:
    """A CSV file: its name in the folder, and where the page's link leads."""

    file: str
    href: str


@dataclass(frozen=True)
class ShownTable:
    """A numbered table of a test."""

    number: int
    anchor: str
    title: str
    note: str
    published: tuple[str, ...]
    content: tables.ShownTable
    download: Download


@dataclass(frozen=True)
class Comparison:
    """A published table beside what the run found."""

    number: int
    anchor: str
    heading: str
    title: str
    source: str
    lines: tuple[ShownLine, ...]
    download: Download


@dataclass(frozen=True)
class Section:
    """One test on the page; `left_out` are those of the `problems` that are damaged trials.

    `truth`: what it found beside what is true, where that is known.
    """

    anchor: str
    test: AnalysedTest
    conditions: tuple[tuple[str, str], ...]
    figures: tuple[ShownFigure, ...]
    tables: tuple[ShownTable, ...]
    comparisons: tuple[Comparison, ...]
    problems: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    truth: ShownTable | None = None


@dataclass
class Folder:
    """What the report's folder will contain, collected while the page is laid out."""

    files: dict[str, str] = field(default_factory=dict)
    table_names: Names = field(default_factory=Names)
    figure_names: Names = field(default_factory=Names)
    figures: int = 0
    tables: int = 0

    def table(self, text: str, *candidates: str) -> Download:
        """Add a CSV file and say where its link leads."""
        file = f"tables/{self.table_names.unique(*candidates)}.csv"
        text = on_a_page(text)
        self.files[file] = text
        return Download(file, tables.data_link(text) if len(text) <= LINKED else file)

    def figure(
        self, svg: str, title: str, caption: str, alt: str, published: tuple[str, ...], *names: str
    ) -> ShownFigure:
        """Add an SVG file and the numbered figure that shows it."""
        from markupsafe import Markup

        name = self.figure_names.unique(*names)
        self.files[f"figures/{name}.svg"] = svg
        self.figures += 1
        anchor = f"figure-{self.figures}"
        markup = Markup(inline(svg, anchor, title, alt))  # noqa: S704 (ours, and `inline` escapes)
        return ShownFigure(
            self.figures, anchor, title, caption, markup, f"figures/{name}.svg", published
        )

    def next_table(self) -> int:
        self.tables += 1
        return self.tables


def lay_out(
    tests: Sequence[AnalysedTest],
    scoreboard: Scoreboard,
    published: Published,
    folder: Folder,
    truths: Mapping[str, Table] | None = None,
) -> tuple[Section, ...]:
    """Sections in the protocol's order; each published table stands with its first test.

    `truths`: by test, what is true beside what it found, where that is known.
    """
    spoken: set[str] = set()
    sections = []
    for place, test in enumerate(tests, start=1):
        mine = [n for n in published if n in test.reproduces and n not in spoken]
        spoken.update(mine)
        section = _section(place, test, scoreboard, [published[n] for n in mine], folder)
        truth = (truths or {}).get(test.name)
        if truth is not None:
            section = replace(section, truth=_table(test, truth, folder))
        sections.append(section)
    return tuple(sections)


def overview(scoreboard: Scoreboard, folder: Folder) -> ShownFigure | None:
    """The picture on top of the page."""
    svg = draw_overview(scoreboard)
    if svg is None:
        return None
    return folder.figure(
        svg,
        "Deviation from the published values",
        "One sign per published number: how far the reproduced value is from it, and what the"
        " comparison is worth. The axis is linear up to ±1 % and logarithmic beyond.",
        tables.agreement(scoreboard),
        (),
        "scoreboard",
    )


def strips(scoreboard: Scoreboard, folder: Folder) -> ShownFigure | None:
    """Where published values stand among the draws of a random bench."""
    svg = draw_strips(scoreboard)
    if svg is None:
        return None
    return folder.figure(
        svg,
        "Published values among the draws of a random bench",
        "Each tick is the bench with another seed of its scatter, the dot their median, the band"
        " where 95 % of further draws lie, systematic parts included. The line at 0 is the"
        " published value, one draw itself; the share of draws below it stands on the right.",
        "One strip of ticks per published number, around a line at the published value.",
        (),
        "draws",
    )


def scoreboard_download(scoreboard: Scoreboard, folder: Folder) -> Download:
    """`tables/scoreboard.csv`; cells that were found again are in a file beside it."""
    download = folder.table(to_csv(scoreboard.lines), "scoreboard")
    if scoreboard.further:
        folder.table(to_csv(scoreboard.further, tests=True), "scoreboard-runs")
    return download


def _section(
    place: int,
    test: AnalysedTest,
    scoreboard: Scoreboard,
    published: Sequence[PublishedTable],
    folder: Folder,
) -> Section:
    left_out = tuple(_left_out(test))
    problems = [test.problem] if test.problem else []
    comparisons = [_comparison(table, scoreboard, folder) for table in published if table.cells]
    figures = [
        shown
        for figure in test.result.figures
        if (shown := _attempt(problems, figure.key, lambda f=figure: _figure(test, f, folder)))  # type: ignore[misc]
    ]
    shown_tables = [
        shown
        for table in test.result.tables
        if (shown := _attempt(problems, table.key, lambda t=table: _table(test, t, folder)))  # type: ignore[misc]
    ]
    return Section(
        anchor=f"test-{place}",
        test=test,
        conditions=tuple(conditions_of(test)),
        figures=tuple(figures),
        tables=tuple(shown_tables),
        comparisons=tuple(comparisons),
        problems=(*left_out, *problems),
        left_out=left_out,
    )


def _left_out(test: AnalysedTest) -> Iterator[str]:
    """What is damaged of the test's trials, and whether that cost it the trial."""
    there = {archived.trial.name for archived in test.trials}
    for damage in test.damaged:
        is_what = "is damaged" if damage.trial in there else "is left out"
        yield f"{damage.trial or test.name} {is_what}: {damage}"


def _attempt(problems: list[str], key: str, make: Callable[[], Any]) -> Any:
    try:
        return make()
    except Exception as error:  # noqa: BLE001 (one bad figure must not cost the report)
        problems.append(f"{key} cannot be shown: {one_line(error)}")
        return None


def _figure(test: AnalysedTest, figure: Figure, folder: Folder) -> ShownFigure:
    numbers = stood_for(figure.thesis, test.reproduces, "figure ")
    return folder.figure(
        draw(figure),
        figure.title,
        figure.caption,
        figure.alt or figure.caption,
        numbers,
        *figure_name(numbers, test.name, figure.key),
    )


def _table(test: AnalysedTest, table: Table, folder: Folder) -> ShownTable:
    content, text = tables.show(table), tables.table_csv(table)
    download = folder.table(text, f"{test.name}-{table.key}")
    place = folder.next_table()
    return ShownTable(
        place,
        f"table-{place}",
        table.title,
        table.note,
        stood_for(table.thesis, test.reproduces, ""),
        content,
        download,
    )


def _comparison(table: PublishedTable, scoreboard: Scoreboard, folder: Folder) -> Comparison:
    lines = scoreboard.of_table(table.name)
    place = folder.next_table()
    return Comparison(
        number=place,
        anchor=f"table-{place}",
        heading=table.heading,
        title=table.title,
        source=table.source,
        lines=tuple(shown_line(line) for line in lines),
        download=folder.table(tables.published_csv(lines), table.slug),
    )


def conditions_of(test: AnalysedTest) -> Iterator[tuple[str, str]]:
    """Kind, bench, options that acted, and sweep, in words and display units."""
    yield "Experiment", test.kind
    if test.bench:
        yield (
            "Bench",
            test.bench.name + (f": {test.bench.description}" if test.bench.description else ""),
        )
    if test.source:
        yield "Samples from", test.source
    count = f"{len(test.trials)} executed"
    yield "Trials", count + (f", {len(test.failed)} not completed" if test.failed else "")
    points: dict[str, dict[str, Any]] = {}
    for trial in test.trials:
        for path, value in trial.trial.point.items():
            points.setdefault(path, {})[canonical_json(value)] = value
    idle = _without_effect(test)
    for path, value in test.options.items():
        if path not in points and path not in idle and value not in (None, []):
            yield _label(path), _with_unit(test, path, [value])
    for path, values in points.items():
        names = table_names(list(values.values()))
        shown = [names.get(key, value) for key, value in values.items()]
        yield f"{_label(path)} (swept)", _with_unit(test, path, shown)


def _without_effect(test: AnalysedTest) -> frozenset[str]:
    """Options that did nothing in any trial; empty where the experiment does not know them."""
    trees = [trial.trial.options for trial in test.trials] or [test.options]
    if test.experiment is None:
        return frozenset()
    try:
        found = [options_of(test.experiment, tree).without_effect() for tree in trees]
    except ValueError:  # of another version of the experiment
        return frozenset()
    return frozenset.intersection(*found)


def _label(path: str) -> str:
    return path.replace("_", " ")


def _with_unit(test: AnalysedTest, path: str, values: Sequence[Any]) -> str:
    """Values in display units; a float whose unit is not known is SI, and says so."""
    quantity = _quantity(test.experiment.options if test.experiment else None, path)
    shown = [_plain(value, quantity) for value in values]
    text = ", ".join(shown[:LISTED])
    if len(shown) > LISTED:
        text = f"{len(shown)} values from {shown[0]} to {shown[-1]}"
    if quantity and text != "–":
        return f"{text} {pretty_unit(quantity.display)}"
    known = test.experiment is not None and path in test.experiment.options.model_fields
    return text if known or not any(isinstance(v, float) for v in values) else f"{text} (SI)"


def _plain(value: Any, quantity: Quantity | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, list | tuple):
        return ", ".join(_plain(item, quantity) for item in value[:LISTED]) + (
            f" … ({len(value)})" if len(value) > LISTED else ""
        )
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value if isinstance(value, str) else canonical_json(value)[:200]
    return number(convert(value, quantity.si, quantity.display) if quantity else value, 6)


def _quantity(options: type[Options] | None, path: str) -> Quantity | None:
    info = options.model_fields.get(path) if options else None
    return next(_quantities((*info.metadata, info.annotation)), None) if info else None


def _quantities(hints: Sequence[Any]) -> Iterator[Quantity]:
    """Physical quantities in a field's metadata, or inside a list or an optional type of it."""
    for hint in hints:
        if isinstance(hint, Quantity):
            yield hint
        else:
            yield from _quantities((*getattr(hint, "__metadata__", ()), *get_args(hint)))


def anchors(sections: Sequence[Section]) -> Mapping[str, str]:
    """Test name to the anchor of its section."""
    return {section.test.name: section.anchor for section in sections}
