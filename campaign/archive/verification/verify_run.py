"""Verifying a run: every text against the seal, every trial against its record.

A damaged sample is reported by trial and channel. Damage in HDF5's internal structures may change
nothing readable; the hash of the file detects it, and it is reported as structure.
"""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import h5py

from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.files import PART, sha256_of
from campaign.archive.layout.journal_summary import Lines, read_lines
from campaign.archive.layout.names import ENTRY, HEADER, JOURNAL, PLAN, entry_name, entry_names
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.folder import open_folder
from campaign.archive.reading.open_run import read_sealed
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.seal import NUMBERS, OUTSIDE, SealedTexts
from campaign.archive.reading.sealed_run import NOTES, read_not_kept
from campaign.archive.verification import consistency
from campaign.archive.verification.consistency import TrialFacts
from campaign.archive.verification.entries import EntryCheck, check_entries, places
from campaign.archive.verification.result import STRUCTURE, UNREADABLE_HASH, Progress, Verification
from campaign.archive.writing.remnants import OWN_FILES
from campaign.errors import ArchiveError

_HASH = "outcome/file_sha256"
_REQUIRED = frozenset(
    [
        *("title", "entry_identifier", "start_time", "end_time", "program_name", *NUMBERS),
        *("provenance/name", "provenance/created"),
        *("outcome/status", "outcome/reason", "outcome/safe_state"),
        *(f"{note}/{name}" for note in NOTES for name in ("type", "file_name", "data")),
    ]
) - {f"not_kept/{name}" for name in ("type", "file_name", "data")}


def verify_run(path: Path, progress: Progress = lambda count: None) -> Verification:
    """Verify a sealed run or a run in progress (folder), in constant memory; never raises."""
    check = _Check(path, progress)
    with check.problems.noting(), safe_hdf5.guarded(path):
        if path.is_dir():
            check.folder()
        else:
            check.sealed()
    return Verification(
        path,
        tuple(dict.fromkeys(check.problems.found)),
        tuple(check.remarks.found),
        len(check.executed) + len(check.unreadable),
        check.datasets,
        check.root,
    )


class _Check(EntryCheck):
    """One verification of a run, with the checks of its trials."""

    def __init__(self, path: Path, progress: Progress) -> None:
        super().__init__(path)
        self.progress = progress
        self.root = ""

    def sealed(self) -> None:
        """Check a sealed file: first its content; then the hash reports remaining differences."""
        with self.problems.noting():
            self._content()
        self._hash()

    def folder(self) -> None:
        """Check the folder of a run in progress against its journal."""
        run = open_folder(self.path)
        content = self.path / JOURNAL
        story = read_lines(content.read_bytes() if content.is_file() else b"")
        if story.torn:
            self.remarks.add(JOURNAL, "has a last line that was torn by a crash and never reported")
        entries = list(entry_names(story.attempts).items())
        check_entries(self, entries, self.progress)
        named = {finished.file for finished in story.attempts}
        for file in sorted(self.path.iterdir()):
            if file.name not in named | OWN_FILES:
                kind = "was never finished" if file.suffix == PART else "is not part of the run"
                self.remarks.add(file.name, kind)
        self._agreement(run, story, HEADER, JOURNAL, PLAN)

    def _content(self) -> None:
        run = read_sealed(self.path)
        self.root = run.root
        story = read_lines(run.story.content)
        with safe_hdf5.open_file(self.path) as file:
            texts = SealedTexts(self.path, file, DamageList(self.path))
            self._texts(file, texts)
            not_kept: dict[str, str] = {}
            with self.problems.noting():
                not_kept = read_not_kept(texts)
            self._index(texts, story)
            attempts = entry_names(story.attempts)
            gone = {entry for entry in attempts if entry in not_kept and entry not in file}
            reasons: dict[str, list[str]] = {}
            for entry in sorted(gone):
                reasons.setdefault(not_kept[entry], []).append(entry)
            # The index has the record of a trial without a group; access parses it.
            for number, outline in enumerate(run.outlines):
                if entry_name(outline.number) in gone:
                    with self.problems.noting():
                        self._without_samples(run.trials[number])
            for archived in chain(*run.earlier_attempts.values()):
                if archived.entry in gone:
                    self._without_samples(archived)
            for why, entries in reasons.items():
                more = f" and {len(entries) - 1} more trials" if len(entries) > 1 else ""
                what = f"no samples of it{more} are kept: {why}; their digests are"
                self.remarks.add(f"/{entries[0]}", what)
            rest = [(entry, finished) for entry, finished in attempts.items() if entry not in gone]
            check_entries(self, rest, self.progress)
            for entry in sorted(not_kept.keys() - attempts.keys()):
                self.problems.add("/run/not_kept", f"names {entry!r}, and no such trial finished")
            for entry in sorted(not_kept.keys() & attempts.keys()):
                if entry in file:
                    what = "is there, and its samples are said not to be kept"
                    self.problems.add(f"/{entry}", what)
            for name in safe_hdf5.names(file):
                if name not in attempts and name != "run":
                    known = ENTRY.fullmatch(name) is not None
                    note = self.problems if known else self.remarks
                    what = "is there, and no line of the journal says that it finished"
                    note.add(f"/{name}", what if known else "is nothing that the format knows")
        self._agreement(run, story, "/run/provenance", "/run/journal", "/run/plan")
        self._outcome(run, story)

    def _without_samples(self, archived: ArchivedTrial) -> None:
        record, fingerprint = archived.samples.record, archived.trial.fingerprint
        facts = TrialFacts.of(f"/{archived.entry}", record, fingerprint)
        self.executed[archived.entry] = facts

    def _texts(self, file: h5py.File, texts: SealedTexts) -> None:
        """Check every text of the run against the seal."""
        if texts.seal is None:
            return  # reported when the run was opened
        bound = texts.seal.texts.keys()
        self.datasets += 1
        for place in sorted(_REQUIRED - bound):
            self.problems.add(f"/run/{place}", "is missing from the seal")
        for place in bound:
            with self.problems.noting():
                texts.check(place)
            self.datasets += 1
        for place in sorted(set(places(file, "run")) - bound - OUTSIDE):
            self.remarks.add(f"/run/{place}", "is nothing that the format knows")

    def _index(self, texts: SealedTexts, story: Lines) -> None:
        """Check that the index has exactly the records that the journal names."""
        with self.problems.noting():
            lines = {text_digest(line) for line in texts.text("index/data").splitlines()}
            records = {finished.record for finished in story.attempts}
            if lines != records:
                count = len(lines ^ records)
                self.problems.add("/run/index", f"differs from the journal in {count} records")

    def _hash(self) -> None:
        try:
            with safe_hdf5.open_file(self.path) as file, safe_hdf5.guarded(self.path):
                digest, place = safe_hdf5.digest_at(file, f"run/{_HASH}")
        except ArchiveError:
            if not self.problems.found:
                self.problems.add("", UNREADABLE_HASH)
            return
        same = sha256_of(self.path, place, self.progress) == digest
        if not same and not self.problems.found:
            self.problems.add("", STRUCTURE)

    def _agreement(
        self, run: RunReader, story: Lines, header_place: str, journal: str, plan: str
    ) -> None:
        """Check that the parts of the run agree; unreadable parts are reported once."""
        known = {damage.place for damage in self.problems.found}
        for damage in run.damaged:
            if damage.place not in known:
                self.problems.found.append(damage)
        broken = {damage.place.split(":")[0] for damage in self.problems.found}
        if not any(place.startswith(journal) for place in broken) or story.damaged:
            consistency.check_journal(story, run.header, journal, self.problems)
            consistency.check_measured(story, journal, self.problems)
            consistency.check_stages(story, run.header, journal, self.problems)
            consistency.check_trials(story, self.executed, self.unreadable, self.problems)
        if not any(place.startswith(plan) for place in broken):
            executed = self.executed.values()
            followed = len(run.plan) - len(run.first_stage)
            consistency.check_plan(run.plan, run.header, executed, plan, self.problems, followed)
            with self.problems.noting():
                consistency.check_full_plan(
                    run.full_plan, run.plan, f"{plan} in full", self.problems
                )
        if not any(place.startswith(header_place) for place in broken):
            consistency.check_protocol(run.header, header_place, self.problems)

    def _outcome(self, run: RunReader, story: Lines) -> None:
        """Check the outcome of a sealed run against its journal."""
        ended = story.ended
        if ended is None:
            if story.entries:
                self.problems.add("/run/journal", "has no line of the end of the run")
            return
        for what in ("status", "reason", "safe_state"):
            actual, expected = str(getattr(run, what)), str(getattr(ended, what))
            if actual != expected:
                problem = f"is {actual!r}, and the journal says {expected!r}"
                self.problems.add(f"/run/outcome/{what}", problem)
