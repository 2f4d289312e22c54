"""Reading a sealed run from its index, without opening trials."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from hashlib import sha256
from pathlib import Path

import h5py

from campaign.archive.layout.followup_trials import planned_in, stages_in
from campaign.archive.layout.full_plan import FullPlan
from campaign.archive.layout.header import PlannedTrial, RunHeader
from campaign.archive.layout.journal import RunStarted, TrialFinished
from campaign.archive.layout.journal_summary import Lines, read_lines
from campaign.archive.layout.json_lines import line_places
from campaign.archive.layout.names import RESULTS, SEALED, entry_name, entry_names, file_name
from campaign.archive.layout.packed_trial import PackedTrial
from campaign.archive.layout.record import Trees, TrialRecord, parse_trees
from campaign.archive.layout.results import ENTRY
from campaign.archive.layout.run_folder import check_format, parse_plan
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.storage import storable
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.archived_metrics import with_metrics
from campaign.archive.reading.archived_samples import RecordedSamples, archived_trial
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.lazy_trials import LazyTrials, Outline
from campaign.archive.reading.packed_trial_reader import packed_record, parse_record
from campaign.archive.reading.provenance import read_provenance
from campaign.archive.reading.run_reader import Glance, RunReader
from campaign.archive.reading.seal import SEAL, SealedTexts
from campaign.errors import ArchiveError
from campaign.gc_threshold import paused_collection
from campaign.recording import Outcome, SafeState
from campaign.trial import Tree

NOTES = ("plan", "plan_trials", "trees", "journal", "index", "not_kept")
"""The texts of `/run` that are notes, without the sources."""
IMPORT = "; `campaign import` makes one of what other programs recorded"


def read_sealed(path: Path) -> RunReader:
    """Read a sealed file of any name; samples are checked only when read."""
    check_sealed(path)
    damaged = DamageList(path)
    with (
        paused_collection(),
        safe_hdf5.held_open(path),
        safe_hdf5.open_file(path) as file,
        safe_hdf5.guarded(path, "/run"),
    ):
        texts = SealedTexts(path, file, damaged)
        header = _header(texts, damaged)
        if texts.seal is not None and texts.seal.run != header.name:
            damaged.add(f"/run/{SEAL}", f"is of the run {texts.seal.run!r}, not of {header.name!r}")
        story = read_lines(damaged.read(lambda: texts.raw("journal/data"), b""), lean=True)
        note_journal(story, damaged)
        planned: tuple[PlannedTrial, ...] = damaged.read(
            lambda: parse_plan(path, texts.text("plan/data")), ()
        )
        stages = stages_in(story.entries)
        plan = planned + planned_in(stages)
        trial_index = _Trials.read(path, texts, story, file, damaged)
        trials, earlier = trial_index.archived(plan, damaged)
        _note_contradictions(texts, header, story, len(planned), damaged)
        return RunReader(
            path=path,
            header=header,
            status=RunStatus(texts.text("outcome/status")),
            reason=texts.text("outcome/reason"),
            safe_state=SafeState(texts.text("outcome/safe_state")),
            ended=damaged.read(lambda: texts.text("end_time"), ""),
            plan=plan,
            trials=trials,
            story=story,
            full_plan=FullPlan(path, partial(_plan_texts, path), stages),
            damaged=tuple(damaged.found),
            earlier_attempts=earlier,
            root=texts.root,
            stages=stages,
        )


def read_glance(path: Path) -> Glance:
    """Read the summary of a sealed run for a listing. Raises ArchiveError."""
    check_sealed(path)
    damaged = DamageList(path)
    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, "/run"):
        texts = SealedTexts(path, file, damaged)
        header = _header(texts, damaged)
        status = RunStatus(texts.text("outcome/status"))
        interrupted = 0
        if status in (RunStatus.INTERRUPTED, RunStatus.FAULT):  # else the plan was completed
            interrupted = read_lines(texts.raw("journal/data")).interrupted
        return Glance(
            header=header,
            planned=header.trials + _followed(texts, header),
            status=status,
            ended=texts.text("end_time"),
            finished=texts.integer("outcome/trials_finished"),
            failed=texts.integer("outcome/trials_failed") - interrupted,
            interrupted=interrupted,
        )


def check_sealed(path: Path) -> None:
    """Raise ArchiveError if a file is not a sealed run in a format that this program reads."""
    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, "/run/provenance/format"):
        if ENTRY in file and "run" not in file:
            run_path = path.with_name(path.name.removesuffix(RESULTS) + SEALED)
            hint = f"; name the run, {run_path}" if run_path.is_file() else ""
            raise ArchiveError(f"{path}: holds no run but what was found in one{hint}")
        run = safe_hdf5.member(file, "run")
        provenance = safe_hdf5.member(run, "provenance") if run is not None else None
        if provenance is None:
            raise ArchiveError(f"{path}: /run: is not the archive of a run{IMPORT}")
        version = safe_hdf5.integer_at(provenance, "format")
    check_format(path, version)


def _followed(texts: SealedTexts, header: RunHeader) -> int:
    """Number of follow-up trials; the journal is read only if a test has stages."""
    if not any(test.get("stages") for test in header.tests):
        return 0
    story = read_lines(texts.raw("journal/data"))
    return len(planned_in(stages_in(story.entries)))


def _header(texts: SealedTexts, damaged: DamageList) -> RunHeader:
    names = texts.names("provenance")
    sources = dict(_sources(texts, damaged))
    return read_provenance(names, lambda name: texts.text(f"provenance/{name}"), sources, damaged)


def _plan_texts(path: Path) -> tuple[str, str]:
    damaged = DamageList(path)
    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, "/run"):
        texts = SealedTexts(path, file, damaged)
        return texts.text("plan_trials/data"), texts.text("trees/data")


def _note_contradictions(
    texts: SealedTexts, header: RunHeader, story: Lines, planned: int, damaged: DamageList
) -> None:
    """Note redundant texts that disagree: one of them was changed."""
    if damaged.found:
        return  # an unreadable text cannot be compared
    finished, ended = story.finished.values(), story.ended
    failed = sum(each.outcome is not Outcome.COMPLETED for each in finished)
    title = header.title or header.protocol_name or header.name
    expected: dict[str, str | int] = {
        "title": title,
        "entry_identifier": header.name,
        "start_time": header.created,
        "outcome/trials_finished": len(finished),
        "outcome/trials_failed": failed,
    }
    if ended is not None:
        expected |= {
            "end_time": ended.at,
            "outcome/status": ended.status,
            "outcome/reason": ended.reason,
            "outcome/safe_state": ended.safe_state,
        }
    else:
        damaged.add("/run/journal", "has no line of the end of the run")
    for place, wanted in expected.items():
        with damaged.noting():
            read = texts.integer if isinstance(wanted, int) else texts.text
            if read(place) != (wanted if isinstance(wanted, int) else storable(str(wanted))):
                damaged.add(f"/run/{place}", "is not what the rest of the run says")
    if planned != header.trials:
        damaged.add("/run/plan", f"has {planned} trials, and the header says {header.trials}")


def note_journal(story: Lines, damaged: DamageList) -> None:
    """Note damaged lines and missing parts of a sealed journal."""
    for number in story.damaged:
        damaged.add(f"/run/journal:{number}", "is not a line of a journal")
    if story.torn or not story.all(RunStarted):
        damaged.add("/run/journal", "is not a whole journal")


def _sources(texts: SealedTexts, damaged: DamageList) -> Iterator[tuple[str, str]]:
    for name in texts.notes("source_"):
        with damaged.noting():
            yield texts.text(f"{name}/file_name"), texts.text(f"{name}/data")


@dataclass(frozen=True)
class _Trials:
    """Sources of the records of a sealed run.

    The journal has the digest of every record. A record that matches is valid in either place: in
    the index, or, if the index is damaged, in the group of the trial.

    Attributes:
        story: the journal.
        names: its finished attempts, by the name of their group.
        groups: names of the top-level members of the file.
        whole: whether the index is unchanged since sealing; it can then replace journal lines.
        in_step: whether all texts are as sealed, and the index has exactly the records of the
            journal, in the order of trials.
        trees: benches and options that are readable.
        not_kept: reason why samples are absent, by entry.
    """

    path: Path
    story: Lines
    names: Mapping[str, TrialFinished]
    groups: frozenset[str]
    whole: bool
    in_step: bool
    trees: Trees
    not_kept: Mapping[str, str]

    @classmethod
    def read(
        cls, path: Path, texts: SealedTexts, story: Lines, file: h5py.File, damaged: DamageList
    ) -> _Trials:
        trees = _unchecked(texts, "trees/data")
        _is_as_sealed(texts, "trees/data", damaged)
        names = entry_names(story.attempts)
        recorded = [each.record for each in names.values()]
        # The records of a sealed journal, in its order, are the whole index: no second check.
        in_step = texts.line_digests("index/data") == recorded
        in_step = in_step and story.whole and not damaged.found
        whole = in_step or _is_as_sealed(texts, "index/data", damaged)
        not_kept: dict[str, str] = {}
        with damaged.noting(), safe_hdf5.guarded(path, "/run/not_kept"):
            not_kept = read_not_kept(texts)
        groups = frozenset(safe_hdf5.names(file))
        good = _good_trees(trees)
        return cls(path, story, names, groups, whole, in_step, good, not_kept)

    @cached_property
    def index(self) -> bytes:
        """The index, read at first use; it may be damaged."""
        with safe_hdf5.open_file(self.path) as file, safe_hdf5.guarded(self.path, "/run"):
            return _unchecked(SealedTexts(self.path, file, DamageList(self.path)), "index/data")

    @cached_property
    def lines(self) -> dict[str, slice]:
        """Places of the lines of the index, by digest."""
        index = memoryview(self.index)
        return {sha256(index[place]).hexdigest(): place for place in line_places(self.index)}

    def archived(
        self, plan: Sequence[PlannedTrial], damaged: DamageList
    ) -> tuple[LazyTrials, dict[int, tuple[ArchivedTrial, ...]]]:
        """The last attempts, and the earlier attempts by trial number; damage is noted.

        If the index is in step, outlines come from plan and journal. Otherwise each record is
        parsed once, which detects its damage, and is not kept.
        """
        outlines: list[Outline] = []
        earlier: dict[int, list[ArchivedTrial]] = {}
        names = self.names
        if self.whole and not self.in_step:
            names = self._all_names()
            unknown = len(self.lines.keys() - {each.record for each in names.values()})
            if unknown:
                damaged.add("/run/index", f"has {unknown} records that are not in the journal")
        kept = {finished.trial: finished for finished in names.values()}  # the last attempts
        planned = {each.number: each for each in plan} if self.in_step else {}
        for entry, finished in names.items():
            last = finished is kept[finished.trial]
            present = entry in self.groups or entry in self.not_kept
            if last and present and (of := planned.get(finished.trial)):
                ending = finished.outcome, finished.reason
                outlines.append(Outline(of.number, of.test, of.kind, of.label, *ending))
                continue
            with damaged.noting(), safe_hdf5.guarded(self.path, f"/{entry}"):
                archived = self._archived(entry, finished)
                if last:
                    outlines.append(Outline.of(archived))
                else:
                    earlier.setdefault(finished.trial, []).append(archived)
        before = {number: tuple(tries) for number, tries in earlier.items()}
        return LazyTrials(outlines, partial(self._again, kept)), before

    def _again(self, kept: Mapping[int, TrialFinished], number: int) -> ArchivedTrial:
        entry = entry_name(number)
        with safe_hdf5.guarded(self.path, f"/{entry}"):
            return self._archived(entry, kept[number])

    def _all_names(self) -> Mapping[str, TrialFinished]:
        """`names`, with attempts of the index in place of lost lines of the journal."""
        if self.story.whole:
            return self.names
        attempts = {(each.trial, each.attempt): each for each in self.story.attempts}
        for digest in self.lines.keys() - {each.record for each in attempts.values()}:
            line = self.index[self.lines[digest]]
            finished = _as_finished(parse_record(self.path, "/run/index", line))
            attempts.setdefault((finished.trial, finished.attempt), finished)
        return entry_names(attempts.values())

    def _archived(self, entry: str, finished: TrialFinished) -> ArchivedTrial:
        """A trial; record and trees come from its own group if the index lacks them."""
        trees: Trees = self.trees
        if (place := self.lines.get(finished.record)) is not None:
            record = parse_record(self.path, f"/{entry}", self.index[place])
            check_identity(self.path, entry, record, finished)
        if place is None or not record.tree_names <= trees.keys():
            with safe_hdf5.open_file(self.path) as file:
                record, trees = read_entry(self.path, file, entry, finished)
        # Samples that are present are checked against the record, even if listed as not kept.
        not_kept = "" if entry in self.groups else self.not_kept.get(entry, "")
        if entry not in self.groups and not not_kept:
            raise ArchiveError(
                f"{self.path}: /{entry}: is missing, and the journal says that it finished"
            )
        archived = archived_trial(RecordedSamples(self.path, entry, record, not_kept), trees)
        return with_metrics(archived, self.story.measured_of(finished.record))


def _as_finished(record: TrialRecord) -> TrialFinished:
    """A lost line of the journal, rebuilt from the index; file hash and size are unknown."""
    return TrialFinished(
        at=record.ended,
        trial=record.number,
        attempt=record.attempt,
        file=file_name(record.number, record.attempt),
        sha256="0" * 64,
        record=record.sha256,
        bytes=0,
        outcome=record.outcome,
        reason=record.reason,
        safe_state=record.safe_state,
    )


def check_identity(path: Path, entry: str, record: TrialRecord, finished: TrialFinished) -> None:
    """Raise ArchiveError if a record is not of the trial and attempt that the journal names."""
    if (record.number, record.attempt) != (finished.trial, finished.attempt):
        raise ArchiveError(f"{path}: /{entry}: is not the trial that the journal names")


def read_entry(
    path: Path, file: h5py.File, name: str, finished: TrialFinished
) -> tuple[TrialRecord, Trees]:
    """Record and trees from the group of a trial. Raises ArchiveError."""
    with safe_hdf5.guarded(path, f"/{name}"):
        entry = safe_hdf5.inner_group(file, name)
        kept = safe_hdf5.inner_group(entry, "record")
        record, trees = (safe_hdf5.unchecked_text_at(kept, text) for text in ("json", "trees"))
        parsed = packed_record(path, name, PackedTrial(record=record, trees=trees), finished.record)
        check_identity(path, name, parsed[0], finished)
        return parsed


def read_not_kept(texts: SealedTexts) -> dict[str, str]:
    """Reason why samples are absent, by entry; empty if all are present."""
    if "not_kept" not in texts.notes("not_kept"):
        return {}
    tree = json.loads(texts.text("not_kept/data"))
    return {str(entry): str(reason) for entry, reason in tree.items()}


def _good_trees(raw: bytes) -> Trees:
    """The trees of undamaged lines; damaged lines are skipped, so trials may lack a tree."""
    trees: dict[str, Tree] = {}
    for line in raw.decode("utf-8", "replace").splitlines():
        try:
            trees |= parse_trees(line)
        except ValueError:
            continue
    return trees


def _unchecked(texts: SealedTexts, place: str) -> bytes:
    """A text that may be damaged; empty if it cannot be read."""
    try:
        return texts.unchecked(place)
    except ArchiveError:
        return b""


def _is_as_sealed(texts: SealedTexts, place: str, damaged: DamageList) -> bool:
    """Whether a text is as sealed; damage is noted."""
    known = len(damaged.found)
    with damaged.noting():
        texts.check(place)
    return len(damaged.found) == known
