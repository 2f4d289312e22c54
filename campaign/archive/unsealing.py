"""From a sealed run back to the folder of a run in progress, so that it can be gone on with.

The folder is built and checked under a name that no reader takes for a run. It gets its real name
while the sealed file is still there, and counts from the moment that this is gone: at every instant
one whole run is on the disk, and it is clear which one.
"""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

import h5py

from campaign.archive import guarded, hdf5
from campaign.archive.damage import DamageList
from campaign.archive.files import (
    PART,
    publish,
    sha256_of,
    sync_folder,
    why,
    write_atomically,
)
from campaign.archive.full_plan import PLAN_TREES, PLAN_TRIALS
from campaign.archive.header import PARTIAL
from campaign.archive.journal import JOURNAL, Entry, Story, TrialFinished, parse_journal
from campaign.archive.provenance import read_provenance
from campaign.archive.run_folder import HEADER, PLAN, header_document
from campaign.archive.sample_reading import check_recordings
from campaign.archive.trial_file import earlier_entry_name, entry_name, write_root
from campaign.errors import ArchiveError
from campaign.trial import canonical_json


def unseal(sealed: Path) -> Path:
    """Replace a sealed run by its folder; returns that.

    The caller holds the run's lock. Raises ArchiveError, leaving the sealed run as it was, when it
    is damaged or the folder cannot be written.
    """
    folder = sealed.with_suffix(PARTIAL)
    part = folder.with_name(folder.name + PART)
    try:
        _remove(part)
        part.mkdir()
        _check_hash(sealed)
        _fill(sealed, part)
        _check(part)
        _remove(folder)  # a remnant: where both are found, the sealed run counts
        part.rename(folder)
        sync_folder(folder.parent)
        sealed.unlink()
    except (OSError, RuntimeError, ValueError, ArchiveError) as error:
        with contextlib.suppress(OSError):
            _remove(part)
        raise ArchiveError(
            f"{sealed}: could not be opened for going on: {why(error)}; it is as it was"
        ) from None
    sync_folder(folder.parent)
    return folder


def _remove(folder: Path) -> None:
    if folder.is_dir():
        shutil.rmtree(folder)


def _check_hash(sealed: Path) -> None:
    with guarded.open_file(sealed) as file:
        digest, place = guarded.digest_at(file, "run/outcome/file_sha256")
    if sha256_of(sealed, place) != digest:
        raise ArchiveError(f"{sealed}: does not match its own hash; it was damaged or changed")


def _fill(sealed: Path, folder: Path) -> None:
    """Write everything that the run's folder had when it was sealed."""
    with guarded.open_file(sealed) as file, guarded.guarded(sealed, "/run"):
        run = guarded.group_at(file, "run", "NXentry")
        damaged = DamageList(sealed)
        header = read_provenance(run, damaged)
        if damaged.found:
            raise ArchiveError(str(damaged.found[0]))
        texts = {
            PLAN: _note(run, "plan"),
            PLAN_TRIALS: _note(run, "plan_trials"),
            PLAN_TREES: _note(run, "plan_trees"),
            HEADER: header_document(header),
        }
        for name, text in texts.items():
            write_atomically(folder / name, text)
        story = parse_journal(sealed, _note(run, "journal").encode())
        written = {
            finished.file: _write_trial(file, entry, finished, folder)
            for finished, entry in _entries(story)
        }
    write_atomically(folder / JOURNAL, _journal(story, written))


def _note(run: h5py.Group, name: str) -> str:
    return guarded.text_at(guarded.group_at(run, name, "NXnote"), "data")


def _entries(story: Story) -> list[tuple[TrialFinished, str]]:
    """Every attempt that is kept, and its group in the sealed run."""
    last = [(finished, entry_name(number)) for number, finished in story.finished.items()]
    return last + [
        (finished, earlier_entry_name(number, finished.attempt))
        for number, attempts in story.earlier.items()
        for finished in attempts
    ]


def _write_trial(
    source: h5py.File, entry: str, finished: TrialFinished, folder: Path
) -> TrialFinished:
    """Write a trial's file; returns the journal's word of it, with the new file's hash."""
    guarded.group_at(source, entry, "NXentry")
    final = folder / finished.file
    part = final.with_name(final.name + PART)
    name = entry_name(finished.trial)
    with hdf5.closing(hdf5.create_file(part)) as file:
        hdf5.copy_entry_back(source, entry, file, name)
        write_root(file, guarded.text_at(file[name], "start_time"), file[name])
    digest, size = sha256_of(part), part.stat().st_size
    publish(part, final)
    return finished.model_copy(update={"sha256": digest, "bytes": size})


def _journal(story: Story, written: dict[str, TrialFinished]) -> str:
    """The journal as it was, but for the hashes of the trial files, which are new ones."""

    def line(entry: Entry, text: str) -> str:
        if isinstance(entry, TrialFinished):
            new = written[entry.file]
            told = entry.model_copy(update={"sha256": new.sha256, "bytes": new.bytes})
            return canonical_json(told.model_dump(mode="json"))
        return text

    lines = story.text.splitlines()
    return "".join(line(*both) + "\n" for both in zip(story.entries, lines, strict=True))


def _check(folder: Path) -> None:
    """Read every sample of the new folder against its checksum."""
    for path in sorted(folder.glob("trial-*")):
        number = int(path.stem.split("-")[1])
        problems = list(check_recordings(path, [entry_name(number)]))
        if problems:
            raise ArchiveError("; ".join(problems[:3]))
