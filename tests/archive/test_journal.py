"""The journal alone: lines that are whole or not there, and what they tell of a run."""

from __future__ import annotations

import errno
import json
import os
import stat
import threading
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from campaign.archive.layout.journal import (
    Decision,
    Entry,
    Journal,
    OperatorStep,
    RunEnded,
    RunResumed,
    RunStarted,
    TrialAbandoned,
    TrialFinished,
)
from campaign.archive.layout.journal_summary import read_journal, read_lines
from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ArchiveError
from campaign.recording import Outcome, SafeState

AT = "2026-11-21T09:37:00Z"
STARTED = RunStarted(at=AT, run="r", format=3, trials=3)
RESUMED = RunResumed(at=AT)
ENDED = RunEnded(at=AT, status=RunStatus.INTERRUPTED, reason="", safe_state=SafeState.CONFIRMED)


def finished(trial: int, attempt: int = 1, **changes: Any) -> TrialFinished:
    name = f"trial-{trial:05d}{f'-{attempt}' if attempt > 1 else ''}.nxs"
    settings = {
        "at": AT, "trial": trial, "attempt": attempt, "file": name, "sha256": "0" * 64,
        "record": "1" * 64, "bytes": 10, "outcome": Outcome.COMPLETED, "reason": "",
        "safe_state": SafeState.CONFIRMED,
    }  # fmt: skip
    return TrialFinished.model_validate({**settings, **changes})


def text(*entries: Entry) -> bytes:
    return b"".join(entry.model_dump_json().encode() + b"\n" for entry in entries)


def told(*entries: Entry, after: bytes = b"") -> Any:
    return read_lines(text(*entries) + after, lean=True)


def journal_of(folder: Path, content: bytes) -> Path:
    path = folder / "j"
    path.write_bytes(content)
    return path


# What it tells


def test_how_a_run_ended_counts_until_it_is_resumed() -> None:
    other = ENDED.model_copy(update={"status": RunStatus.COMPLETE})
    note = Decision(at=AT, decision="rest", reason="warm")
    assert told(STARTED).ended is None
    assert told(STARTED, ENDED).ended == ENDED
    assert told(STARTED, ENDED, note).ended == ENDED
    assert told(STARTED, ENDED, RESUMED).ended is None
    assert told(STARTED, ENDED, RESUMED, finished(1)).ended is None
    assert told(STARTED, ENDED, RESUMED, other).ended == other


def test_the_last_attempt_at_a_trial_counts_and_the_earlier_ones_are_kept_in_order() -> None:
    first, second, third = (finished(2, attempt) for attempt in (1, 2, 3))
    story = told(STARTED, first, finished(3), second, finished(1), third)
    assert list(story.finished) == [1, 2, 3]
    assert story.finished[2] == third
    assert story.attempts == [first, finished(3), second, finished(1), third]


def test_a_file_that_was_written_again_is_one_attempt_at_its_last_place() -> None:
    first, again = finished(1), finished(1, bytes=11)
    story = told(STARTED, first, finished(1, 2), again)
    assert story.finished[1] == again
    assert story.attempts == [finished(1, 2), again]


def test_every_entry_comes_back_with_the_size_of_all() -> None:
    entries = (
        STARTED,
        OperatorStep(at=AT, trial=1, step="Lock the axis", answer="yes"),
        finished(1),
        TrialAbandoned(at=AT, trial=2, reason="the run ended"),
        ENDED,
    )
    story = told(*entries)
    with pytest.raises(FrozenInstanceError):
        story.torn = True
    assert story.entries == entries
    assert story.size == len(text(*entries))


# What a crash leaves


@pytest.mark.parametrize(
    "torn", [b'{"event": "trial fin', b"\0\0\0", b"\xff\xfe", text(ENDED)[:-1]]
)
def test_what_follows_the_last_whole_line_was_never_reported(torn: bytes) -> None:
    story = told(STARTED, finished(1), after=torn)
    assert story.entries == (STARTED, finished(1))
    assert story.size == len(text(STARTED, finished(1)))


@pytest.mark.parametrize(
    "rubbish",
    [b"\0\0\0\n", b"{}\n", b"[" * 100_000 + b"\n", b"\xff\n", b'{"event":"new"}\n', b"\n"],
)
def test_a_last_line_of_rubbish_is_left_out_and_an_earlier_one_is_named(
    tmp_path: Path, rubbish: bytes
) -> None:
    story = told(STARTED, finished(1), after=rubbish)
    assert story.entries == (STARTED, finished(1))
    assert story.size == len(text(STARTED, finished(1)))
    with pytest.raises(ArchiveError, match=r"j:2: is not a line of a journal"):
        read_journal(journal_of(tmp_path, text(STARTED) + rubbish + text(finished(1))))


@pytest.mark.parametrize("content", [b"", b"rubbish\n", text(finished(1)), text(ENDED, STARTED)])
def test_a_journal_begins_with_the_start_of_a_run(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(ArchiveError, match="j: does not begin with the start of a run"):
        read_journal(journal_of(tmp_path, content))


def test_a_journal_that_cannot_be_read_is_said(tmp_path: Path) -> None:
    with pytest.raises(ArchiveError, match=r"none\.jsonl: cannot be read: No such file"):
        read_journal(tmp_path / "none.jsonl")
    path = tmp_path / "journal.jsonl"
    path.write_bytes(text(STARTED))
    assert read_journal(path).entries == (STARTED,)


def test_what_a_line_may_say() -> None:
    """Numbers count from 1, files are a run's own, and what is not known is left out."""
    for wrong in (
        {"trial": 0}, {"attempt": 0}, {"bytes": -1}, {"sha256": "0" * 63}, {"sha256": "G" * 64},
        {"file": "../trial-00001.trial"}, {"file": "trial-1.nxs"}, {"file": "trial-00001.trial\n"},
    ):  # fmt: skip
        with pytest.raises(ValidationError):
            TrialFinished.model_validate({**finished(1).model_dump(), **wrong})
    assert finished(1, bytes=0).bytes == 0
    for model in (OperatorStep, TrialAbandoned):
        with pytest.raises(ValidationError):
            model.model_validate({"at": AT, "trial": 0, "step": "s", "answer": "a", "reason": "r"})
        one = {"at": AT, "trial": 1, "step": "s", "answer": "a", "reason": "r"}
        assert model.model_validate(one).trial == 1
    for decision in ("", "Rest", "rest\n", "x" * 41):
        with pytest.raises(ValidationError):
            Decision(at=AT, decision=decision, reason="warm")
    assert Decision(at=AT, decision="stop cleared-" + "x" * 27, reason="").trial is None
    older = {k: v for k, v in finished(1).model_dump().items() if k != "attempt"}
    assert TrialFinished.model_validate(older).attempt == 1  # of before attempts were counted
    newer = {**finished(1).model_dump(mode="json"), "mood": "good"}
    assert TrialFinished.model_validate(newer) == finished(1)
    with pytest.raises(ValidationError):
        STARTED.run = "other"  # type: ignore[misc]


# Appending


def lines(path: Path) -> list[str]:
    return [json.loads(line)["event"] for line in path.read_text().splitlines()]


def test_lines_are_added_and_what_was_torn_is_cut(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    before = os.umask(0)
    journal = Journal(path)
    os.umask(before)
    journal.append(STARTED)
    journal.append(finished(1))
    journal.close()
    journal.close()  # once more does nothing
    whole = path.read_bytes()
    assert lines(path) == ["run started", "trial finished"]
    if os.name == "posix":  # whatever the user lets others do
        assert stat.S_IMODE(path.stat().st_mode) == 0o666
    path.write_bytes(whole + b'{"event": "torn')
    again = Journal(path, whole=len(whole))
    assert path.read_bytes() == whole
    again.append(RESUMED)
    again.close()
    assert lines(path) == ["run started", "trial finished", "run resumed"]
    kept = Journal(path)  # without a length nothing is cut
    kept.close()
    assert lines(path) == ["run started", "trial finished", "run resumed"]


@pytest.mark.parametrize("descriptor", [0, 1, 7])
def test_it_is_closed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, descriptor: int
) -> None:
    """Twice, it would be somebody else's file the second time; 0 is a file like any other."""
    closed: list[int] = []
    monkeypatch.setattr(os, "open", lambda *arguments: descriptor)
    monkeypatch.setattr(os, "close", closed.append)
    journal = Journal(tmp_path / "journal.jsonl")
    journal.close()
    journal.close()
    assert closed == [descriptor]


def failing_once(real: Callable[..., Any], failure: Callable[[], Any]) -> Callable[..., Any]:
    left = [1]

    def call(*arguments: Any) -> Any:
        if left:
            left.pop()
            return failure()
        return real(*arguments)

    return call


def full() -> Any:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("name", ["write", "fsync"])
def test_a_line_that_cannot_be_written_leaves_the_journal_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path)
    journal.append(STARTED)
    before = path.read_bytes()
    monkeypatch.setattr(os, name, failing_once(getattr(os, name), full))
    with pytest.raises(ArchiveError, match=r"journal\.jsonl: cannot be written: No space left"):
        journal.append(finished(1))
    assert path.read_bytes() == before
    journal.append(finished(2))
    journal.close()
    assert read_journal(path).finished == {2: finished(2)}


def test_half_a_line_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path)
    journal.append(STARTED)
    before, write = path.read_bytes(), os.write
    monkeypatch.setattr(os, "write", lambda where, data: write(where, data[: len(data) - 1]))
    with pytest.raises(ArchiveError, match="no space for whole lines"):
        journal.append(finished(1))
    monkeypatch.undo()
    assert path.read_bytes() == before
    journal.close()


def test_threads_share_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While one line is on its way to the disk, no other is begun: it could not be taken back."""
    path = tmp_path / "journal.jsonl"
    journal = Journal(path)
    journal.append(STARTED)
    before, entered, go_on = path.stat().st_size, threading.Event(), threading.Event()
    sync = os.fsync

    def slow(descriptor: int) -> None:
        entered.set()
        go_on.wait(60)
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", slow)
    first = threading.Thread(target=journal.append, args=(finished(1),))
    second = threading.Thread(target=journal.append, args=(finished(2),))
    first.start()
    assert entered.wait(60)
    second.start()
    second.join(0.2)
    assert path.stat().st_size - before == len(text(finished(1)))
    go_on.set()
    first.join(60)
    second.join(60)
    journal.close()
    assert lines(path) == ["run started", "trial finished", "trial finished"]
