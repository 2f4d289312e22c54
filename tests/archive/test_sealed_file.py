"""What a sealed file says besides the trials, and what is refused while it is made."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.sealed_file import SealedFile
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import CHANNELS
from campaign.errors import ArchiveError
from campaign.policy import SampleRetention
from campaign.recording import Ending, Outcome, SafeState
from campaign.trial import Role
from tests.archive.forging import sha256, text_of
from tests.archive.test_nexus import nxvalidate

ENDED = "2026-11-21T09:40:00Z"

NONE = "the protocol says keep = none"


def seal(writer: RunWriter, reason: str = "") -> Path:
    return writer.seal(RunStatus.COMPLETE, reason, ended=ENDED)


def attempt(writer: RunWriter, kit, trial, outcome: Outcome, count: int = 10) -> None:
    kit.recorded(writer, trial, kit.samples(count, count), ending=Ending(outcome, "because"))


def texts_of(path: Path) -> dict[str, str | int]:
    found: dict[str, str | int] = {}

    def add(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            value = item[()]
            found[name] = value.decode() if isinstance(value, bytes) else int(value)

    with h5py.File(path) as file:
        file["run"].visititems(add)
    return found


def test_the_texts_of_a_run_are_all_that_was_known_of_it(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 3, [20])
    attempt(writer, kit, trials[1], Outcome.FAULT)
    own = {path.name: path.read_text("utf-8") for path in writer.folder.glob("*.jsonl")}
    path = writer.seal(RunStatus.FAULT, "no power", ended=ENDED, safe_state=SafeState.NOT_CONFIRMED)
    found = texts_of(path)
    header = kit.header().model_copy(update={"trials": 3})
    expected: dict[str, str | int] = {
        "title": "A tiny run: 20 °/s",
        "entry_identifier": header.name,
        "start_time": kit.CREATED,
        "end_time": ENDED,
        "program_name": "campaign",
        "provenance/format": 3,
        "outcome/status": "fault",
        "outcome/reason": "no power",
        "outcome/safe_state": SafeState.NOT_CONFIRMED.value,
        "outcome/trials_finished": 2,
        "outcome/trials_failed": 1,
    }
    for name, value in header.model_dump(mode="json", exclude={"sources"}).items():
        told = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
        expected[f"provenance/{name}"] = value if isinstance(value, str) else told
    with h5py.File(path) as file:
        records = [text_of(file, f"trial_0000{number}/record/json") for number in (1, 2)]
    journal = found["journal/data"]
    assert journal.startswith(own["journal.jsonl"])
    assert journal.count("\n") == own["journal.jsonl"].count("\n") + 1
    notes = {
        "source_001": ("toml", "benches/tiny.toml", header.sources["benches/tiny.toml"]),
        "source_002": ("toml", "tiny.toml", header.sources["tiny.toml"]),
        "journal": ("jsonl", "journal.jsonl", journal),
        "plan": ("jsonl", "plan.jsonl", own["plan.jsonl"]),
        "plan_trials": ("jsonl", "plan-trials.jsonl", own["plan-trials.jsonl"]),
        "trees": ("jsonl", "plan-trees.jsonl", own["plan-trees.jsonl"]),
        "index": ("jsonl", "index.jsonl", "".join(f"{record}\n" for record in records)),
    }
    for note, (kind, name, data) in notes.items():
        told = {"type": f"application/{kind}", "file_name": name, "data": data}
        expected |= {f"{note}/{place}": text for place, text in told.items()}
    texts = {place: sha256(str(text)) for place, text in expected.items()}
    seal = json.loads(str(found.pop("outcome/seal")))
    assert seal == {"format": 3, "run": header.name, "texts": texts}
    whole, digest = path.read_bytes(), str(found.pop("outcome/file_sha256"))
    assert whole.count(digest.encode()) == 1
    blank = whole.replace(digest.encode(), b"0" * 64)
    assert hashlib.sha256(blank).hexdigest() == digest
    assert found == expected


def test_the_groups_of_a_run_have_their_classes_and_its_root_says_what_made_it(tmp_path, kit):
    with h5py.File(kit.run(tmp_path, [20])) as file:
        run = file["run"]
        collections = {"provenance", "outcome"}
        notes = {name for name in run if isinstance(run[name], h5py.Group)} - collections
        assert {"journal", "plan", "index", "trees", "source_001"} <= notes
        assert {run[name].attrs["NX_class"] for name in notes} == {"NXnote"}
        assert {run[name].attrs["NX_class"] for name in collections} == {"NXcollection"}
        assert run.attrs["NX_class"] == "NXentry"
        assert file.attrs["file_time"] == kit.CREATED
        assert run["program_name"].attrs["version"] == "0.1.0"  # of the header
        assert "version" not in run["title"].attrs
        assert "not_kept" not in run


def test_a_run_that_does_not_know_its_version_says_so(tmp_path, kit):
    with h5py.File(kit.run(tmp_path, [20], versions={})) as file:
        assert file["run/program_name"].attrs["version"] == "unknown"


@pytest.mark.parametrize(
    ("fields", "title"),
    [
        ({}, "A tiny run: 20 °/s"),
        ({"title": ""}, "tiny"),
        ({"title": "", "protocol_name": ""}, "2026-11-21T09-36-58-tiny"),
    ],
)
def test_a_run_without_a_title_has_its_protocols_name_or_its_own(tmp_path, kit, fields, title):
    assert texts_of(kit.run(tmp_path, [], **fields))["title"] == title


def test_attempts_stand_in_the_index_in_the_order_in_which_they_were_made(tmp_path, kit):
    """Ten attempts, of which texts would put the tenth behind the first."""
    writer, trials = kit.begin(tmp_path, 3)
    kit.record(writer, trials[2], 5)
    for count in range(1, 12):
        attempt(writer, kit, trials[1], Outcome.FAULT, count)
    attempt(writer, kit, trials[1], Outcome.COMPLETED, 12)
    kit.record(writer, trials[0], 5)
    found = texts_of(seal(writer))
    index = [json.loads(line) for line in str(found["index/data"]).splitlines()]
    told = [(line["trial"]["number"], line["attempt"]) for line in index]
    assert told == [(1, 1), *((2, number) for number in range(1, 13)), (3, 1)]
    assert [line["samples"] for line in index] == [5, *range(1, 13), 5]
    assert (found["outcome/trials_finished"], found["outcome/trials_failed"]) == (3, 0)


def test_a_bench_that_was_changed_after_planning_stands_with_the_planned_one(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 3)
    changed = trials[1].model_copy(update={"bench": {"name": "tiny", "axis": {"inertia": 36.0}}})
    attempt(writer, kit, changed, Outcome.COMPLETED)
    path = seal(writer)
    lines = str(texts_of(path)["trees/data"]).splitlines()
    trees = {line["sha256"]: line["tree"] for line in map(json.loads, lines)}
    benches = [tree for tree in trees.values() if tree.get("name") == "tiny"]
    assert changed.bench in benches
    assert trials[0].bench in benches
    assert open_run(path).trials[0].trial == changed
    assert [open_run(path).planned(trial.number) for trial in trials] == trials


def shown(path: Path) -> str | None:
    with h5py.File(path) as file:
        return file.attrs.get("default")


def test_a_viewer_opens_the_first_completed_measurement(tmp_path, kit):
    """Not the warming up before it, nor one that failed."""
    trials = [kit.trial(number) for number in (1, 2, 3, 4)]
    trials[0] = trials[0].model_copy(update={"role": Role.WARM_UP})
    writer, _ = kit.begin(tmp_path, trials, [10])
    attempt(writer, kit, trials[1], Outcome.FAULT)
    kit.record(writer, trials[3], 10)
    attempt(writer, kit, trials[2], Outcome.LIMIT)
    assert shown(seal(writer)) == "trial_00004"


def test_without_a_completed_measurement_it_opens_the_first_one_with_samples(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 3)
    writer.begin(trials[0]).finish(Ending(Outcome.FAULT), kit.STARTED, kit.ENDED)
    kit.record(writer, trials[0], None)
    for trial in trials[1:]:
        attempt(writer, kit, trial, Outcome.FAULT)
    assert shown(seal(writer)) == "trial_00002"


def test_without_any_samples_it_opens_nothing(tmp_path, kit):
    path = kit.run(tmp_path, [None])
    assert shown(path) is None
    assert verify_run(path).trials == 1


def test_of_samples_that_are_not_kept_the_run_says_why(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 3)
    for trial in trials[:2]:
        kit.recorded(writer, trial, 20, kit.CHANNELS, SampleRetention("none"))
    kit.record(writer, trials[2], 10)
    path = seal(writer)
    found = texts_of(path)
    assert found["not_kept/type"] == "application/json"
    assert found["not_kept/file_name"] == "not-kept.json"
    assert found["not_kept/data"] == f'{{"trial_00001":"{NONE}","trial_00002":"{NONE}"}}'
    with h5py.File(path) as file:
        assert set(file) == {"run", "trial_00003"}
        assert file["run/not_kept"].attrs["NX_class"] == "NXnote"
    assert shown(path) == "trial_00003"
    assert len(str(found["index/data"]).splitlines()) == 3
    seal_texts = json.loads(str(found["outcome/seal"]))["texts"]
    assert not [place for place in seal_texts if place.startswith("not_kept")]


def test_each_bench_is_described_once_and_a_trial_without_the_channels_not_at_all(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 4, [10])
    trials[2] = trials[2].model_copy(update={"bench": {"name": "another"}})
    for trial in trials[1:]:
        kit.recorded(writer, trial, (np.arange(9.0), np.zeros((len(CHANNELS), 9))), CHANNELS)
    path = seal(writer)
    assert [nxvalidate(path, number)[:2] for number in (2, 3, 4)] == [(0, 0)] * 3
    with h5py.File(path) as file:
        assert not {"definition", "instrument"} & set(file["trial_00001"])
        for name in ("definition", "instrument"):
            second, third, fourth = (file[f"trial_0000{number}/{name}"] for number in (2, 3, 4))
            assert second == fourth != third
        names = [file[f"trial_0000{n}/instrument/name"][()] for n in (2, 3, 4)]
    assert names == [b"tiny", b"another", b"tiny"]


@pytest.fixture
def one(tmp_path, kit) -> tuple[Path, SealedFile, list]:
    """A folder of two finished trials, and a sealed file that was begun beside it."""
    writer, _ = kit.begin(tmp_path, 2, [40] * 2)
    writer.close()
    attempts = list(read_journal(writer.folder / JOURNAL).attempts)
    return writer.folder, SealedFile(tmp_path / "new.part"), attempts


def test_a_copy_is_told_of_with_where_its_samples_lie(one):
    folder, file, (first, _) = one
    file.copy(folder, first, "trial_00001_attempt_1")
    assert file.copied == {"trial_00001_attempt_1": first}
    assert file.placed.keys() == {"trial_00001_attempt_1"}
    placed = file.placed["trial_00001_attempt_1"]
    units = {"time": "s", "command": "rad/s", "gyro_rate": "rad/s", "friction_torque": "N m"}
    assert {key: unit for key, (unit, _) in placed.items()} == {
        ("data", name): unit for name, unit in units.items()
    }
    assert len({layout for _, layout in placed.values()}) == 4
    for _, ((offset, size),) in placed.values():
        assert offset > 0
        assert size > 0
    file.discard()


def test_it_is_part_of_a_run_whose_attempts_have_the_same_names(one):
    folder, file, (first, second) = one
    assert file.is_part_of({})
    file.copy(folder, first, "trial_00001")
    assert file.is_part_of({"trial_00001": first})
    assert file.is_part_of({"trial_00001": first, "trial_00002": second})
    assert not file.is_part_of({"trial_00001": second})
    assert not file.is_part_of({"trial_00001_attempt_1": first})
    assert not file.is_part_of({})
    file.discard()


def test_whoever_discards_it_leaves_no_file_and_may_do_it_again(one, tmp_path):
    folder, file, (first, _) = one
    file.copy(folder, first, "trial_00001")
    assert (tmp_path / "new.part").exists()
    file.discard()
    assert not (tmp_path / "new.part").exists()
    assert not file._file  # no handle is left open
    file.discard()


@pytest.mark.parametrize(
    ("key", "said"),
    [("sha256", "is not what the journal says"), ("record", "/trial_00001/record/json: does not")],
)
def test_a_file_or_record_that_is_not_that_of_the_journal_is_not_copied(one, key, said):
    folder, file, (first, _) = one
    other = first.model_copy(update={key: "0" * 64})
    with pytest.raises(ArchiveError, match=rf"trial-00001\.trial: {said}"):
        file.copy(folder, other, "trial_00001")
    assert (file.copied, list(file._file)) == ({}, [])
    file.discard()
