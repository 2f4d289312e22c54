"""Keeping results of a report as data beside the run: `RUN-results.nxs`."""

from __future__ import annotations

from campaign.api.results import results_of
from campaign.archive import RunReader
from campaign.archive.layout.results import results_path
from campaign.archive.reading.results_file import OtherLayoutError, read_any_results
from campaign.archive.writing.results_file import PreparedResults, prepare_results
from campaign.cli.output import print_note
from campaign.errors import ArchiveError, UsageError
from campaign.report.content.document import Document


def written_results(
    run: RunReader, document: Document, *, measured_anew: bool
) -> PreparedResults | None:
    """Write them, to be published when the report is there; None where there is a warning instead.

    A folder that nobody may write in, or something else in their place, costs the file and not the
    report; a report that fails leaves older results as they were.

    Of a damaged run, results that were found when it was whole are kept: they can be had no more.
    """
    if document.damaged and _found_when_whole(run):
        print_note(
            f"{results_path(run.path)}: kept as it is: it was made when the run was not damaged",
            style="yellow",
        )
        return None
    found = results_of(
        run,
        document.tests,
        document.scoreboard,
        telling=document.opening.telling,
        measured_anew=measured_anew,
    )
    try:
        return prepare_results(run.path, found)
    except (ArchiveError, UsageError) as error:
        print_note(f"no file of results: {error}", style="yellow")
        return None


def _found_when_whole(run: RunReader) -> bool:
    """Whether sound results of this run, from before it was damaged, are beside it.

    A damaged run may not say its root any more; then its name has to do.
    """
    try:
        kept = read_any_results(results_path(run.path))
    except OtherLayoutError:
        return True
    except ArchiveError:
        return False
    same = kept.root == run.root if run.root else kept.run == run.name
    return same and not kept.damaged
