"""Sealing: every sample is read back, trials are copied beside the others, and nothing depends on
when.
"""

from __future__ import annotations

import contextlib
import os
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.layout.names import JOURNAL, PARTIAL, SEALING
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading import in_parts
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.series import Series
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing import packed_file, seal_run, sealed_entry, sealed_file
from campaign.archive.writing.sealed_entry import EntryWriter
from campaign.archive.writing.writer import RunWriter
from campaign.errors import ArchiveError
from campaign.recording import ChannelInfo, Ending, Outcome
from tests.archive.forging import put_integer, put_text, text_of

WAIT = 60.0  # s; long past what a busy machine takes, and never waited for when all is well


def seal(writer: RunWriter) -> Path:
    return writer.seal(RunStatus.COMPLETE, ended="2026-11-21T09:40:00Z")


def refused(writer: RunWriter, match: str) -> None:
    """Sealing refuses, leaves no file, and the folder has every trial."""
    with pytest.raises(ArchiveError, match=match):
        seal(writer)
    assert not list(writer.folder.parent.glob("*.nxs*"))
    assert not (writer.folder / SEALING).exists()
    run = open_run(writer.folder)
    assert run.damaged == ()
    assert run.problems() == []
    assert len(run.trials) == 3


def corrupt_copy(monkeypatch, change) -> None:
    """From now on `change` is done to the copy of the second trial."""
    real = EntryWriter.write

    def write(entries, name, *arguments):
        written = real(entries, name, *arguments)
        if name == "trial_00002":
            change(entries._file[name])
        return written

    monkeypatch.setattr(EntryWriter, "write", write)


def flip_chunk(entry: h5py.Group) -> None:
    """Another chunk, which is whole."""
    series = entry["data/friction_torque"]
    values = series[:]
    values[7] = np.nextafter(values[7], np.inf)
    series[:] = values


def flip_byte(entry: h5py.Group) -> None:
    chunk = entry["data/gyro_rate"].id
    mask, packed = chunk.read_direct_chunk((0,))
    changed = bytearray(packed)
    changed[len(changed) // 2] ^= 1
    chunk.write_direct_chunk((0,), bytes(changed), mask)


def exchange(entry: h5py.Group) -> None:
    data = entry["data"]
    data.move("gyro_rate", "aside")
    data.move("command", "gyro_rate")
    data.move("aside", "command")


def lose_channel(entry: h5py.Group) -> None:
    del entry["data/command"]


def change_preview(entry: h5py.Group) -> None:
    entry["preview/gyro_rate"][3] += 1.0


def change_unit(entry: h5py.Group) -> None:
    entry["data/gyro_rate"].attrs["units"] = "deg/s"


def change_record(entry: h5py.Group) -> None:
    put_text(entry, "record/json", text_of(entry, "record/json").replace("completed", "limit"))


@pytest.mark.parametrize(
    "change",
    [flip_chunk, flip_byte, exchange, lose_channel, change_preview, change_unit, change_record],
)
@pytest.mark.parametrize("beside", [True, False])
def test_a_copy_that_is_not_what_was_recorded_is_not_sealed(
    tmp_path, kit, monkeypatch, change, beside
):
    if not beside:
        monkeypatch.setattr(seal_run.Sealer, "advance", lambda self, fewest: False)
    corrupt_copy(monkeypatch, change)
    writer, _ = kit.begin(tmp_path, 3, [20_001] * 3)
    refused(writer, "could not be sealed: .*trial_00002")


def test_without_reading_back_a_wrong_chunk_would_be_sealed(tmp_path, kit, monkeypatch):
    """The test above would pass for another reason if this one did not: reading back finds it."""
    monkeypatch.setattr(Series, "check", lambda self, digest: None)
    corrupt_copy(monkeypatch, flip_chunk)
    path = seal(kit.begin(tmp_path, 3, [50] * 3)[0])
    monkeypatch.undo()
    assert "trial_00002/data/friction_torque" in "".join(open_run(path).problems())


def test_trials_of_many_forms_are_sealed_each_with_its_own(tmp_path, kit, monkeypatch):
    """Of more lengths and units than groups are kept for copying, and back again."""
    monkeypatch.setattr(sealed_entry, "_MOST_FORMS", 2)
    writer, trials = kit.begin(tmp_path, 8)
    for trial in trials:
        number = trial.number % 4
        unit = ("rad/s", "rad", "N m", "A")[number]
        channels = (ChannelInfo("x", unit, "X", unit), ChannelInfo("y", "s", "Y", "s"))
        samples = np.arange(10.0 + number), np.full((2, 10 + number), float(number))
        kit.recorded(writer, trial, samples, channels)
    path = seal(writer)
    assert verify_run(path).sound
    with h5py.File(path) as file:
        units = [file[f"trial_0000{n}/data/x"].attrs["units"] for n in range(1, 9)]
    assert units == ["rad", "N m", "A", "rad/s"] * 2


def test_a_chunk_that_was_stored_wrong_in_the_first_place_is_not_sealed(tmp_path, kit, monkeypatch):
    """The digest is of what was appended, not of what was stored."""
    real = packed_file.pack

    def pack(samples, shuffled):
        wrong = np.array(samples)
        if len(wrong) == 77:
            wrong[20] += 1.0
        return real(wrong, shuffled)

    monkeypatch.setattr(packed_file, "pack", pack)
    writer, _ = kit.begin(tmp_path, 3, [50, 77, 50])
    with pytest.raises(ArchiveError, match=r"trial_00002/data/.* does not match its checksum"):
        seal(writer)
    run = open_run(writer.folder)
    assert not list(tmp_path.glob("*.nxs*"))
    assert [len(list(trial.problems())) for trial in run.trials] == [0, 4, 0]


def put_seal(opened: h5py.File) -> None:
    put_text(opened, "run/outcome/seal", text_of(opened, "run/outcome/seal") + " ", honest=True)


def put_count(opened: h5py.File) -> None:
    put_integer(opened, "run/outcome/trials_finished", 2)


def lose_trial(opened: h5py.File) -> None:
    del opened["trial_00002"]


def put_unit(opened: h5py.File) -> None:
    opened["trial_00003/data/command"].attrs["units"] = "deg/s"


def move_samples(opened: h5py.File) -> None:
    """After they were read back."""
    exchange(opened["trial_00001"])


TEXTS = ("run/journal/data", "run/title", "run/outcome/status")


IN_TRIALS = [
    ("trial_00001/record/json", "/trial_00001/record/json: does not match its checksum"),
    (lose_trial, "/trial_00002"),
    (put_unit, "/trial_00003/data/command@units: is 'deg/s', and 'rad/s' was recorded"),
    (move_samples, "/trial_00001/data/command: does not lie where it was written"),
]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        *((place, f"/{place}: does not match its checksum") for place in TEXTS),
        (put_seal, "/run/outcome/seal: does not match its checksum"),
        (put_count, "/run/outcome/trials_finished: does not match its checksum"),
        *IN_TRIALS,
    ],
)
def test_what_changed_between_writing_and_checking_is_found(
    tmp_path, kit, monkeypatch, change, told
):
    """A text with a checksum of its own that fits."""
    real = sealed_file.check_sealed

    def check(part, file):
        with h5py.File(part, "r+") as opened:
            if isinstance(change, str):
                put_text(opened, change, text_of(opened, change) + " ")
            else:
                change(opened)
        real(part, file)

    monkeypatch.setattr(seal_run, "check_sealed", check)
    writer, _ = kit.begin(tmp_path, 3, [50] * 3)
    refused(writer, told)


@pytest.mark.parametrize(("change", "told"), IN_TRIALS)
def test_several_processes_find_the_same_changes(tmp_path, kit, monkeypatch, change, told):
    for name in ("WORTHWHILE", "TOGETHER"):
        monkeypatch.setattr(in_parts, name, 1)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(sealed_file, "_check_copy", None)  # nothing is checked in this process
    test_what_changed_between_writing_and_checking_is_found(
        tmp_path, kit, monkeypatch, change, told
    )


class Watched:
    """Tells when trials were copied.

    Attributes:
        beside: names of the groups that were copied while trials could still come, in order.
        at_the_end: those that were copied by `seal`.
        failures: the next copy fails with the last of these.
    """

    def __init__(self, monkeypatch) -> None:
        self.beside: list[str] = []
        self.at_the_end: list[str] = []
        self.failures: list[BaseException] = []
        self._to = self.beside
        copy, seal_folder = sealed_file.SealedFile.copy, seal_run.seal_folder

        def copied(file, folder, finished, entry):
            if self.failures:
                raise self.failures.pop()
            copy(file, folder, finished, entry)
            self._to.append(entry)

        def sealed(*both):
            self._to = self.at_the_end
            try:
                return seal_folder(*both)
            finally:
                self._to = self.beside

        monkeypatch.setattr(sealed_file.SealedFile, "copy", copied)
        monkeypatch.setattr(seal_run, "seal_folder", sealed)


ALL = ["trial_00001", "trial_00002", "trial_00003"]


def test_trials_are_copied_while_others_are_executed(tmp_path, kit, monkeypatch):
    watched = Watched(monkeypatch)
    writer, trials = kit.begin(tmp_path, 3)
    for number, trial in enumerate(trials, start=1):
        kit.record(writer, trial, 50)
        assert watched.beside == ALL[:number]
        assert (writer.folder / SEALING).is_file()
    path = seal(writer)
    assert watched.at_the_end == []
    assert verify_run(path).sound


def test_a_trial_waits_for_those_before_it_in_the_plan(tmp_path, kit, monkeypatch):
    watched = Watched(monkeypatch)
    writer, trials = kit.begin(tmp_path, 5)
    for number in (4, 3, 2):
        kit.record(writer, trials[number - 1], 50)
        assert watched.beside == []
    kit.recorded(writer, trials[0], 50)
    for copied in range(1, 5):  # one for each call
        assert writer.seal_next()
        assert watched.beside == [f"trial_0000{number}" for number in range(1, copied + 1)]
    assert not writer.seal_next()
    kit.recorded(writer, trials[4], 50)
    assert verify_run(seal(writer)).sound
    assert watched.at_the_end == ["trial_00005"]


def test_trials_are_finished_while_another_is_copied(tmp_path, kit, monkeypatch):
    watched = Watched(monkeypatch)
    writer, trials = kit.begin(tmp_path, 3)
    kit.recorded(writer, trials[0], 50)
    copying, may_go = threading.Event(), threading.Event()
    copy = sealed_file.SealedFile.copy

    def held_up(*arguments):
        copying.set()
        assert may_go.wait(WAIT)
        copy(*arguments)

    with monkeypatch.context() as held:
        held.setattr(sealed_file.SealedFile, "copy", held_up)
        other = threading.Thread(target=writer.seal_next)
        other.start()
        assert copying.wait(WAIT)
        kit.recorded(writer, trials[1], 50)  # returns
        assert watched.beside == []
        may_go.set()
        other.join(WAIT)
    assert watched.beside == ALL[:1]
    kit.record(writer, trials[2], 50)
    assert watched.beside == ALL
    assert verify_run(seal(writer)).sound


def written(results: Path, kit, order: list[int]) -> bytes:
    writer, trials = kit.begin(results, 3)
    for number in order:
        kit.record(writer, trials[number - 1], 50)
    return seal(writer).read_bytes()


def test_equal_runs_make_equal_files_whatever_was_copied_when(tmp_path, kit, monkeypatch):
    """Whether trials were copied beside the others, sooner or later, or by `seal` itself."""
    files = [written(tmp_path / "as it comes", kit, [1, 2, 3])]
    watched = Watched(monkeypatch)
    advance = seal_run.Sealer.advance

    def late(sealer, fewest):
        return 3 in sealer._first and len(watched.beside) < 2 and advance(sealer)

    with monkeypatch.context() as held:
        held.setattr(seal_run.Sealer, "advance", late)
        files.append(written(tmp_path / "as it can", kit, [1, 2, 3]))
    assert (watched.beside, watched.at_the_end) == (ALL[:2], ALL[2:])
    monkeypatch.setattr(seal_run.Sealer, "advance", lambda self, fewest: False)
    watched = Watched(monkeypatch)
    files.append(written(tmp_path / "at the end", kit, [1, 2, 3]))
    assert (watched.beside, watched.at_the_end) == ([], ALL)
    assert files[0] == files[1] == files[2]


@pytest.mark.parametrize(
    "failure", [OSError(28, "No space left on device"), RuntimeError("HDF5"), ArchiveError("?")]
)
def test_a_copy_that_fails_costs_nothing_but_time(tmp_path, kit, monkeypatch, failure):
    watched = Watched(monkeypatch)
    writer, trials = kit.begin(tmp_path, 4, [50, 50])
    watched.failures.append(failure)
    kit.record(writer, trials[2], 50)
    assert watched.failures == []
    assert not (writer.folder / SEALING).exists()
    kit.record(writer, trials[3], 50)
    path = seal(writer)
    assert watched.beside == ALL[:2]
    assert watched.at_the_end == [*ALL, "trial_00004"]  # begun anew
    assert verify_run(path).sound


def test_who_interrupts_a_copy_is_heard_and_the_run_can_be_sealed(tmp_path, kit, monkeypatch):
    """The trial is in the journal by then."""
    real = Series.check
    writer, trials = kit.begin(tmp_path, 3)
    with monkeypatch.context() as interrupted:

        def interrupt(*arguments):
            raise KeyboardInterrupt

        interrupted.setattr(Series, "check", interrupt)
        with pytest.raises(KeyboardInterrupt):
            kit.record(writer, trials[0], 50)
    assert Series.check is real
    kit.record(writer, trials[1], 50)
    path = seal(writer)
    assert len(open_run(path).trials) == 2


def test_attempts_have_the_right_names_however_they_came(tmp_path, kit, monkeypatch):
    """A first attempt that failed may be repeated, so it waits for the end."""
    watched = Watched(monkeypatch)
    writer, trials = kit.begin(tmp_path, 3, [50])
    for count in (10, 20):
        fault = Ending(Outcome.FAULT, f"after {count}")
        kit.recorded(writer, trials[1], count, ending=fault)
    kit.record(writer, trials[1], 30)
    kit.record(writer, trials[2], 50)
    run = open_run(seal(writer))
    first = ["trial_00002_attempt_1", "trial_00002_attempt_2", "trial_00002"]
    assert watched.beside == ["trial_00001", "trial_00003"]
    assert watched.at_the_end == first
    earlier = run.earlier_attempts[2]
    assert [attempt.entry for attempt in earlier] == first[:2]
    assert [attempt.ending.reason for attempt in earlier] == ["after 10", "after 20"]
    lengths = [len(attempt.recording().time) for attempt in (*earlier, run.trials[1])]
    assert lengths == [10, 20, 30]
    assert verify_run(run.path).sound


def test_a_trial_that_completed_and_is_repeated_is_copied_anew(tmp_path, kit, monkeypatch):
    """It was copied as the trial, and turns out to be its first attempt."""
    watched = Watched(monkeypatch)
    writer, trials = kit.begin(tmp_path, 3, [50])
    assert watched.beside == ["trial_00001"]
    kit.record(writer, trials[0], 60)
    run = open_run(seal(writer))
    assert len(run.trials[0].recording().time) == 60
    assert [len(attempt.recording().time) for attempt in run.earlier_attempts[1]] == [50]
    assert verify_run(run.path).sound


def test_whoever_lets_go_of_a_run_leaves_no_copy(tmp_path, kit, monkeypatch):
    writer, _ = kit.begin(tmp_path, 3, [50])
    assert (writer.folder / SEALING).is_file()
    writer.close()
    assert not (writer.folder / SEALING).exists()


@pytest.mark.parametrize("how", ["file", "folder"])
def test_what_a_user_put_into_the_folder_stays(tmp_path, kit, how):
    """Through sealing, resuming, unsealing and sealing again."""
    writer, trials = kit.begin(tmp_path, 3, [50])
    notes = {"notes.txt": b"the fan was on"}
    if how == "folder":
        notes = {"photos/1.jpg": b"\xff\xd8", "photos/trial-00001.trial": b"mine", "a.part": b"?"}
    for name, content in notes.items():
        path = writer.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)

    def there() -> dict[str, bytes]:
        found = [path for path in writer.folder.rglob("*") if path.is_file()]
        return {str(path.relative_to(writer.folder)): path.read_bytes() for path in found}

    writer.close()
    RunWriter.resume(writer.folder, **kit.RESUMED).close()
    assert notes.items() <= there().items()
    path = RunWriter.resume(writer.folder, **kit.RESUMED).seal(
        RunStatus.INTERRUPTED, ended=kit.ENDED
    )
    assert there() == notes
    assert verify_run(path).sound
    resumed = RunWriter.resume(path, **kit.RESUMED)
    assert notes.items() <= there().items()
    assert not list(tmp_path.glob(f"*{PARTIAL}.part"))
    for trial in trials[1:]:
        kit.record(resumed, trial, 50)
    path = seal(resumed)
    assert there() == notes
    assert verify_run(path).sound


def open_files(folder: Path) -> list[str]:
    """What this process has open there; a file that was removed counts."""
    found = []
    for link in Path("/proc/self/fd").glob("*"):
        with contextlib.suppress(OSError):
            found.append(str(link.readlink()))
    return [name for name in found if name.startswith(str(folder))]


def test_a_sealer_may_be_discarded_and_begun_again(tmp_path, kit, monkeypatch):
    writer, _ = kit.begin(tmp_path, 3, [50])
    writer._sealer.discard()
    writer._sealer.discard()
    assert not (writer.folder / SEALING).exists()
    assert not [name for name in open_files(writer.folder) if SEALING in name]
    sealer = seal_run.Sealer(writer.folder)
    watched = Watched(monkeypatch)
    sealer.add(*read_journal(writer.folder / JOURNAL).attempts)
    sealer.advance()
    sealer.discard()
    assert watched.beside == ALL[:1]
    writer.close()


def test_a_run_that_has_not_ended_is_not_sealed(tmp_path, kit):
    writer, _ = kit.begin(tmp_path, 3, [50] * 3)
    writer.close()
    with pytest.raises(ArchiveError) as caught:
        seal_run.seal_folder(writer.folder)
    assert f"{writer.folder / JOURNAL}: the run has not ended; every" in str(caught.value)
    assert not list(tmp_path.glob("*.nxs*"))
    assert len(open_run(writer.folder).trials) == 3


FULL = OSError(28, "No space left on device")


@pytest.mark.parametrize(
    ("step", "error"),
    [("copy", FULL), ("finish", FULL), ("put_hash", FULL), ("finish", KeyboardInterrupt())],
)
def test_who_is_refused_or_interrupted_leaves_no_file_open(tmp_path, kit, monkeypatch, step, error):
    def fail(*arguments):
        raise error

    monkeypatch.setattr(seal_run.Sealer, "advance", lambda self, fewest: False)
    monkeypatch.setattr(sealed_file.SealedFile, step, fail)
    writer, _ = kit.begin(tmp_path, 3, [50] * 3)
    before = open_files(tmp_path)
    with pytest.raises(ArchiveError if error is FULL else KeyboardInterrupt) as caught:
        seal(writer)
    told = f"could not be sealed: No space left on device; every finished trial is in {tmp_path}"
    assert (told in str(caught.value)) is (error is FULL)
    assert not [name for name in open_files(tmp_path) if SEALING in name], before
    assert not list(writer.folder.glob("*.part"))
    assert len(open_run(writer.folder).trials) == 3


def test_a_folder_that_cannot_be_removed_harms_nobody(tmp_path, kit, monkeypatch):
    def fail(folder):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(seal_run, "remove_folder", fail)
    writer, _ = kit.begin(tmp_path, 3, [50] * 3)
    path = seal(writer)
    assert path == tmp_path / f"{kit.header().name}.nxs"
    assert verify_run(path).sound
    assert writer.folder.is_dir()
