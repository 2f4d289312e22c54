"""Friction experiments on stabilized servo platforms: run, archive, identify, report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from campaign.errors import ArchiveWarning

if TYPE_CHECKING:
    from os import PathLike

    from campaign.api import RunView

__version__ = "0.2.0"
__all__ = ["ArchiveWarning", "__version__", "open"]


def open(  # noqa: A001 (it is `campaign.open`, as there are `gzip.open` and `h5py.File`)
    run: str | PathLike[str] | None = None,
    results: str | PathLike[str] = "results",
    *,
    strict: bool = False,
    measure_anew: bool = False,
) -> RunView:
    """Open an archived run; samples are read only when they are asked for.

    Args:
        run: a path, a run's name, or a unique beginning of it; absent: the newest.
        results: the folder in which names are looked up.
        strict: whether damage that need not keep the rest from being used is an error all the
            same; else it is an `ArchiveWarning`, here and where an analysis leaves a trial out.
        measure_anew: whether analyses measure the recordings anew, by this program, and leave aside
            what was measured and archived when they were executed.

    Raises UsageError when there is no such run, ArchiveError when it cannot be read; both are
    `campaign.errors.CampaignError`.
    """
    from campaign.api import open_view

    return open_view(run, results, strict=strict, measure_anew=measure_anew)
