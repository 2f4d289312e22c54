"""Copying beside the trials: which, in which order, and what a failure leaves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from campaign.archive.layout.journal import TrialFinished
from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.layout.names import JOURNAL, SEALING
from campaign.archive.writing import seal_run
from campaign.archive.writing.sealed_file import SealedFile
from campaign.archive.writing.writer import RunWriter

ALL = ["trial_00001", "trial_00002", "trial_00003"]


@pytest.fixture
def writer(tmp_path: Path, kit) -> Iterator[RunWriter]:
    """A run of three trials, of which nothing is copied yet: four attempts, the second failed."""
    with pytest.MonkeyPatch.context() as late:
        late.setattr(seal_run.Sealer, "advance", lambda self, fewest: False)
        writer, trials = kit.begin(tmp_path, 3, [20, None])
        kit.record(writer, trials[1], 30)
        kit.record(writer, trials[2], 40)
    yield writer
    writer.close()


@pytest.fixture
def attempts(writer: RunWriter) -> list[TrialFinished]:
    return list(read_journal(writer.folder / JOURNAL).attempts)


@pytest.fixture
def sealer(writer: RunWriter) -> Iterator[seal_run.Sealer]:
    sealer = seal_run.Sealer(writer.folder)
    yield sealer
    sealer.discard()


def copied(sealer: seal_run.Sealer) -> list[str] | None:
    """What was copied of all that was added; None without a file."""
    for _ in range(4):  # more often than there are attempts
        sealer.advance()
    return None if sealer._file is None else list(sealer._file.copied)


def test_first_attempts_that_completed_are_copied_in_the_order_of_the_plan(sealer, attempts):
    first, failed, again, third = attempts
    sealer.add(third)
    assert copied(sealer) is None
    for finished in (failed, again, first):
        sealer.add(finished)
    assert copied(sealer) == [ALL[0], ALL[2]]
    sealer.discard()
    assert sealer._file is None


def test_it_copies_only_if_so_many_wait(sealer, attempts):
    sealer.add(attempts[0])
    assert not sealer.advance(2)
    sealer.add(attempts[3])
    assert sealer.advance(2)
    assert list(sealer._file.copied) == ALL[:1]
    assert not sealer.advance(2)


def test_a_second_attempt_is_not_copied_before_the_end(sealer, attempts):
    first, _, again, third = attempts
    for finished in (first, again, third):
        sealer.add(finished)
    assert copied(sealer) == [ALL[0], ALL[2]]


def test_what_is_left_out_after_the_first_attempt_that_failed_is_left_out(sealer, attempts):
    """Of several attempts the first one counts here, whatever came later."""
    for finished in attempts:
        sealer.add(finished)
    assert copied(sealer) == [ALL[0], ALL[2]]


@pytest.mark.parametrize(("short", "expected"), [(0, ALL[:1]), (1, None)])
def test_room_is_left_for_the_trials_to_the_byte(sealer, attempts, monkeypatch, short, expected):
    asked = []

    def disk_usage(path):
        asked.append(path)
        return SimpleNamespace(free=seal_run._FREE + 2 * attempts[0].bytes - short)

    monkeypatch.setattr(seal_run.shutil, "disk_usage", disk_usage)
    sealer.add(attempts[0])
    assert copied(sealer) == expected
    assert asked == [sealer._folder]


def test_after_a_failure_there_is_no_file_and_nothing_is_copied(sealer, attempts, monkeypatch):
    real = SealedFile.copy

    def fail(*arguments):
        monkeypatch.setattr(SealedFile, "copy", real)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(SealedFile, "copy", fail)
    sealer.add(attempts[0])
    sealer.add(attempts[3])
    assert copied(sealer) is None
    assert not (sealer._folder / SEALING).exists()
    sealer.add(attempts[0])
    assert copied(sealer) is None
    sealer.discard()
    assert not (sealer._folder / SEALING).exists()


def test_the_file_that_was_begun_is_the_one_that_is_sealed(sealer, writer, attempts, monkeypatch):
    given = []
    monkeypatch.setattr(seal_run, "seal_folder", lambda *both: given.append(both))
    sealer.add(attempts[0])
    sealer.advance()
    sealer.seal()
    ((folder, begun),) = given
    assert folder == writer.folder
    assert list(begun.copied) == ALL[:1]
    assert sealer._file is None
    begun.discard()
