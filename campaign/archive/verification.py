"""Verifying a run: whether it is, to the last byte, what was written."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.damage import Damage
from campaign.archive.verification_result import Progress, Verification
from campaign.errors import ArchiveError


def verify_run(path: Path, progress: Progress = lambda count: None) -> Verification:
    """Verify a sealed run or the folder of a run in progress, in flat memory; never raises
    for what is in it.
    """
    from campaign.archive.opening import sealed_format
    from campaign.archive.run_folder import read_format

    try:
        version = read_format(path) if path.is_dir() else sealed_format(path)
    except ArchiveError as error:
        return Verification(path, (Damage.of(path, error),), (), 0, 0)
    if version <= 2:
        from campaign.archive.format_2.verification import verify
    else:
        from campaign.archive.checking import verify
    return verify(path, progress)
