"""Content of the page as an ordered list of pieces, for formats without templates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from campaign.published.values import heading_of
from campaign.report.content import lines
from campaign.report.content.citation import citation_of
from campaign.report.content.document import FAILED, Document
from campaign.report.content.first_screen import Answer
from campaign.report.content.lines import ShownLine
from campaign.report.page.damage_notice import Notice
from campaign.report.page.folder import FOUND, Comparison, Section, ShownFigure
from campaign.report.page.layout import Layout
from campaign.report.page.pieces import Facts, Grid, Heading, Items, Paragraph, Piece, Source


def outline(layout: Layout, damage: Notice | None) -> Iterator[Piece]:
    """Pieces of the whole page, without the protocol's text and content for screens only."""
    document = layout.document
    header = document.run.header
    yield Heading(1, document.title)
    if damage is not None:
        missing = "What cannot be read is missing from this report; tables/damaged.csv lists it."
        yield Paragraph(f"{damage.heading}. {missing}", role="warning")
    if header.description:
        yield Paragraph(header.description)
    yield Facts(tuple(_facts(document)))
    if layout.problems:
        yield Heading(2, "Problems with this report")
        yield Items(layout.problems)
    yield from _opening(layout)
    if layout.scoreboard_download is not None:
        yield Heading(2, "Scoreboard", "scoreboard")
        yield Paragraph(lines.agreement(document.scoreboard))
        yield from (shown for shown in (layout.picture, layout.strips) if shown is not None)
        if layout.closeness is not None:
            yield layout.closeness
        yield Paragraph(f"Every published number is in {layout.scoreboard_download.file}.")
    answers = {answer.test: answer for answer in document.opening.answers}
    for section in layout.sections:
        yield from _section(section, answers[section.test.name], layout.telling)
    yield from _contradictions(document)
    yield from _failed(document)
    if document.incidents:
        yield Heading(2, "What happened besides the plan", "incidents")
        yield from layout.incident_figures
        yield from (layout.incident_tables)
    yield from _provenance(document)


def _facts(document: Document) -> Iterator[tuple[str, str]]:
    run = document.run
    counts = [
        f"{len(run.trials)} executed",
        *_counted(len(document.failed), "not completed"),
        *_counted(document.lost, "not readable"),
        *_counted(document.not_executed, "not executed"),
    ]
    yield "Run", run.header.name
    yield "Started", run.header.created
    yield "Status", f"{run.status}{f': {run.reason}' if run.reason else ''}"
    yield "Trials", ", ".join(counts)
    yield "Backend", run.header.backend or "not stated"
    if run.header.operator:
        yield "Operator", run.header.operator


def _counted(count: int, what: str) -> list[str]:
    return [f"{count} {what}"] if count else []


def _opening(layout: Layout) -> Iterator[Piece]:
    """Quality of the run, its key numbers with all remarks, and the leading figure."""
    opening = layout.document.opening
    yield Heading(2, "Findings", "opening")
    yield from (Paragraph(why, role="warning") for why in opening.wrong)
    if opening.compared:
        yield Paragraph(opening.compared)
    if opening.held:
        yield Paragraph(f"{opening.held} of the simulated bench.")
    if any(answer.numbers for answer in opening.shown):
        yield key_numbers(opening.shown)
    yield from (
        Facts(((answer.title, _problem(answer)),)) for answer in opening.shown if answer.problem
    )
    yield from map(Paragraph, filter(None, (*opening.remarks, opening.intervals, opening.asked)))
    if layout.telling is not None:
        yield layout.telling


def _problem(answer: Answer) -> str:
    return f"No result: {answer.problem}." if answer.problem else ""


def key_numbers(answers: Sequence[Answer]) -> Grid:
    """Key numbers of tests as a table, without empty columns."""
    rows = tuple(
        (
            answer.title,
            each.quantity,
            ", ".join(filter(None, (each.where, answer.where))),
            each.value,
            f"{each.published} ✓" if each.agrees else each.published,
            each.true,
        )
        for answer in answers
        for each in answer.numbers
    )
    headers = ("Test", "Quantity", "Where", "Found", "Published", "True")
    several = len(answers) > 1
    kept = [n for n in range(len(headers)) if any(row[n] for row in rows) and (n or several)]
    return Grid(
        None,
        "key-numbers",
        "Key numbers.",
        tuple(headers[n] for n in kept),
        tuple(headers[n] in ("Found", "Published", "True") for n in kept),
        tuple(tuple(row[n] for n in kept) for row in rows),
    )


def _answer(answer: Answer, with_truth: bool) -> Iterator[str]:
    """Sentences on a test; `with_truth`: whether its true values are shown."""
    if answer.problem:
        yield _problem(answer)
    if with_truth and answer.truth:
        yield f"{answer.truth}."
    yield from (f"{each}." for each in (answer.prediction, *answer.references) if each)


def _section(section: Section, answer: Answer, telling: ShownFigure | None) -> Iterator[Piece]:
    """Pieces of a test in the order of the page's numbers; `telling` is already shown."""
    yield Heading(2, section.test.title, section.anchor)
    if section.test.description:
        yield Paragraph(section.test.description)
    yield from (Paragraph(problem, role="warning") for problem in section.problems)
    if answer.numbers:
        yield key_numbers([answer])
    if text := " ".join(_answer(answer, section.truth is not None)):
        yield Paragraph(text)
    yield Heading(3, "Conditions")
    yield Facts(section.conditions)
    yield from map(_compared, section.comparisons)
    if section.truth is not None:
        yield (section.truth)
    if section.prediction is not None:
        yield (section.prediction)
    yield from (section.references)
    for figure in section.figures:
        if figure is telling:
            text = f"Figure {figure.number}, {figure.title}, is at the top of the report."
            yield Paragraph(text)
        else:
            yield figure
    yield from (section.tables)
    if notes := (*answer.remarks, *section.test.result.notes):
        yield Heading(3, "Notes")
        yield Items(notes)


def _compared(shown: Comparison) -> Grid:
    remarks: dict[str, list[str]] = {}
    for line in shown.lines:
        for note in line.notes:
            remarks.setdefault(note, []).append(line.name)
    return Grid(
        shown.number,
        shown.anchor,
        f"Published {shown.heading} and what was reproduced. {shown.title}.",
        shown.heads,
        tuple(head.startswith((*FOUND, "Deviation")) for head in shown.heads),
        tuple(_line(line, () if shown.unit else (line.unit,)) for line in shown.lines),
        tuple(f"{', '.join(cells)}: {remark}." for remark, cells in remarks.items()),
        shown.download.file,
    )


def _line(line: ShownLine, unit: tuple[str, ...]) -> tuple[str, ...]:
    number = f"{line.reproduced} ({line.place})" if line.place else line.reproduced
    verdict = f"{line.verdict} ✓" if line.good else line.verdict
    share = line.deviation.removesuffix(" %")
    return line.name, *unit, line.published, number, share, verdict, line.status


def _contradictions(document: Document) -> Iterator[Piece]:
    groups = lines.contradictions(document.scoreboard)
    if groups:
        yield Heading(2, "Where the source contradicts itself", "contradictions")
        yield Paragraph(
            "These published numbers cannot all be right, so no deviation from them counts for or"
            " against this run."
        )
        yield Facts(
            tuple(
                (f"{heading_of(table)}: {', '.join(cells)}", reason)
                for table, cells, reason in groups
            )
        )


def _failed(document: Document) -> Iterator[Piece]:
    failed = document.failed
    if failed:
        yield Heading(2, "Trials that did not complete", "failed")
        yield Grid(
            None,
            "failed-trials",
            "Trials that did not complete.",
            ("Trial", "What", "Outcome", "Reason", "Safe state"),
            (True, False, False, False, False),
            tuple(
                (
                    str(each.trial.number),
                    each.trial.label,
                    str(each.ending.outcome),
                    each.ending.reason,
                    str(each.ending.safe_state),
                )
                for each in failed[:FAILED]
            ),
            tuple(_counted(max(0, len(failed) - FAILED), "more are in the archive.")),
        )


def _provenance(document: Document) -> Iterator[Piece]:
    run, header, citation = document.run, document.run.header, citation_of(document.run)
    yield Heading(2, "Provenance", "provenance")
    yield Paragraph("This report was made from the archive alone.")
    facts = {
        "Archive SHA-256": run.sha256,
        "Protocol fingerprint": header.fingerprint or "not stated",
        "Repeat it with": document.command,
        "Protocol's revision": header.git_revision,
        "Seeds": document.seeds or "none",
        "Safe state at the end": str(run.safe_state),
        "Each recording measured by": document.measured_by,
        "Tags": ", ".join(header.tags),
        "Notes": header.notes,
        "Published values from": "; ".join(document.sources),
        "Versions": ", ".join(f"{name} {version}" for name, version in header.versions.items()),
    }
    yield Facts(tuple((name, value) for name, value in facts.items() if value))
    yield Heading(3, "How to cite this run", "cite")
    yield Paragraph(citation.sentence)
    yield Source("As a BibTeX entry", citation.bibtex, "bibtex")
