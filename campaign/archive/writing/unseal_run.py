"""Conversion of a sealed run back to a folder, so that the run can continue.

The folder is built and checked under a name that readers ignore. It gets its final name while the
sealed file still exists, and is valid from the removal of that file. So at every instant exactly
one valid and complete run is on the disk.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path

from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.files import (
    PART,
    keep_umask,
    publish,
    sync_folder,
    why,
    write_atomically,
    write_lines_atomically,
)
from campaign.archive.layout.journal import TrialFinished
from campaign.archive.layout.names import (
    HEADER,
    JOURNAL,
    PARTIAL,
    PLAN,
    PLAN_TREES,
    PLAN_TRIALS,
    entry_names,
    file_name,
)
from campaign.archive.layout.packed_trial import PackedTrial
from campaign.archive.layout.record import Trees, TrialRecord, parse_trees, trees_text
from campaign.archive.layout.run_folder import header_document
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.folder import read_trial_file
from campaign.archive.reading.packed_trial_reader import packed_entry
from campaign.archive.reading.seal import SealedTexts
from campaign.archive.reading.sealed_run import read_not_kept, read_sealed
from campaign.archive.writing.packed_file import copy_packed
from campaign.archive.writing.remnants import remove_folder, take_over
from campaign.errors import ArchiveError
from campaign.trial import canonical_json


def unseal(sealed: Path) -> Path:
    """Replace a sealed run by its folder; return the folder.

    The caller holds the run's lock. Raises ArchiveError if the run is damaged or the folder cannot
    be written; the sealed run then stays unchanged.
    """
    folder = sealed.with_suffix(PARTIAL)
    part = folder.with_name(folder.name + PART)
    try:
        with safe_hdf5.open_file(sealed) as file:
            safe_hdf5.check_file_hash(file, "run/outcome/file_sha256")
        if part.is_dir() and remove_folder(part):
            raise ArchiveError(f"{part}: holds files that are not the program's; move them away")
        keep_umask()
        part.mkdir()
        _fill(sealed, part)
        if folder.is_dir():  # a remnant: if both exist, the sealed run is valid
            take_over(folder, part)
            remove_folder(folder)
        part.rename(folder)
        sync_folder(folder.parent)
        sealed.unlink()
    except (OSError, RuntimeError, ValueError, ArchiveError) as error:
        with contextlib.suppress(OSError):
            remove_folder(part)
        raise ArchiveError(
            f"{sealed}: could not be opened for going on: {why(error)}; it is as it was"
        ) from None
    sync_folder(folder.parent)
    return folder


def _fill(sealed: Path, folder: Path) -> None:
    """Write the content of the run's folder from before sealing."""
    run = read_sealed(sealed)
    if run.damaged:
        raise ArchiveError(str(run.damaged[0]))
    with safe_hdf5.open_file(sealed) as file, safe_hdf5.guarded(sealed, "/run"):
        texts = SealedTexts(sealed, file, DamageList(sealed))
        notes = {PLAN: "plan", PLAN_TRIALS: "plan_trials", PLAN_TREES: "trees"}
        for name, note in notes.items():
            write_atomically(folder / name, texts.text(f"{note}/data"))
        write_atomically(folder / HEADER, header_document(run.header))
        lines = {text_digest(line): line for line in texts.text("index/data").splitlines()}
        trees = parse_trees(texts.text("trees/data"))
        not_kept = read_not_kept(texts)
        written = {}
        for entry, finished in entry_names(run.story.attempts).items():
            if entry in not_kept:
                packed = _without_samples(lines[finished.record], trees, not_kept[entry])
            else:
                packed = packed_entry(sealed, entry)
            name = file_name(finished.trial, finished.attempt)  # older programs: another suffix
            written[finished.file] = _write(folder, sealed, packed, finished, name)
    write_lines_atomically(folder / JOURNAL, _journal(run.journal, written))


def _without_samples(line: str, trees: Trees, not_kept: str) -> PackedTrial:
    """A trial whose samples were not kept: it has no group in the sealed run."""
    record = TrialRecord.model_validate_json(line)
    own = {name: trees[name] for name in record.tree_names}
    return PackedTrial(record=line, trees=trees_text(own), not_kept=not_kept)


def _write(
    folder: Path, sealed: Path, packed: PackedTrial, finished: TrialFinished, name: str
) -> TrialFinished:
    """Write a trial's file and read it back; return its updated line of the journal."""
    part = folder / (name + PART)
    digest, size = copy_packed(sealed, packed, part)
    problems = list(read_trial_file(part, finished).problems())
    if problems:
        raise ArchiveError("; ".join(problems[:3]))
    publish(part, folder / name)
    return finished.model_copy(update={"file": name, "sha256": digest, "bytes": size})


def _journal(text: str, written: dict[str, TrialFinished]) -> Iterator[str]:
    """The lines of the journal, with the new names, hashes and sizes of the trial files."""
    for line in text.splitlines():
        entry = json.loads(line)
        if entry["event"] == "trial finished":
            new = written[entry["file"]]
            entry |= {"file": new.file, "sha256": new.sha256, "bytes": new.bytes}
            line = canonical_json(entry)
        yield line + "\n"
