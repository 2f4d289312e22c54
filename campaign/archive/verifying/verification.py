"""Verifying a run: whether it is, to the last byte, what was written."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.verifying.result import Progress, Verification
from campaign.errors import ArchiveError


def verify_run(path: Path, progress: Progress = lambda count: None) -> Verification:
    """Verify a sealed run or the folder of a run in progress, in flat memory; never raises
    for what is in it.
    """
    from campaign.archive.layout.run_folder import read_format
    from campaign.archive.reading.opening import sealed_format

    try:
        version = read_format(path) if path.is_dir() else sealed_format(path)
    except ArchiveError as error:
        return Verification(path, (Damage.of(path, error),), (), 0, 0)
    if version <= 2:
        from campaign.archive.verifying.format_2 import verify
    else:
        from campaign.archive.verifying.checking import verify
    return verify(path, progress)
