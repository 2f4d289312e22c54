"""Archives in Python: `campaign.open(...)` gives a run, its tests and its trials, lazily.

What is asked for comes as pandas and xarray objects; samples are read when they are asked for, and
not before. `docs/reading-archives.md` shows it.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from campaign.api.damage_warnings import tell
from campaign.api.results import Results
from campaign.api.run import RunView
from campaign.api.test import TestView
from campaign.api.trial import TrialView
from campaign.archive import find_run, open_run

__all__ = ["Results", "RunView", "TestView", "TrialView", "open_view"]


def open_view(
    run: str | PathLike[str] | None = None,
    results: str | PathLike[str] = "results",
    *,
    strict: bool = False,
    measure_anew: bool = False,
) -> RunView:
    """Open an archived run; an ArchiveWarning says what of it is damaged.

    Args:
        run: a path, a run's name, or a unique beginning of it; absent: the newest.
        results: the folder in which names are looked up.
        strict: whether any damage is an error.
        measure_anew: whether recordings are measured by this program, and not as they were when
            they were executed.

    Raises UsageError when there is no such run, ArchiveError when it cannot be read.
    """
    name = None if run is None else str(run)
    view = RunView(open_run(find_run(Path(results), name)), strict, measure_anew)
    tell(view.path, view.damaged, strict=strict)
    return view
