"""From the folder of a run to the one file that is kept."""

from __future__ import annotations

import contextlib
import shutil
from itertools import islice
from pathlib import Path

import h5py

from campaign.archive import guarded, hdf5
from campaign.archive.damage import DamageList
from campaign.archive.files import PART, publish, sha256_of, sync_folder, why
from campaign.archive.full_plan import PLAN_TREES, PLAN_TRIALS
from campaign.archive.header import FORMAT, SEALED, RunHeader
from campaign.archive.journal import JOURNAL, RunEnded, Story, TrialFinished, read_journal
from campaign.archive.provenance import read_provenance
from campaign.archive.run_folder import (
    PLAN,
    parse_plan,
    read_header,
    read_optional,
    read_plan_text,
)
from campaign.archive.sample_reading import check_recordings
from campaign.archive.trial_file import earlier_entry_name, entry_name, write_root
from campaign.errors import ArchiveError
from campaign.trial import Outcome, canonical_json


def seal_folder(folder: Path) -> Path:
    """Make one file of a run's folder, check it, and only then remove the folder.

    The folder's journal says which trials there are. Raises ArchiveError, leaving the folder as it
    is and no file, when a trial is not what the journal says or the disk is full.
    """
    sealed = folder.with_suffix(SEALED)
    part = sealed.with_name(sealed.name + PART)
    try:
        place = _write(folder, part)
        _verify(part)
        _put_hash(part, place)
        publish(part, sealed)
    except (OSError, RuntimeError, ValueError, ArchiveError) as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise ArchiveError(
            f"{sealed}: could not be sealed: {why(error)}; every finished trial is in {folder}"
        ) from None
    with contextlib.suppress(OSError):  # a remnant does no harm: the sealed file goes first
        shutil.rmtree(folder)
        sync_folder(folder.parent)
    return sealed


def _write(folder: Path, part: Path) -> tuple[int, int]:
    """Write the file; returns where in it its hash belongs."""
    header = read_header(folder)
    story = read_journal(folder / JOURNAL)
    if story.ended is None:
        raise ArchiveError(f"{folder / JOURNAL}: the run has not ended")
    with hdf5.closing(hdf5.create_file(part)) as file:
        _write_run(file, header, story, story.ended)
        _write_plan(file["run"], folder)
        for number, finished in story.finished.items():
            _copy_trial(folder, finished, file, entry_name(number))
        for number, attempts in story.earlier.items():
            for finished in attempts:
                _copy_trial(folder, finished, file, earlier_entry_name(number, finished.attempt))
        write_root(file, header.created, _shown(file, folder, story))
        return hdf5.blank_digest(file["run/outcome"], "file_sha256")


def _put_hash(part: Path, place: tuple[int, int]) -> None:
    """Put the hash of the whole file into the file.

    It counts its own place as zeros, so it travels with the file, survives a viewer that opens the
    file for writing and changes nothing, and finds any byte that is not as it was sealed.
    """
    digest = sha256_of(part, place)
    with part.open("r+b") as file:
        file.seek(place[0])
        file.write(digest.encode("ascii"))


def _copy_trial(folder: Path, finished: TrialFinished, target: h5py.File, name: str) -> None:
    path = folder / finished.file
    if sha256_of(path) != finished.sha256:
        raise ArchiveError(f"{path}: is not what the journal says was written")
    with h5py.File(path, "r", locking=False) as source:
        hdf5.copy_entry(source, entry_name(finished.trial), target, name)


def _write_run(file: h5py.File, header: RunHeader, story: Story, ended: RunEnded) -> None:
    run = hdf5.make_group(file, "run", "NXentry")
    hdf5.put_text(run, "title", header.title or header.protocol_name or header.name)
    hdf5.put_text(run, "entry_identifier", header.name)
    hdf5.put_text(run, "start_time", header.created)
    hdf5.put_text(run, "end_time", ended.at)
    hdf5.put_text(
        run, "program_name", "campaign", version=header.versions.get("campaign", "unknown")
    )
    for number, (name, text) in enumerate(sorted(header.sources.items()), start=1):
        _note(run, f"source_{number:03d}", "application/toml", name, text)
    _note(run, "journal", "application/jsonl", JOURNAL, story.text)
    _write_provenance(run, header)
    _write_outcome(run, story, ended)


def _write_plan(run: h5py.Group, folder: Path) -> None:
    _note(run, "plan", "application/jsonl", PLAN, read_plan_text(folder))
    for name, file_name in (("plan_trials", PLAN_TRIALS), ("plan_trees", PLAN_TREES)):
        _note(run, name, "application/jsonl", file_name, read_optional(folder / file_name))


def _write_provenance(run: h5py.Group, header: RunHeader) -> None:
    """One dataset per field of the header: text as it is, everything else as canonical JSON."""
    provenance = hdf5.make_group(run, "provenance", "NXcollection")
    hdf5.put_integer(provenance, "format", FORMAT)
    for field, value in header.model_dump(mode="json", exclude={"sources"}).items():
        text = value if isinstance(value, str) else canonical_json(value)
        hdf5.put_text(provenance, field, text)


def _write_outcome(run: h5py.Group, story: Story, ended: RunEnded) -> None:
    outcome = hdf5.make_group(run, "outcome", "NXcollection")
    failed = sum(f.outcome is not Outcome.COMPLETED for f in story.finished.values())
    hdf5.put_text(outcome, "status", ended.status)
    hdf5.put_text(outcome, "reason", ended.reason)
    hdf5.put_text(outcome, "safe_state", ended.safe_state)
    hdf5.put_integer(outcome, "trials_finished", len(story.finished))
    hdf5.put_integer(outcome, "trials_failed", failed)


def _note(run: h5py.Group, name: str, kind: str, file_name: str, text: str) -> None:
    note = hdf5.make_group(run, name, "NXnote")
    hdf5.put_text(note, "type", kind)
    hdf5.put_text(note, "file_name", file_name)
    hdf5.put_text(note, "data", text)


def _shown(file: h5py.File, folder: Path, story: Story) -> h5py.Group | None:
    """What a viewer opens first: the first completed measurement, else the first with samples."""
    roles = {p.number: p.role for p in parse_plan(folder, read_plan_text(folder))}
    with_samples = [n for n in story.finished if "data" in file[entry_name(n)]]
    telling = [
        n
        for n in with_samples
        if story.finished[n].outcome is Outcome.COMPLETED and roles.get(n) == "measurement"
    ]
    best = (telling or with_samples)[:1]
    return file[entry_name(best[0])] if best else None


def _verify(part: Path) -> None:
    """Read back every dataset of the new file against its checksum."""
    with guarded.open_file(part) as file:
        damaged = DamageList(part)
        read_provenance(guarded.group_at(file, "run", "NXentry"), damaged)
        entries = [name for name in guarded.names(file) if name != "run"]
        for name in entries:
            _read_record(part, file, name)
    problems = [str(damage) for damage in damaged.found]
    problems += islice(check_recordings(part, entries), 3)
    if problems:
        raise ArchiveError("; ".join(problems[:3]))


def _read_record(part: Path, file: h5py.File, name: str) -> None:
    with guarded.guarded(part, name):
        record = guarded.group_at(guarded.group_at(file, name, "NXentry"), "record", "NXcollection")
        for text in guarded.names(record):
            guarded.text_at(record, text)
