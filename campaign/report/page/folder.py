"""Numbered items of the page, and its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

from campaign.api.analysis import AnalysedTest
from campaign.plain_text import on_a_page
from campaign.report.content import tables
from campaign.report.content.lines import ShownLine
from campaign.report.drawing.canvas import inline
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.pdf import taken
from campaign.report.page.names import Names
from campaign.report.palette import Look
from campaign.result import Figure, Table
from campaign.text import of_trials

FOUND = ("Published", "Reproduced")
LINKED = 6_000
"""Maximum length of a CSV file within the page (characters), which delays its display.

A longer one is only a file beside the page.
"""


@dataclass(frozen=True)
class Download:
    """A CSV file: its name in the folder, and the target of the page's link."""

    file: str
    href: str


@dataclass(frozen=True)
class ShownFigure:
    """A figure on the page.

    Attributes:
        svg: safe markup.
        data: drawn figure; None for a picture that is not from an analysis.
        download: its numbers; None as for `data`.
        trials: trials of the shown recordings, as text; may be empty.
        command: command that draws it again.
        box: width and height of the drawing in its own units.
        least: minimum width for a legible smallest label (CSS pixels).
        looks: looks of its series on this page; None without a drawing of its own.
        trial_numbers: `trials` as numbers.
    """

    form: ClassVar = "figure"
    number: int
    anchor: str
    title: str
    caption: str
    svg: str
    file: str
    published: tuple[str, ...] = ()
    data: Figure | None = None
    download: Download | None = None
    trials: str = ""
    command: str = ""
    box: tuple[float, float] = (1.0, 1.0)
    least: int = 0
    looks: Mapping[str, Look] | None = None
    trial_numbers: tuple[int, ...] = ()


@dataclass(frozen=True)
class ShownTable:
    """A numbered table of a test.

    `stacked`: on a small screen, each row is a block.
    """

    form: ClassVar = "table"
    number: int
    anchor: str
    title: str
    note: str
    published: tuple[str, ...]
    content: tables.ShownTable
    download: Download
    data: Table | None = None
    stacked: bool = False


@dataclass(frozen=True)
class Comparison:
    """A published table beside the reproduced numbers; `table` is its published name."""

    number: int
    anchor: str
    table: str
    heading: str
    title: str
    source: str
    lines: tuple[ShownLine, ...]
    download: Download

    @property
    def unit(self) -> str:
        """Common unit of all numbers, for the headings; "" without one."""
        units = {line.unit for line in self.lines}
        return units.pop() if len(units) == 1 else ""

    @property
    def heads(self) -> tuple[str, ...]:
        """Headings of the columns; a common unit replaces the unit column."""
        heads = [f"{head} ({self.unit})" if self.unit else head for head in FOUND]
        units = () if self.unit else ("Unit",)
        return ("Cell", *units, *heads, "Deviation (%)", "Verdict", "Status")


@dataclass(frozen=True)
class Section:
    """One test on the page.

    Attributes:
        figures: pictures of changes against references, then those of its analysis.
        left_out: those of the `problems` that are damaged trials.
        truth: findings beside true values, if known.
        prediction: findings beside the values of the bench file, if tested.
        references: findings beside files of reference values.
        summary: conditions in one line.
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
    prediction: ShownTable | None = None
    references: tuple[ShownTable, ...] = ()
    summary: str = ""

    @property
    def items(self) -> tuple[ShownFigure | ShownTable | Comparison, ...]:
        """Its figures and tables in the order of the page."""
        held = [each for each in (self.truth, self.prediction, *self.references) if each]
        return (*self.comparisons, *held, *self.figures, *self.tables)


@dataclass
class Folder:
    """Content of the report's folder, collected during the layout of the page.

    `pdfs`: figures as PDF, for formats that need them; not for the page.
    """

    files: dict[str, str] = field(default_factory=dict)
    pdfs: dict[str, bytes] = field(default_factory=dict)
    table_names: Names = field(default_factory=Names)
    figure_names: Names = field(default_factory=Names)
    figures: int = 0
    tables: int = 0

    def table(self, text: str, *candidates: str) -> Download:
        """Add a CSV file; return its download."""
        return self._csv(f"tables/{self.table_names.unique(*candidates)}.csv", on_a_page(text))

    def _csv(self, file: str, text: str) -> Download:
        self.files[file] = text
        return Download(file, tables.data_link(text) if len(text) <= LINKED else file)

    def figure(
        self,
        figure: Figure,
        drawn: DrawingFiles,
        published: tuple[str, ...],
        *names: str,
        trials: tuple[int, ...] = (),
        command: str = "",
        looks: Mapping[str, Look] | None = None,
    ) -> ShownFigure:
        """Add an SVG file, and a CSV file of its numbers; return the numbered figure."""
        alt = figure.alt or figure.caption
        shown = self.picture(drawn, figure.title, figure.caption, alt, *names, command=command)
        return replace(
            shown,
            published=published,
            data=figure,
            trials=of_trials(trials),
            trial_numbers=trials,
            download=self._csv(shown.file.removesuffix(".svg") + ".csv", drawn.csv),
            looks=looks,
        )

    def picture(
        self,
        drawn: DrawingFiles,
        title: str,
        caption: str,
        alt: str,
        *names: str,
        command: str = "",
    ) -> ShownFigure:
        """Add an SVG file of a picture that is not from an analysis; return the numbered figure."""
        from markupsafe import Markup

        name = self.figure_names.unique(*names)
        file = f"figures/{name}.svg"
        self.files[file] = drawn.svg
        pdf = taken()
        if pdf is not None:
            self.pdfs[f"figures/{name}.pdf"] = pdf
        self.figures += 1
        anchor = f"figure-{self.figures}"
        markup = Markup(inline(drawn.svg, anchor, title, alt))  # noqa: S704 (`inline` escapes texts)
        return ShownFigure(
            self.figures,
            anchor,
            title,
            caption,
            markup,
            file,
            command=command,
            box=drawn.box,
            least=drawn.least,
        )

    def shown_table(
        self, table: Table, published: tuple[str, ...], *names: str, page: Table | None = None
    ) -> ShownTable:
        """Add a CSV file; return its numbered table. `page`: the table in the page's units.

        The file has the column names of the analysis.
        """
        content = tables.show(page or table)
        download = self.table(tables.table_csv(table), *names)
        place = self.next_table()
        return ShownTable(
            place, f"table-{place}", table.title, table.note, published, content, download, table
        )

    def next_table(self) -> int:
        self.tables += 1
        return self.tables
