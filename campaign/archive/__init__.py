"""The archive: a run in progress is a crash-safe folder; a sealed run is one file.

`RunWriter` writes, `open_run` reads, `find_run` and `list_runs` search a results folder. The
format: `docs/developers/archive-format.md`. Importing this package does not import h5py.
"""

from campaign.archive.layout.header import PlannedTrial, RunHeader, RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run, find_runs, list_runs
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.summary import RunSummary
from campaign.archive.writing.run_names import new_run_name, reserved_name
from campaign.archive.writing.writer import RunWriter

__all__ = [
    "ArchivedTrial",
    "PlannedTrial",
    "RunHeader",
    "RunReader",
    "RunStatus",
    "RunSummary",
    "RunWriter",
    "find_run",
    "find_runs",
    "list_runs",
    "new_run_name",
    "open_run",
    "reserved_name",
]
