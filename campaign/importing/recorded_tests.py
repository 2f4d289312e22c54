"""A protocol of imported recordings in place of planned trials."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import JsonValue

from campaign.errors import Problem, ProtocolError
from campaign.estimate import Window
from campaign.importing.derived_channels import RigFacts, sufficient
from campaign.importing.description import RecordingDescription
from campaign.importing.interface import RecordingError
from campaign.importing.mapped_trials import describe
from campaign.importing.mapping import Layout, MappingError, RecordingEntry, layouts, recordings_of
from campaign.importing.open_files import OpenedFiles
from campaign.importing.reader import RecordingReader
from campaign.importing.trial_rows import Stretch
from campaign.physics.bench import Bench
from campaign.protocol.files import Origin, Within
from campaign.protocol.problems import allowed, shown
from campaign.protocol.schema import ExperimentKind, Protocol, Test
from campaign.text import nearest
from campaign.trial import OfferedRecording, Task, TrialRequest
from campaign.units import to_si

ROUNDING = 1e-9
_FILE = re.compile(r"^.*?(?=(:\d+:\d+)?: )")
"""The file at the start of a message, without row and column."""
NO_RECORDING = (
    "it has no recordings; add [[test.recording]] for each, or `campaign run` executes it"
)

OUTSIDE = (
    "leads out of the mapping's folder, and a pattern stays below it; name such a file by its path"
)


@contextmanager
def with_recordings(protocol: Protocol) -> Iterator[Protocol]:
    """The protocol with the trials of its recordings; the files stay open within the block.

    Raises ProtocolError at the end of the block, with all problems of the mapping, of the files
    and of the plan of the valid recordings.
    """
    problems: list[Problem] = []
    known = layouts(protocol.columns, protocol.origin, problems)
    with ExitStack() as stack:
        loader = _Loader(protocol, known, problems, stack)
        tests = tuple(loader.test(test) for test in protocol.tests)
        try:
            yield replace(protocol, tests=tests)
        except ProtocolError as error:
            problems += error.problems
        if problems:
            raise ProtocolError(_once(problems))


def _once(problems: Sequence[Problem]) -> list[Problem]:
    """Problems sorted by place; those that differ only in the file are reported once."""
    groups: dict[tuple[Path, int, int, str], list[Problem]] = {}
    for each in sorted(problems, key=lambda each: (str(each.file), each.line, each.column)):
        tail = _FILE.sub("", each.message)
        groups.setdefault((each.file, each.line, each.column, tail), []).append(each)
    return [
        first if not more else replace(first, message=f"{first.message} ({len(more)} more alike)")
        for first, *more in groups.values()
    ]


def _of_file(what: Problem, at: Origin, paths: Sequence[Path], entry: RecordingEntry) -> Problem:
    """A problem of a file, placed at the file's name in the mapping."""
    several = not isinstance(entry.file, str) and what.file in paths
    keys = ("file", paths.index(what.file)) if several else ("file",)
    return at.problem(keys, "value", str(what))


@dataclass(frozen=True)
class TestRecording:
    """One recording of a test: its entry in the mapping, its description and its open files."""

    entry: RecordingEntry
    described: RecordingDescription
    stretch: Stretch
    opened: OpenedFiles


@dataclass
class _Loader:
    """Loader of recordings; appends to `problems`, registers open files with `stack`."""

    protocol: Protocol
    layouts: Mapping[str, Layout]
    problems: list[Problem]
    stack: ExitStack

    def test(self, test: Test) -> Test:
        origin = test.origin
        if not test.entry.recording:
            message = f"{shown(test.entry.name)}: {NO_RECORDING}"
            self.problems.append(origin.problem((), "key", message))
        options = {"matrix": test.axes, "repeat": test.entry.repeat > 1, "truth": test.truth}
        for key in (key for key, value in options.items() if value):
            message = f"a test with recordings has no {key!r}: each recording says what it is"
            self.problems.append(origin.problem((key,), "key", message))
        entries = recordings_of(
            test.entry.recording, origin, self.problems, test.experiment.windows
        )
        rig = RigFacts.of(Bench.model_validate(test.bench))
        recordings = [
            each
            for index, entry in entries
            for each in self._found(test, Within(origin, ("recording", index)), entry, rig)
        ]
        return replace(test, experiment=_kind(test.experiment, recordings))

    def _found(
        self, test: Test, at: Origin, entry: RecordingEntry, rig: RigFacts
    ) -> list[TestRecording]:
        layout, folder = self._layout(at, entry), self.protocol.path.parent
        wanted = {*test.experiment.requires, *test.experiment.can_use}
        recordings: list[TestRecording] = []
        for written in self._files(at, entry):
            paths = [folder / each for each in written]
            try:
                if layout is None:  # report the problems of its files without a layout, too
                    OpenedFiles(paths)
                    continue
                opened, trials = describe(entry, layout, paths, written, rig, wanted)
            except RecordingError as error:
                self.problems += (_of_file(each, at, paths, entry) for each in error.problems)
                continue
            except MappingError as error:
                every = (error, *error.others)
                self.problems += (self._placed(at, entry, each) for each in every)
                continue
            self.stack.enter_context(opened)
            recordings += (TestRecording(entry, *both, opened) for both in trials)
        return recordings

    def _placed(self, at: Origin, entry: RecordingEntry, error: MappingError) -> Problem:
        if not error.of_columns:
            return at.problem(error.keys, "value", str(error))
        name = entry.columns or next(iter(self.layouts))
        keys = ("columns", name, *error.keys[1:])
        return self.protocol.origin.problem(keys, "key", str(error))

    def _layout(self, at: Origin, entry: RecordingEntry) -> Layout | None:
        names = list(self.protocol.columns)
        name = entry.columns or (names[0] if len(names) == 1 else "")
        if not names or not name:
            nothing = "nothing says what its columns are; add [columns.NAME] tables"
            which = f"say by which 'columns' it is read; {allowed(names)}"
            self.problems.append(at.problem(("file",), "key", which if names else nothing))
        elif name not in names:
            message = f"there is no [columns.{name}]; {allowed(names)}{nearest(name, names)}"
            self.problems.append(at.problem(("columns",), "value", message))
        return self.layouts.get(name)

    def _files(self, at: Origin, entry: RecordingEntry) -> list[list[str]]:
        if not isinstance(entry.file, str):
            return [list(entry.file)]
        if not any(sign in entry.file for sign in "*?["):
            return [[entry.file]]
        try:
            return [[each] for each in _matching(self.protocol.path.parent, entry.file)]
        except ValueError as error:
            message = f"{shown(entry.file)}: {error}"
            self.problems.append(at.problem(("file",), "value", message))
            return []


def _matching(folder: Path, pattern: str) -> list[str]:
    """Files below `folder` that match the pattern, sorted; never searches outside it.

    Raises ValueError if the pattern leads out of the folder or matches no file.
    """
    parts = Path(pattern).parts
    if Path(pattern).anchor or ".." in parts:
        raise ValueError(f"a pattern {OUTSIDE}")
    root, matches = folder.resolve(), [""]
    for part in parts:
        matches = [
            os.path.join(base, name)  # noqa: PTH118 - as written, with no dot before it
            for base in matches
            for name in glob.glob(part, root_dir=folder / base)  # noqa: PTH207 - names alone
        ]
        for each in matches:
            if not Path(os.path.realpath(folder / each)).is_relative_to(root):
                raise ValueError(f"the link {shown(each)} {OUTSIDE}")
    if not matches:
        raise ValueError(f"no file of that name (looked in {folder})")
    return sorted(matches)


def _kind(experiment: ExperimentKind, found: Sequence[TestRecording]) -> ExperimentKind:
    planned = any(each.entry.trial is not None for each in found)

    def trials(options: Any, bench: Bench) -> Iterator[TrialRequest]:
        requests = list(experiment.trials(options, bench)) if planned else []
        wrong = []
        for each in found:
            try:
                if each.entry.trial is not None:
                    yield _planned(each, requests)
                else:
                    yield from _offered(each, experiment, options, bench)
            except ValueError as error:
                wrong.append(str(error))
        if wrong:
            raise ValueError("; ".join(wrong))

    # Executed trials have no stages and no warnings; only planned ones need fitted options.
    return replace(
        experiment,
        trials=trials,
        fit=experiment.fit if planned else None,
        warnings=None,
        recorded=None,
        windows=(),
        stages=(),
        seeks_instability=False,
    )


def _planned(found: TestRecording, asked: Sequence[TrialRequest]) -> TrialRequest:
    """The planned trial of a recording. Raises ValueError for a wrong number or a short file."""
    number, record = found.entry.trial or 0, found.described
    if number > len(asked):
        raise ValueError(f"{record.label}: there is no trial {number}; {len(asked)} are planned")
    request = asked[number - 1]
    task, duration = request.task, record.samples / record.sample_rate
    short = duration < task.duration * (1.0 - ROUNDING) - 1.5 / record.sample_rate
    if short and task.stop_rate is None:
        raise ValueError(
            f"{record.label}: it lasts {duration:.6g} s, and trial {number} {task.duration:.6g} s"
        )
    count = min(record.samples, round(task.duration * record.sample_rate))
    record = record.model_copy(update={"samples": count})
    return _served(found, request, record, {**request.point, **_conditions(found)})


def _offered(
    found: TestRecording, experiment: ExperimentKind, options: Any, bench: Bench
) -> Iterator[TrialRequest]:
    """The trials in a recording without a planned trial; ValueError for a window outside it."""
    record = found.described
    duration = record.samples / record.sample_rate
    windows = tuple(Window(name, *ends) for name, ends in found.entry.windows.items())
    for window in windows:
        if not 0 <= window.start < window.stop <= duration * (1.0 + ROUNDING):
            raise ValueError(
                f"{record.label}: the window {window.name!r}, {window.start:g} to {window.stop:g} "
                f"s, is no part of its {duration:.6g} s"
            )
    conditions = _conditions(found)
    whole = TrialRequest(
        Task(
            mode="recorded",
            duration=duration,
            window=(windows[0].start, windows[0].stop) if windows else (0.0, duration),
            sample_rate=record.sample_rate,
        ),
        windows=windows,
    )
    requests: Iterable[TrialRequest] = [whole]
    if experiment.recorded is not None:
        usable = sufficient([each.name for each in record.channels], RigFacts.of(bench))
        read = RecordingReader(record, found.opened).recording
        offered = OfferedRecording(duration, record.sample_rate, usable, conditions, windows, read)
        try:
            requests = list(experiment.recorded(options, bench, offered))
        except ValueError as error:
            raise ValueError(f"{record.label}: {error}") from None
    for request in requests:
        part, point = _part(record, request.part), {**conditions, **request.point}
        yield replace(_served(found, request, part, point), planned=False)


def _served(
    found: TestRecording,
    request: TrialRequest,
    told: RecordingDescription,
    point: Mapping[str, JsonValue],
) -> TrialRequest:
    """The request with the rate, duration and description of its recording."""
    rate = told.sample_rate
    return replace(
        request,
        task=request.task.model_copy(update={"sample_rate": rate, "duration": told.samples / rate}),
        point=point,
        recording=told.model_dump(mode="json", exclude_defaults=True),
        note="; ".join(filter(None, (found.entry.note, request.note, found.described.label))),
    )


def _part(told: RecordingDescription, part: tuple[float, float] | None) -> RecordingDescription:
    """The samples of a part of a recording (s)."""
    if part is None:
        return told
    first, stop = (round(end * told.sample_rate) for end in part)
    return told.model_copy(
        update={"skip": told.skip + first, "samples": min(stop, told.samples) - first}
    )


def _conditions(found: TestRecording) -> dict[str, JsonValue]:
    """Conditions of a recording and of its stretch; SI if the value has a unit."""
    conditions: dict[str, JsonValue] = dict(found.stretch.conditions)
    for name, value in found.entry.conditions.items():
        conditions[name] = value
        if isinstance(value, str):
            with suppress(ValueError):  # a word has no unit
                conditions[name] = to_si(value)
    return conditions
