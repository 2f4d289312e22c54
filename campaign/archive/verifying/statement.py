"""What a signature of a sealed run is made over: a few lines that stand for all of it."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.layout.files import sha256_of, why
from campaign.archive.reading import guarded
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.opening import sealed_format
from campaign.archive.reading.seal import SealedTexts
from campaign.errors import ArchiveError


def run_statement(path: Path) -> str:
    """The text that is signed for the sealed run at `path`: its name, and the digest of its seal.

    The seal stands for every text and every sample, whether those are still kept or not. Archives
    of formats 1 and 2 have none: there the digest is that of every byte, as `sha256sum` prints it,
    and not `/run/outcome/file_sha256`, which leaves its own place out. The name is the archived
    one, so that a signature goes with a file that was renamed. Raises ArchiveError when it is no
    sealed run or cannot be read.
    """
    if not path.is_file():
        raise ArchiveError(f"{path}: is not a sealed run, and only such a one is signed")
    name, what = _sealed(path) if sealed_format(path) > 2 else _before_seals(path)
    if name.split() != [name]:  # it must not write lines of its own
        raise ArchiveError(f"{path}: /run/entry_identifier: is not a run's name")
    return f"campaign-run\nrun {name}\n{what}\n"


def _sealed(path: Path) -> tuple[str, str]:
    damaged = DamageList(path)
    with guarded.open_file(path) as file, guarded.guarded(path, "/run"):
        texts = SealedTexts(path, file, damaged)
        if not texts.root:
            raise ArchiveError(f"{path}: {damaged.found[0]}")
        return texts.text("entry_identifier"), f"seal sha256 {texts.root}"


def _before_seals(path: Path) -> tuple[str, str]:
    with guarded.open_file(path) as file, guarded.guarded(path, "/run/entry_identifier"):
        name = guarded.text_at(guarded.group_at(file, "run", "NXentry"), "entry_identifier")
    try:
        return name, f"file sha256 {sha256_of(path)}"
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {why(error)}") from None
