"""`index.html` of a results folder: every run, searchable."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from html import unescape
from pathlib import Path
from urllib.parse import quote

from campaign.archive.layout.names import PARTIAL
from campaign.archive.reading.run_list import list_runs
from campaign.archive.reading.summary import RunSummary
from campaign.errors import UsageError
from campaign.plain_text import on_a_page
from campaign.report.index.report_summary import summary_of_report
from campaign.report.output import MARKER, replace_file
from campaign.report.page.policy import hashed
from campaign.report.page.templates import Templates
from campaign.report.palette import variables

NAME = "index.html"
OURS = '<meta name="generator" content="campaign index">'
"""Mark of an index of campaign near its beginning."""
BEGINNING = 4096
"""Number of bytes that are searched for it."""
COMPARISON = "comparison.html"


@dataclass(frozen=True)
class Entry:
    """One run on the page.

    Attributes:
        state: status as one word, or `damaged`; used for the CSS class.
        verdict: sentences of the report, then the outcome of the trials.
        link: relative address of its report; empty without one.
        thumbnail: address or `data:` address of a picture; `caption` is its title.
        problem: reason why the run cannot be read.
    """

    name: str
    status: str
    state: str
    title: str = ""
    when: str = ""
    tests: tuple[str, ...] = ()
    benches: tuple[str, ...] = ()
    verdict: tuple[str, ...] = ()
    backend: str = ""
    operator: str = ""
    tags: tuple[str, ...] = ()
    link: str = ""
    thumbnail: str = ""
    caption: str = ""
    problem: str = ""


def write_index(results: Path, packaged_templates: Path) -> Path:
    """Write `index.html` into a results folder and return its path.

    The same folder results in the same bytes. Only headers, journals and the data of reports are
    read; nothing is analysed. Raises UsageError when an `index.html` that is not from campaign
    exists, or when the folder cannot be read or written.
    """
    path = results / NAME
    _refuse_foreign(path)
    text = on_a_page(render(results, packaged_templates))
    try:
        replace_file(path, text.encode())
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def render(results: Path, packaged_templates: Path) -> str:
    """Text of the page, without writing."""
    from markupsafe import Markup

    entries = [entry_of(run) for run in reversed(list_runs(results))]
    colours = {"colours": variables()}
    templates = Templates(packaged_templates, None)
    style = templates.fill("style.css", colours) + templates.fill("index.css", {})
    script = (packaged_templates / "index.js").read_text(encoding="utf-8")
    context = {
        "generator": Markup(OURS),  # noqa: S704 (packaged)
        "entries": entries,
        "damaged": [entry for entry in entries if entry.problem],
        "partial": [entry for entry in entries if entry.state == "incomplete"],
        "comparisons": tuple(_comparisons(results)),
        "style": Markup(style),  # noqa: S704 (packaged)
        "script": Markup(script),  # noqa: S704 (packaged)
        "style_hash": hashed(style),
        "script_hash": hashed(script),
    }
    return templates.fill("index.html", context)


def entry_of(run: RunSummary) -> Entry:
    """Entry of a run."""
    folder = run.path.with_name(f"{run.path.stem}-report")
    report = summary_of_report(folder)
    link = _address(report.page, run.path.parent) if report.page else ""
    thumbnail = f"data:image/svg+xml,{quote(report.sketch)}" if report.sketch else ""
    if report.figure:
        thumbnail = _address(report.figure, run.path.parent)
    if run.problem:
        problem = run.problem.replace(str(run.path.parent) + os.sep, "")
        return Entry(
            name=run.name,
            status="damaged",
            state="damaged",
            link=link,
            thumbnail=thumbnail,
            caption=report.caption,
            problem=problem,
        )
    return Entry(
        name=run.name,
        title=run.title or run.protocol or run.name,
        when=f"{datetime.fromisoformat(run.created):%Y-%m-%d %H:%M}",
        tests=run.tests,
        benches=run.benches,
        status=_status(run),
        state=str(run.status or "").replace(" ", "-"),
        verdict=tuple(filter(None, (report.numbers, report.headline, _trials(run)))),
        backend=run.backend,
        operator=run.operator,
        tags=run.tags,
        link=link,
        thumbnail=thumbnail,
        caption=report.caption,
    )


def _status(run: RunSummary) -> str:
    """The status; `not sealed` marks a folder, of a run in progress or killed."""
    word = str(run.status or "unknown")
    return f"{word} (not sealed)" if run.path.suffix == PARTIAL else word


def _trials(run: RunSummary) -> str:
    """Sentence such as `18 of 20 trials completed, 1 failed, 1 not executed.`"""
    completed = run.trials - run.failed - run.interrupted
    parts = [f"{completed} of {run.planned} trials completed"]
    if run.failed:
        parts.append(f"{run.failed} failed")
    if run.interrupted:
        parts.append(f"{run.interrupted} interrupted")
    if run.untold:
        they = "it was" if run.untold == 1 else "they were"
        parts.append(f"of {run.untold} the journal does not say any more whether {they} executed")
    elif run.planned > run.trials:
        parts.append(f"{run.planned - run.trials} not executed")
    return ", ".join(parts) + "."


def _comparisons(results: Path) -> Iterator[tuple[str, str]]:
    """Title and address of each comparison in the folder."""
    for folder in sorted(results.iterdir()):
        page = folder / COMPARISON
        if page.is_file() and (folder / MARKER).is_file():
            yield _title(page) or folder.name.removesuffix("-comparison"), _address(page, results)


def _title(page: Path) -> str:
    """Title of a page from its beginning; "" without one."""
    try:
        with page.open("rb") as file:
            beginning = file.read(BEGINNING).decode("utf-8", "replace")
    except OSError:
        return ""
    match = re.search(r"<title>([^<]{1,400})</title>", beginning)
    return unescape(match[1]).strip() if match else ""


def _address(path: Path, base: Path) -> str:
    """Relative address, with all special characters escaped."""
    relative = path.relative_to(base).as_posix()
    return "./" + quote(os.fsencode(relative))


def _refuse_foreign(path: Path) -> None:
    if not (path.exists() or path.is_symlink()):
        return
    try:
        with path.open("rb") as file:
            ours = OURS.encode() in file.read(BEGINNING)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    if not ours:
        raise UsageError(f"{path} is there already and was not written by campaign; move it away")
