"""Existence of the published cells that a bench refers to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from campaign.errors import Problem, UsageError
from campaign.physics.bench_knowledge import KnownOptions
from campaign.protocol.files import Origin, UnreadableError, looked_for, read_text
from campaign.protocol.problems import shown
from campaign.published.patterns import covers
from campaign.published.values import THESIS, Published, read_published, thesis
from campaign.text import nearest


def cell_problems(
    known: KnownOptions,
    origin: Origin,
    folder: Path,
    *,
    must_be_there: bool = False,
) -> Iterator[Problem]:
    """A problem for each pattern that covers no cell of the document that the bench names.

    Patterns of a bench without a document cannot be checked: no problem. A missing document is no
    problem either if the bench is only used: a bench may be copied without it.

    Args:
        folder: of the bench's file.
        must_be_there: whether a missing document is a problem, too.
    """
    if not known.document:
        return
    try:
        published = _published(known.document, folder)
    except UnreadableError as error:
        if must_be_there:
            message = f"{shown(known.document)}: {error} {looked_for(folder / known.document)}"
            yield origin.problem(("known", "document"), "value", message)
        return
    except UsageError as error:
        yield origin.problem(("known", "document"), "value", str(error))
        return
    paths = [cell.path for table in published.values() for cell in table.cells]
    for name in ("given", "fitted", "seen"):
        for index, pattern in enumerate(getattr(known, name)):
            if not any(covers(pattern, path) for path in paths):
                message = f"{shown(pattern)} is no cell of {shown(known.document)}"
                table = [path for path in paths if path.startswith(f"{pattern.split('/')[0]}/")]
                names = table or [*published, *paths]
                message += nearest(pattern, names)
                yield origin.problem(("known", name, index), "value", message)


def _published(document: str, folder: Path) -> Published:
    """The cells for a comparison with the document.

    A laboratory's own file is added to the thesis, as in a report. Raises UsageError if it is
    invalid, UnreadableError if it is missing.
    """
    if document == THESIS:
        return thesis()
    return {**thesis(), **read_published(read_text(folder / document), document)}
