"""What a signature of a sealed run is made over: a few lines that stand for all of it."""

from __future__ import annotations

from pathlib import Path

from campaign.archive import guarded
from campaign.archive.files import sha256_of, why
from campaign.errors import ArchiveError


def run_statement(path: Path) -> str:
    """The text that is signed for the sealed run at `path`: its name and the hash of every byte.

    The hash is what `sha256sum` prints, not `/run/outcome/file_sha256`, which leaves its own place
    out. The name is the archived one, so that a signature goes with a file that was renamed.
    Raises ArchiveError when it is no sealed run or cannot be read.
    """
    if not path.is_file():
        raise ArchiveError(f"{path}: is not a sealed run, and only such a one is signed")
    with guarded.open_file(path) as file, guarded.guarded(path, "/run/entry_identifier"):
        name = guarded.text_at(guarded.group_at(file, "run", "NXentry"), "entry_identifier")
    if name.split() != [name]:  # it must not write lines of its own
        raise ArchiveError(f"{path}: /run/entry_identifier: is not a run's name")
    try:
        digest = sha256_of(path)
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {why(error)}") from None
    return f"campaign-run\nrun {name}\nfile sha256 {digest}\n"
