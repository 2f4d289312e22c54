"""Something of a run is damaged: what is good is delivered, and what is not is told of.

Damage here is a changed character, whose text keeps the checksums that it had.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import h5py
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.verification.verify_run import verify_run
from campaign.errors import ArchiveError
from campaign.policy import SampleRetention
from campaign.recording import Ending, Fault, Outcome
from tests.archive.forging import put_text, text_of

NONE = "the protocol says keep = none"


@pytest.fixture(scope="module")
def sealed_once(tmp_path_factory: pytest.TempPathFactory, kit) -> Path:
    """Three trials with benches of their own, the second at its second attempt; to be copied."""
    trials = [kit.trial(n).model_copy(update={"bench": {"name": f"bench {n}"}}) for n in (1, 2, 3)]
    writer, _ = kit.begin(tmp_path_factory.mktemp("sealed"), trials, [20])
    lost = Ending(Outcome.FAULT, "lost", fault=Fault.DRIVE)
    kit.recorded(writer, trials[1], kit.samples(30, 99), ending=lost)
    kit.record(writer, trials[1], 40)
    kit.record(writer, trials[2], 50)
    return writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)


@pytest.fixture
def sealed(sealed_once: Path, tmp_path: Path) -> Path:
    """That run, of the test's own."""
    return Path(shutil.copy(sealed_once, tmp_path))


def damage(path: Path, place: str, old: str, new: str) -> None:
    with h5py.File(path, "r+") as file:
        text = text_of(file, place)
        assert text.count(old) >= 1
        put_text(file, place, text.replace(old, new, 1), honest=True)


def check_all(run: RunReader, kit, numbers: tuple[int, ...] = (1, 2, 3)) -> None:
    """These trials are as they were recorded, and so is the earlier attempt."""
    assert [archived.trial.number for archived in run.trials] == list(numbers)
    for archived in run.trials:
        number = archived.trial.number
        time, block = kit.samples(10 + 10 * number + 10 * (number > 1), number)
        assert archived.trial.bench == {"name": f"bench {number}"}
        recording = archived.recording()
        assert recording.time.tobytes() == time.tobytes()
        assert recording["friction_torque"].tobytes() == block[2].tobytes()
    if 2 in numbers:
        [failed] = run.earlier_attempts[2]
        assert failed.ending == Ending(Outcome.FAULT, "lost", fault=Fault.DRIVE)
        assert failed.recording()["command"].tobytes() == kit.samples(30, 99)[1][0].tobytes()


def told(run: RunReader, *patterns: str) -> None:
    """Each line of what is damaged matches a pattern, and the other way about."""
    lines = [str(found) for found in run.damaged]
    for pattern in patterns:
        assert any(re.match(pattern, line) for line in lines), lines
    for line in lines:
        assert any(re.match(pattern, line) for pattern in patterns), line
    assert not verify_run(run.path).sound


MISMATCH = ": does not match its checksum; it was damaged or changed"


def test_a_run_that_is_whole_tells_of_nothing(sealed, kit):
    run = open_run(sealed)
    assert run.damaged == ()
    check_all(run, kit)


@pytest.mark.parametrize("attempt", [1, 2, 3, 4])
def test_a_lost_line_of_the_journal_is_made_up_for_by_the_index(sealed, kit, attempt):
    with h5py.File(sealed) as file:
        lines = text_of(file, "run/journal/data").splitlines()
    finished = [line for line in lines if "trial finished" in line]
    damage(sealed, "run/journal/data", finished[attempt - 1] + "\n", "")
    run = open_run(sealed)
    check_all(run, kit)
    told(run, f"/run/journal/data{MISMATCH}", "/run/journal: is not a whole journal")


def test_without_journal_and_index_no_trial_is_known_and_that_is_said(sealed):
    """Nothing else vouches for a record."""
    damage(sealed, "run/journal/data", "started", "s_arted")
    damage(sealed, "run/index/data", "seed", "s_ed")
    run = open_run(sealed)
    assert run.trials == ()
    told(run, f"/run/(journal|index)/data{MISMATCH}", "/run/journal: is not a whole journal")
    assert (run.status, run.header.protocol_name) == (RunStatus.COMPLETE, "tiny")


INDEX, TREES = "run/index/data", "run/trees/data"
TREE_OF_GROUP = "/trial_00001/record/trees: line . does not match"


def numbered(place: str, number: int = 1) -> tuple[str, str, str]:
    return place, f'"number":{number},', f'"number":{number + 5},'


@pytest.mark.parametrize(
    ("damages", "left", "lines"),
    [
        *(
            ([("run/journal/data", word, "_" * len(word))], (1, 2, 3),
             [f"/run/journal/data{MISMATCH}", "/run/journal: is not a whole journal"])
            for word in ("started", "finished")
        ),
        # A line of the index is read from the trial's own group; both of them cost one trial.
        *(([numbered(INDEX, n)], (1, 2, 3), [f"/run/index/data{MISMATCH}"]) for n in (1, 2, 3)),
        ([numbered(INDEX), numbered("trial_00001/record/json")], (2, 3),
         [f"/run/index/data{MISMATCH}", f"/trial_00001/record/json{MISMATCH}"]),
        # And so is a tree, which costs its trials where it is damaged everywhere.
        ([(TREES, "bench 1", "bench 9")], (1, 2, 3), [f"/run/trees/data{MISMATCH}"]),
        ([(TREES, "bench 1", "bench 9"), ("trial_00001/record/trees", "bench 1", "bench 9")],
         (2, 3), [f"/run/trees/data{MISMATCH}", TREE_OF_GROUP]),
    ],
)  # fmt: skip
def test_what_a_damaged_text_costs(sealed, kit, damages, left, lines):
    for each in damages:
        damage(sealed, *each)
    run = open_run(sealed)
    check_all(run, kit, left)
    told(run, *lines)
    lost = {"trial-00001"} if len(left) == 2 else set()
    assert {found.trial for found in run.damaged} - {""} == lost
    if damages[0][0] == TREES:
        with pytest.raises(ArchiveError, match=f"/run/trees/data{MISMATCH}"):
            run.planned(1)


def test_an_index_that_is_gone_is_read_from_the_trials_own_groups(sealed, kit):
    with h5py.File(sealed, "r+") as file:
        del file["run/index"]
    run = open_run(sealed)
    check_all(run, kit)
    told(run, "/run/index: is missing")


def test_a_damaged_record_in_a_group_costs_nothing_and_verifying_names_it(sealed, kit):
    damage(sealed, "trial_00001/record/json", '"number":1,', '"number":7,')
    run = open_run(sealed)
    check_all(run, kit)
    assert run.damaged == ()
    places = [found.place for found in verify_run(sealed).problems]
    assert "/trial_00001/record/json" in places


def test_a_damaged_seal_leaves_each_text_its_own_checksum(sealed, kit):
    damage(sealed, "run/outcome/seal", '"run":', '"rum":')
    run = open_run(sealed)
    check_all(run, kit)
    told(run, f"/run/outcome/seal{MISMATCH}")
    assert run.root == ""
    assert run.header == kit.header().model_copy(update={"trials": 3})
    assert [planned.number for planned in run.plan] == [1, 2, 3]
    damage(sealed, "run/title", "A tiny run", "A tidy run")
    damage(sealed, "run/provenance/operator", "Ada", "Eva")
    told(open_run(sealed), f"/run/(outcome/seal|provenance/operator){MISMATCH}")


@pytest.mark.parametrize("text", ["", "[]", "nonsense", '{"format":3}', "[" * 90_000])
def test_a_seal_that_is_none_leaves_each_text_its_own_checksum(sealed, kit, text):
    with h5py.File(sealed, "r+") as file:
        put_text(file, "run/outcome/seal", text)
    run = open_run(sealed)
    check_all(run, kit)
    told(run, "/run/outcome/seal: ")
    assert run.root == ""


def test_a_lost_line_of_a_folders_journal_is_listed_and_the_rest_is_read(tmp_path, kit):
    writer, _ = kit.begin(tmp_path, 2, [20] * 2)
    writer.close()
    journal = writer.folder / "journal.jsonl"
    journal.write_text(journal.read_text().replace('"trial":1}', '"trial":x}'))
    run = open_run(writer.folder)
    assert [archived.trial.number for archived in run.trials] == [2]
    told(run, "journal.jsonl:2: is not a line of a journal")


def test_a_trial_file_that_was_exchanged_for_another_is_not_read_for_it(tmp_path, kit):
    """Each of them is whole; the journal names the record of each."""
    writer, _ = kit.begin(tmp_path, 2, [20] * 2)
    writer.close()
    first, second = (writer.folder / f"trial-0000{n}.trial" for n in (1, 2))
    first.unlink()
    second.rename(first)
    run = open_run(writer.folder)
    assert run.trials == ()
    told(
        run,
        f"trial-00001.trial/trial_00001/record/json{MISMATCH}",
        "trial-00002.trial: there is no",
    )


def test_records_are_only_in_the_index_when_samples_were_not_kept(tmp_path, kit):
    """So a damaged index costs such a trial, and that is said."""
    writer, trials = kit.begin(tmp_path, 2)
    kit.recorded(writer, trials[0], 20, kit.CHANNELS, SampleRetention("none"))
    kit.record(writer, trials[1], 20)
    path = writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    with h5py.File(path) as file:
        assert json.loads(text_of(file, "run/not_kept/data")) == {"trial_00001": NONE}
    damage(path, "run/index/data", '"number":1,', '"number":7,')
    run = open_run(path)
    assert [archived.trial.number for archived in run.trials] == [2]
    told(run, f"/run/index/data{MISMATCH}", "/trial_00001: is missing")
