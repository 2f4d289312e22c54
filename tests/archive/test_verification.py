"""`verify_run` finds whatever is not as it was written, and says where."""

import json
import os
import random
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading import in_parts
from campaign.archive.reading.open_run import open_run
from campaign.archive.verification import entries
from campaign.archive.verification.result import STRUCTURE, UNFINISHED
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.nexus import REQUIRED
from campaign.recording import ChannelInfo, Ending, Fault, Outcome
from tests.archive.forging import change_record, put_integer, put_text, reseal, text_of


@pytest.fixture
def good(tmp_path, kit):
    """A sealed run with a short trial, a failed one, one of two chunks with a preview."""
    return kit.run(tmp_path, [50, None, 40_000])


@pytest.fixture
def folder(tmp_path, kit):
    """A killed run: three trials finished, the second at its second attempt; one was begun."""
    writer, trials = kit.begin(tmp_path, 4, [20])
    failed = writer.begin(trials[1])
    failed.finish(Ending(Outcome.FAULT, "no power", fault=Fault.DRIVE), kit.STARTED, kit.ENDED)
    kit.record(writer, trials[1], 30)
    kit.record(writer, trials[2], 40)
    writer.begin(trials[3])
    writer.close()  # as a kill leaves it, and no sealed file grows in the folder any more
    return writer.folder


def places(path):
    return [damage.place for damage in verify_run(path).problems]


def datasets(path: Path) -> dict[str, h5py.Dataset]:
    """Name to kind of all datasets in a file; of two names for one the first."""
    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset):
            found[name] = item.dtype.kind

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def test_a_sealed_run_is_sound_and_every_dataset_was_read(good):
    found = verify_run(good)
    assert (found.problems, found.remarks, found.trials) == ((), (), 3)
    assert found.datasets == len(datasets(good)) - 1  # all but the hash of the file itself
    assert found.root == open_run(good).root != ""


@pytest.fixture
def described(tmp_path, kit):
    """A sealed run of three trials that share what describes their bench."""
    writer, trials = kit.begin(tmp_path, 3)
    channels = [ChannelInfo(name, "rad", name, "rad") for name in REQUIRED]
    for trial in trials:
        kit.recorded(writer, trial, (np.arange(9.0), np.ones((len(channels), 9))), channels)
    return writer.seal(RunStatus.COMPLETE, "", ended=kit.ENDED)


@pytest.mark.slow
@pytest.mark.parametrize("place", ["", "trial_00001/instrument/name", "trial_00003/data/time"])
@pytest.mark.parametrize("dies", [False, True])
def test_several_processes_find_what_one_does(described, monkeypatch, place, dies):
    with h5py.File(described, "r+") as file:
        assert file["trial_00001/instrument"] == file["trial_00003/instrument"]
        if place.endswith("name"):
            file[place][()] = b"huge"
        elif place:
            file[place][7] += 1.0
    alone = verify_run(described)
    assert set(places(described)) == ({f"/{place}"} if place else set())
    # all but the hash of the file itself, and what is damaged
    assert alone.datasets == len(datasets(described)) - 1 - bool(place)
    for name in ("WORTHWHILE", "TOGETHER"):
        monkeypatch.setattr(in_parts, name, 1)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    if dies:  # of whatever it is asked to do
        dead = Future()
        dead.set_exception(BrokenProcessPool())
        monkeypatch.setattr(ProcessPoolExecutor, "submit", lambda *_: dead)
    else:
        monkeypatch.setattr(entries.EntryCheck, "trial", None)  # nothing is checked here
    assert verify_run(described) == alone


UNNAMED = ("run/outcome/file_sha256", "run/outcome/seal", "run/provenance/format")


LARGE = "trial_00003/"
"""What the trial of two chunks has; all else is changed in a run without it, which is small."""


@pytest.mark.slow
def test_whatever_dataset_is_changed_it_is_named(good, kit):
    """With a checksum of its own that fits; it is not left to the hash of the file.

    But for the seal, which says the same with a space behind it, and the format, of another one of
    which nothing is read.
    """
    small = kit.run(good.parent / "small", [50, None])
    large = {name: kind for name, kind in datasets(good).items() if name.startswith(LARGE)}
    rest = {name: kind for name, kind in datasets(small).items() if name not in UNNAMED}
    assert {*large, *rest, *UNNAMED} == {*datasets(good)}
    changed_is_named(good, large)
    changed_is_named(small, rest)


def changed_is_named(good: Path, kinds: dict[str, str]) -> None:
    """Change each dataset of these names, by its kind, and verify."""
    content = good.read_bytes()
    for name, kind in kinds.items():
        with h5py.File(good, "r+") as file:
            if kind == "S":
                put_text(file, name, text_of(file, name) + " ")
            elif kind == "i":
                put_integer(file, name, int(file[name][()]) + 1)
            else:
                file[name][-1] += 1.0
        found = places(good)
        assert any(place.startswith(f"/{name}") for place in found), (name, found)
        good.write_bytes(content)


def test_a_killed_run_is_sound_and_what_is_not_its_is_named(folder):
    found = verify_run(folder)
    assert (found.problems, found.trials) == ((), 4)
    assert [remark.place for remark in found.remarks] == ["trial-00004.trial.part"]
    for name in ("sealed.nxs.part", "notes.txt"):
        (folder / name).write_bytes(b"whatever it holds")
    found = verify_run(folder)
    assert found.problems == ()
    assert {remark.place: remark.reason for remark in found.remarks} == {
        "trial-00004.trial.part": "was never finished",
        "notes.txt": "is not part of the run",
    }


def flips(path: Path, count: int, seed: int) -> None:
    """Change one byte anywhere, `count` times, and verify."""
    content = path.read_bytes()
    rng = random.Random(seed)
    for _ in range(count):
        place = rng.randrange(len(content))
        mutated = bytearray(content)
        mutated[place] ^= rng.randrange(1, 256)
        path.write_bytes(mutated)
        assert not verify_run(path).sound, f"a flip at byte {place} was not found"
    path.write_bytes(content)
    assert verify_run(path).sound


@pytest.mark.slow
def test_a_byte_that_is_not_as_it_was_is_always_found(tmp_path, kit):
    flips(kit.run(tmp_path, [50, None]), 120, 1)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(4))
def test_a_byte_that_is_not_as_it_was_is_always_found_in_thousands(tmp_path, kit, seed):
    flips(kit.run(tmp_path, [50, None, 200]), 1000, seed)


@pytest.mark.parametrize("place", [0, 20_000, 39_999])
def test_a_flip_in_the_samples_is_named_by_trial_and_channel(good, place):
    with h5py.File(good, "r+") as file:
        chunk = file["trial_00003/data/gyro_rate"].id.get_chunk_info(place // 32_768)
    content = bytearray(good.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 1
    good.write_bytes(content)
    (problem,) = verify_run(good).problems
    assert (problem.trial, problem.channel) == ("trial-00003", "gyro_rate")


def test_a_flip_that_no_dataset_shows_is_structure(good):
    with h5py.File(good) as file:
        digest = file["run/outcome/file_sha256"].id.get_offset()
    content = bytearray(good.read_bytes())
    content[digest] ^= 1
    good.write_bytes(content)
    assert [damage.reason for damage in verify_run(good).problems] == [STRUCTURE]


def agreeing(good):
    """As the places are that verifying names, of a run that was sound."""
    assert places(good) == []
    return h5py.File(good, "r+")


@pytest.mark.parametrize(
    ("place", "old", "new", "told"),
    [
        ("provenance/normalised", "map", "mop", "/run/provenance"),
        ("plan/data", '"role":"measurement"', '"role":"warm-up"', "/trial_00001"),
        ("journal/data", '"outcome":"fault"', '"outcome":"limit"', "/trial_00002"),
        ("journal/data", '"status":"failed trials"', '"status":"complete"', "/run/outcome/"),
        ("journal/data", "2026-11-21T09-36-58-tiny", "another", "/run/journal"),
        ("journal/data", '"attempt":1', '"attempt":2', "/trial_00001"),
        ("index/data", '"label":"map', '"label":"mop', "/run/index"),
        ("outcome/reason", "no power", "no water", "/run/outcome/reason"),
        ("provenance/trials", "3", "4", "/run/journal"),
        ("plan_trials/data", '"duration":2.0', '"duration":3.0', "/run/plan in full"),
        ("trees/data", "35.0", "36.0", "plan-trees.jsonl: line 1 does not"),
    ],
)
def test_parts_that_do_not_agree_are_named(good, place, old, new, told):
    """Each of them has a checksum that holds, and the seal says that it belongs there."""
    with agreeing(good) as file:
        text = text_of(file, f"run/{place}")
        assert old in text
        put_text(file, f"run/{place}", text.replace(old, new))
        reseal(file)
    found = [str(damage) for damage in verify_run(good).problems]
    assert any(line.startswith(told) for line in found), found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "change", "told"),
    [
        ("trial", {"label": "another"}, "/title"),
        ("trial", {"started": "2026-11-21T09:37:00.251Z"}, "/start_time"),
        ("trial", {"ended": "2026-11-21T09:37:00.251Z"}, "/end_time"),
        ("trial", {"fingerprint": "f" * 64}, "/record"),
        ("trial", {"outcome": "limit"}, ""),
        ("trial", {"samples": 49}, "/data/time"),
        ("trial", {"channels": []}, "/data/command"),
        ("channel", {"name": "gyro"}, "/data/gyro"),
        ("channel", {"unit": "deg/s"}, "/data/gyro_rate@units"),
        ("channel", {"label": "Speed"}, "/data/gyro_rate@long_name"),
        ("channel", {"sha256": "0" * 64}, "/data/gyro_rate"),
    ],
)
def test_a_record_that_does_not_agree_with_its_trial_is_named(good, of, change, told):
    def changed(record):
        (record if of == "trial" else record["channels"][1]).update(change)

    with agreeing(good) as file:
        change_record(file, "trial_00001", changed)
    assert f"/trial_00001{told}" in places(good), verify_run(good).problems


def test_what_is_missing_and_what_is_unknown_are_named(good):
    gone = [
        "trial_00001/title", "trial_00001/data/command", "trial_00002/record/trees",
        "trial_00003/preview", "run/source_001/data",
    ]  # fmt: skip
    extra = ["run/extra", "extra", "trial_00001/extra", "trial_00001/record/extra"]
    with h5py.File(good, "r+") as file:
        del file["trial_00001/data"].attrs["axes"]
        for place in gone:
            del file[place]
        for place in (*extra, "trial_00001/data/extra"):
            file[place] = 1.0
    found = verify_run(good)
    named = {f"/{place}" for place in (*gone, "trial_00001/data@axes", "trial_00001/data/extra")}
    assert named <= {damage.place for damage in found.problems}
    assert {remark.place for remark in found.remarks} == {f"/{place}" for place in extra}
    with h5py.File(good, "r+") as file:
        del file["trial_00001/record/json"], file["trial_00003"]
    assert {"/trial_00001/record/json", "/trial_00003"} <= set(places(good))


@pytest.mark.parametrize("name", ["run.nxs", "run.partial"])
def test_what_is_no_run_is_a_problem_and_no_error(tmp_path, name):
    (tmp_path / "run.nxs").write_bytes(b"nonsense")
    (tmp_path / "run.partial").mkdir()
    assert len(verify_run(tmp_path / name).problems) == 1


def test_a_trial_file_that_changed_is_named(folder):
    path = folder / "trial-00001.trial"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    assert {damage.trial for damage in verify_run(folder).problems} == {"trial-00001"}
    (folder / "trial-00002-2.trial").unlink()
    assert "trial-00002 (attempt 2)" in {damage.trial for damage in verify_run(folder).problems}


def test_a_trial_file_of_another_hash_is_named(folder):
    journal = folder / JOURNAL
    lines = [json.loads(line) for line in journal.read_text().splitlines()]
    lines[1]["sha256"] = "0" * 64
    journal.write_text("".join(json.dumps(line) + "\n" for line in lines))
    (problem,) = verify_run(folder).problems
    assert (problem.place, problem.reason) == ("trial-00001.trial", UNFINISHED)


@pytest.mark.parametrize("line", [0, 1, 2])
def test_a_damaged_line_of_the_journal_is_named(folder, line):
    journal = folder / JOURNAL
    lines = journal.read_bytes().split(b"\n")
    lines[line] = lines[line][:-9]
    journal.write_bytes(b"\n".join(lines))
    assert f"{JOURNAL}:{line + 1}" in places(folder)


def test_progress_tells_of_the_bytes_that_were_read(good):
    told = []
    verify_run(good, told.append)
    assert good.stat().st_size < sum(told) <= 2 * good.stat().st_size
