"""The signed statement: a few lines that represent the whole run."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.seal import SealedTexts
from campaign.archive.reading.sealed_run import check_sealed
from campaign.errors import ArchiveError


def run_statement(path: Path) -> str:
    """The text that is signed for the sealed run at `path`: its name, and the digest of its seal.

    The seal covers every text and every sample, whether samples are still kept or not. The name is
    the archived one, so a signature stays valid after the file is renamed. Raises ArchiveError if
    it is not a sealed run or is unreadable.
    """
    if not path.is_file():
        raise ArchiveError(f"{path}: is not a sealed run, and only such a one is signed")
    check_sealed(path)
    damaged = DamageList(path)
    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, "/run"):
        texts = SealedTexts(path, file, damaged)
        if not texts.root:
            raise ArchiveError(f"{path}: {damaged.found[0]}")
        name = texts.text("entry_identifier")
    if name.split() != [name]:  # a name with a line break could forge lines of the statement
        raise ArchiveError(f"{path}: /run/entry_identifier: is not a run's name")
    return f"campaign-run\nrun {name}\nseal sha256 {texts.root}\n"
