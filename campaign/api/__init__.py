"""Archives in Python: `campaign.open(...)` returns a run with its tests and trials.

Tables are pandas objects, samples pandas or xarray objects. Samples are read on request only.
Examples: `docs/reading-archives.md`.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from campaign.api.damage_warnings import report_damage
from campaign.api.results import Results
from campaign.api.run import RunView
from campaign.api.test import TestView
from campaign.api.trial import TrialView
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run

__all__ = ["Results", "RunView", "TestView", "TrialView", "open_view"]


def open_view(
    run: str | PathLike[str] | None = None,
    results: str | PathLike[str] = "results",
    *,
    strict: bool = False,
    measure_anew: bool = False,
) -> RunView:
    """Open an archived run; an ArchiveWarning reports its damage.

    Args:
        run: path, name, or unique beginning of a name; absent: the newest run.
        results: folder of the named runs.
        strict: whether any damage is an error.
        measure_anew: whether the program measures the recordings again and ignores archived
            metrics.

    Raises UsageError when there is no such run, ArchiveError when it cannot be read.
    """
    name = None if run is None else str(run)
    view = RunView(open_run(find_run(Path(results), name)), strict, measure_anew)
    report_damage(view.path, view.damaged, strict=strict)
    return view
