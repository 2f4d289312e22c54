"""The report: page, tables and figures from an archived run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from campaign.archive import RunReader
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import listed
from campaign.errors import UsageError
from campaign.experiments.interface import Experiment
from campaign.report.content import lines
from campaign.report.content.citation import citation_of
from campaign.report.content.document import NO_FILES, Document, document_of
from campaign.report.content.references import Files
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.pdf import also_as_pdf, keeps_pdf
from campaign.report.formats.as_json import report_json
from campaign.report.formats.interface import Format, WrittenPage
from campaign.report.formats.outline import outline
from campaign.report.output import replaced_folder, write_files
from campaign.report.page.damage_notice import Notice, notice_on_page
from campaign.report.page.drawings import Drawable, Key
from campaign.report.page.folder import Folder
from campaign.report.page.interactive import interactive
from campaign.report.page.layout import Layout, draw_on_demand, lay_out
from campaign.report.page.names import slug, trial_links
from campaign.report.page.policy import policy
from campaign.report.page.templates import Templates
from campaign.report.page.trial_page import trial_pages
from campaign.report.palette import variables
from campaign.report.previous_report import Formats, all_formats, made_before, remember
from campaign.report.processes import Workers

FAILED = 200
"""Most failed trials that are listed; the archive has them all."""
DAMAGED = 200
"""Most damage that is listed on the page; `tables/damaged.csv` has all."""


def _nothing(_: Document) -> None:
    """Nobody wants to know."""


@dataclass(frozen=True)
class Report:
    """A finished report.

    Attributes:
        path: of `report.html`.
        problems: analyses that failed and numbers that could not be compared, one line each.
        damaged: what of the run is damaged, as far as the report looked at it; all else is there.
        layout: what the page shows, for other formats.
        notice: what the page says of the damage; None without any.
        files: names of all that was written, within the folder.
        left_out: what an earlier report in the folder had and this one could not make, and why.
    """

    path: Path
    problems: tuple[str, ...]
    damaged: tuple[Damage, ...]
    layout: Layout = field(repr=False)
    notice: Notice | None
    files: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def build_report(
    run: RunReader,
    output: Path,
    *,
    experiments: Mapping[str, Experiment],
    packaged_templates: Path,
    templates: Path | None = None,
    measure_anew: bool = False,
    at_work: Workers | None = None,
    formats: Sequence[Format] = (),
    trials: Sequence[int] = (),
    zoom: bool = False,
    command: str = "",
    when_found: Callable[[Document], None] = _nothing,
    references: Files = NO_FILES,
) -> Report:
    """Write `report.html`, `report.json`, `tables/` and `figures/` of `run` into `output`.

    The same archive gives the same bytes. A template in `templates` wins over the packaged one of
    the same name. `measure_anew`: as for `analyse_run`. `formats`: what is written besides.
    `trials`: those that get a page of their own, as `chosen_trials` has them. Processes that are
    `at_work` analyse and draw with the experiments that are installed, whatever `experiments` are.
    `zoom`: the page's lines can be zoomed into by who has scripts; nothing else is different.
    `command`: what the page says to type for the report; made from the run's name when empty.
    Formats and trials' pages that an earlier report of the run left in `output` are made anew.
    `when_found` is told what was found while the drawings of it are made. `references`: files of
    reference values, with what is in them.

    Raises UsageError when `output` is no report of ours or cannot be written, when a template is
    wrong, or when one of the formats cannot be made; an older report is then left as it was.
    """
    before = made_before(output, run)
    kinds = all_formats(formats, before)
    trials = sorted({*trials, *before.trials})
    with also_as_pdf() if any(each.pdf_figures for each in kinds.all) else nullcontext():
        html, folder, report = render(
            run,
            output,
            experiments,
            packaged_templates,
            templates,
            measure_anew,
            trials=trials,
            at_work=at_work,
            zoom=zoom,
            command=command,
            when_found=when_found,
            references=references,
        )
    own_pages = trial_pages(report.layout, trials, Templates(packaged_templates, templates))
    pages = {"report.html": html, "report.json": report_json(report.layout), **folder.files}
    with replaced_folder(output) as new:
        write_files(new, chain(pages.items(), own_pages))
        added = _write_formats(kinds, report, new)
        files = _files(new)
        remember(new, run, added, trials)
    return replace(report, files=tuple(sorted(files)), left_out=tuple(kinds.left_out))


def _write_formats(kinds: Formats, report: Report, folder: Path) -> dict[str, set[str]]:
    """The files that each format has added, by its name."""
    layout, run = report.layout, report.layout.document.run
    pieces = tuple(outline(layout, report.notice)) if kinds.all else ()
    bibtex, pdfs = citation_of(run).bibtex, layout.folder.pdfs
    written = WrittenPage("report", slug(run.header.name), pieces, folder, pdfs, bibtex)
    added: dict[str, set[str]] = {}
    for each in kinds.all:
        there = _files(written.folder)
        try:
            each.write(written)
        except UsageError as error:
            if each in kinds.asked:
                raise
            kinds.leave_out(each.name, error)
            for name in _files(written.folder) - there:
                (written.folder / name).unlink()
        else:
            added[each.name] = _files(written.folder) - there
    return added


def _files(folder: Path) -> set[str]:
    """Names of all but hidden files."""
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".")
    }


def render(
    run: RunReader,
    output: Path,
    experiments: Mapping[str, Experiment],
    packaged_templates: Path,
    templates: Path | None = None,
    measure_anew: bool = False,
    *,
    trials: Sequence[int] = (),
    at_work: Workers | None = None,
    zoom: bool = False,
    command: str = "",
    when_found: Callable[[Document], None] = _nothing,
    references: Files = NO_FILES,
) -> tuple[str, Folder, Report]:
    """The page's text, the other files, and what there is to say of them; nothing is written.

    `trials`: those that will have a page of their own. `command`: what to type for the report.
    """
    from markupsafe import Markup

    filled = Templates(packaged_templates, templates)
    at_work = at_work or Workers(run, measure_anew=measure_anew)
    document = document_of(
        run,
        experiments,
        measure_anew=measure_anew,
        found=at_work.found,
        shown=trials,
        files=references,
    )

    def begin_to_draw(drawings: Mapping[Key, Drawable]) -> Callable[[Key], DrawingFiles | None]:
        # Sheets are kept as PDF where they are drawn.
        begun = draw_on_demand(drawings) if keeps_pdf() else at_work.draw(drawings)
        when_found(document)
        return begun

    layout = lay_out(document, begin_to_draw, command)
    damage = listed(document.damaged, DAMAGED)
    notice = notice_on_page(run, document.damaged, layout.folder) if document.damaged else None
    added = interactive(layout.figures) if zoom else None
    script = (packaged_templates / "report.js").read_text(encoding="utf-8").strip()
    script += f"\n{added.script}" if added else ""
    context = {
        "document": document,
        "layout": layout,
        "run": run,
        "header": run.header,
        "citation": citation_of(run),
        "colours": variables(),
        "interactive": added,
        "script": Markup(script),  # noqa: S704 (packaged)
        "policy": policy(script),
        "agreement": lines.agreement(document.scoreboard),
        "scoreboard": [lines.shown_line(line) for line in document.scoreboard.lines],
        "statuses": lines.statuses(document.scoreboard),
        "answers": {answer.test: answer for answer in document.opening.answers},
        "anchors": {section.test.name: section.anchor for section in layout.sections},
        "failed": document.failed[:FAILED],
        "contradictions": lines.contradictions(document.scoreboard),
        "problems": (*(f"damaged: {line}" for line in damage), *layout.problems),
        "damage": notice,
        "trial_link": trial_links(trials),
    }
    html = filled.fill("report.html", context)
    page = output / "report.html"
    report = Report(page, layout.problems, document.damaged, layout, notice)
    return html, layout.folder, report
