"""Reading a sealed run of format 1 or 2."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import h5py

from campaign.archive.layout.full_plan import FullPlan
from campaign.archive.layout.header import RunHeader, RunStatus
from campaign.archive.layout.journal import RunStarted
from campaign.archive.layout.run_folder import parse_plan
from campaign.archive.layout.story import Lines, read_lines
from campaign.archive.reading import guarded
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.format_2.attempts import read_earlier
from campaign.archive.reading.format_2.trials import read_trials
from campaign.archive.reading.provenance import read_provenance
from campaign.archive.reading.run_reader import Glance, RunReader, interrupted_trials
from campaign.recording import SafeState


def read_sealed(path: Path) -> RunReader:
    """A sealed file, whatever its name; its hash is not looked at (`RunReader.unchanged`)."""
    damaged = DamageList(path)
    with guarded.open_file(path) as file, guarded.guarded(path, "/run"):
        run = guarded.group_at(file, "run", "NXentry")
        header = read_header(run, damaged)
        outcome = guarded.group_at(run, "outcome", "NXcollection")
        story = read_lines(damaged.read(lambda: _note(path, run, "journal"), "").encode())
        trials = tuple(read_trials(path, file, damaged))
        _note_lines(story, damaged)
        _note_missing(story, trials, damaged)
        return RunReader(
            path=path,
            header=header,
            status=RunStatus(guarded.text_at(outcome, "status")),
            reason=guarded.text_at(outcome, "reason"),
            safe_state=SafeState(guarded.text_at(outcome, "safe_state")),
            ended=damaged.read(lambda: _end(path, run), ""),
            plan=damaged.read(lambda: parse_plan(path, _note(path, run, "plan")), ()),
            trials=trials,
            journal=story.text,
            full_plan=FullPlan(path, partial(_plan_texts, path)),
            earlier_attempts=read_earlier(path, damaged),
            damaged=tuple(damaged.found),
        )


def read_glance(path: Path) -> Glance:
    """What a listing tells of it."""
    with guarded.open_file(path) as file, guarded.guarded(path, "/run"):
        run = guarded.group_at(file, "run", "NXentry")
        outcome = guarded.group_at(run, "outcome", "NXcollection")
        header = read_header(run, DamageList(path))
        status = RunStatus(guarded.text_at(outcome, "status"))
        interrupted = interrupted_trials(status, lambda: _note(path, run, "journal"))
        return Glance(
            header=header,
            planned=header.trials,
            status=status,
            ended=guarded.text_at(run, "end_time"),
            finished=guarded.integer_at(outcome, "trials_finished"),
            failed=guarded.integer_at(outcome, "trials_failed") - interrupted,
            interrupted=interrupted,
        )


def read_header(run: h5py.Group, damaged: DamageList) -> RunHeader:
    """What was known before the first trial; what of it is damaged is noted."""
    provenance = guarded.group_at(run, "provenance", "NXcollection")
    sources = dict(_sources(run, damaged))
    names = guarded.names(provenance)
    return read_provenance(names, lambda name: guarded.text_at(provenance, name), sources, damaged)


def _plan_texts(path: Path) -> tuple[str, str]:
    with guarded.open_file(path) as file, guarded.guarded(path, "/run"):
        run = guarded.group_at(file, "run", "NXentry")
        trials, trees = (
            _note(path, run, name) if name in run else "" for name in ("plan_trials", "plan_trees")
        )
        return trials, trees


def _sources(run: h5py.Group, damaged: DamageList) -> Iterator[tuple[str, str]]:
    for name in guarded.names(run):
        if name.startswith("source_"):
            with damaged.noting(), guarded.guarded(damaged.path, f"/run/{name}"):
                note = guarded.group_at(run, name, "NXnote")
                yield guarded.text_at(note, "file_name"), guarded.text_at(note, "data")


def _end(path: Path, run: h5py.Group) -> str:
    with guarded.guarded(path, "/run/end_time"):
        return guarded.text_at(run, "end_time")


def _note(path: Path, run: h5py.Group, name: str) -> str:
    """What a note says."""
    with guarded.guarded(path, f"/run/{name}"):
        return guarded.text_at(guarded.group_at(run, name, "NXnote"), "data")


def _note_lines(story: Lines, damaged: DamageList) -> None:
    for number in story.damaged:
        damaged.add(f"/run/journal:{number}", "is not a line of a journal")
    if story.torn or not story.all(RunStarted):
        damaged.add("/run/journal", "is not a whole journal")


def _note_missing(story: Lines, trials: tuple[ArchivedTrial, ...], damaged: DamageList) -> None:
    """A trial that finished has a group; one that was found damaged is not told of twice."""
    there = {trial.trial.name for trial in trials} | {d.trial for d in damaged.found}
    for number in story.finished:
        if f"trial-{number:05d}" not in there:
            damaged.add(f"/trial_{number:05d}", "is missing, and the journal says that it finished")
