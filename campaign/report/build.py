"""The report: page, tables and figures from an archived run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import listed
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import UsageError
from campaign.experiments.interface import Experiment
from campaign.report.content import lines
from campaign.report.content.citation import citation_of
from campaign.report.content.document import FAILED, NO_FILES, Document, document_of
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

DAMAGED = 200
"""Maximum number of listed damages on the page; `tables/damaged.csv` has all."""


@dataclass(frozen=True)
class Report:
    """A finished report.

    Attributes:
        path: path of `report.html`.
        problems: failed analyses and numbers that could not be compared, one line each.
        damaged: damage of the run that the report detected; all other data is in the report.
        layout: content of the page, for other formats.
        notice: notice of damage on the page; None without any.
        files: names of all written files in the folder.
        left_out: omitted formats of an earlier report in the folder, with the reasons.
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
    when_found: Callable[[Document], None] = lambda _: None,
    references: Files = NO_FILES,
) -> Report:
    """Write `report.html`, `report.json`, `tables/` and `figures/` of `run` into `output`.

    The same archive results in the same bytes. A template in `templates` replaces the packaged one
    of the same name. `measure_anew`: as for `analyse_run`. `formats`: further formats. `trials`:
    trials with a page of their own, from `chosen_trials`. Processes `at_work` analyse and draw with
    the installed experiments, independent of `experiments`. `zoom`: whether the page has zoom by a
    script; nothing else changes. `command`: shown command for the report; default: from the run's
    name. Formats and pages of trials of an earlier report in `output` are made again. `when_found`
    receives the document while its drawings are made. `references`: values by file.

    Raises UsageError when `output` is no report of campaign or cannot be written, when a template
    has an error, or when one of the formats fails; an older report then remains unchanged.
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
    """Write all formats; return the added files by name of the format."""
    layout, run = report.layout, report.layout.document.run
    pieces = tuple(outline(layout, report.notice)) if kinds.all else ()
    bibtex, pdfs = citation_of(run).bibtex, layout.folder.pdfs
    written = WrittenPage("report", slug(run.header.name), pieces, folder, pdfs, bibtex)
    added: dict[str, set[str]] = {}
    for each in kinds.all:
        before = _files(written.folder)
        try:
            each.write(written)
        except UsageError as error:
            if each in kinds.asked:
                raise
            kinds.leave_out(each.name, error)
            for name in _files(written.folder) - before:
                (written.folder / name).unlink()
        else:
            added[each.name] = _files(written.folder) - before
    return added


def _files(folder: Path) -> set[str]:
    """Paths within the folder of all files that are not hidden."""
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
    when_found: Callable[[Document], None] = lambda _: None,
    references: Files = NO_FILES,
) -> tuple[str, Folder, Report]:
    """Make the page's text, the other files and the report, without writing.

    `trials`: trials with a page of their own. `command`: shown command for the report.
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
        # For PDF figures, this process must draw, because it keeps the sheets.
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
