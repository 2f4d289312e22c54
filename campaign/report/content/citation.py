"""Citation of a run: a sentence and a bibliography entry."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from campaign.api.analysis import run_title
from campaign.archive.reading.run_reader import RunReader
from campaign.report.latex_text import latex

MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
"""Month macros of bibliography styles."""


@dataclass(frozen=True)
class Citation:
    """Citation of a run in a paper.

    Attributes:
        sentence: entry for a list of references in plain text.
        bibtex: an entry for BibTeX and biblatex, under the run's name.
    """

    sentence: str
    bibtex: str


def citation_of(run: RunReader) -> Citation:
    """Citation with title, operator, day, program, and the SHA-256 of the archive.

    The program is the one that executed the run. A run in progress has no archive yet; its citation
    says so and has the SHA-256 of the current journal.
    """
    header = run.header
    title = run_title(run)
    day = datetime.fromisoformat(header.created).date()
    program = " ".join(("campaign", header.versions.get("campaign", ""))).strip()
    state = "archive" if run.sealed else "in progress, journal"
    identifier = f"{state} SHA-256 {run.sha256}"
    by = f"{header.operator}: " if header.operator else ""
    fields = {
        "author": _whole(header.operator),
        "title": _whole(title),
        "year": f"{{{day.year:04d}}}",
        "month": MONTHS[day.month - 1],
        "howpublished": f"{{{_field(f'Run {header.name}, {program}')}}}",
        "note": f"{{{_field(identifier)}}}",
    }
    lines = [f"  {name} = {value},\n" for name, value in fields.items() if value != "{{}}"]
    return Citation(
        f"{by}{title}. Run {header.name} of {day.isoformat()}, {program}, {identifier}.",
        f"@misc{{{header.name},\n{''.join(lines)}}}\n",
    )


def _whole(text: str) -> str:
    """A field that keeps its letter case and is not split into several names."""
    return f"{{{{{_field(text)}}}}}"


def _field(text: str) -> str:
    """Text within a field, without escaped braces, because BibTeX counts them."""
    return latex(text).replace(r"\{", r"\textbraceleft{}").replace(r"\}", r"\textbraceright{}")
