"""Results of a report as data beside the run: `RUN-results.nxs`."""

from __future__ import annotations

from campaign.api.results import results_of
from campaign.archive.layout.names import results_path
from campaign.archive.reading.results_file import OtherLayoutError, read_any_results
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.results_file import PreparedResults, prepare_results
from campaign.cli.output import print_warning
from campaign.errors import ArchiveError, UsageError
from campaign.report.content.document import Document


def written_results(
    run: RunReader, document: Document, *, measured_anew: bool
) -> PreparedResults | None:
    """Prepare the results file, to be published with the report; None after a warning.

    A read-only folder or another file at this path prevents the results file, not the report. If
    the report fails, older results stay.

    Results from before a run was damaged are kept, as they cannot be repeated.
    """
    if document.damaged and _found_when_whole(run):
        print_warning(
            f"{results_path(run.path)}: not changed: it was made before the run was damaged"
        )
        return None
    results = results_of(
        run,
        document.tests,
        document.scoreboard,
        telling=document.opening.telling,
        measured_anew=measured_anew,
    )
    try:
        return prepare_results(run.path, results)
    except (ArchiveError, UsageError) as error:
        print_warning(f"no results file: {error}")
        return None


def _found_when_whole(run: RunReader) -> bool:
    """Whether there are sound results of this run from before it was damaged.

    If a damaged run has lost its root, its name identifies it.
    """
    try:
        kept = read_any_results(results_path(run.path))
    except OtherLayoutError:
        return True
    except ArchiveError:
        return False
    same = kept.root == run.root if run.root else kept.run == run.name
    return same and not kept.damaged
