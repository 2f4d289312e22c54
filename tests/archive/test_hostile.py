"""A file that nobody vouches for is read right or refused with a message: never anything else."""

import hashlib
import json
import random
import re

import h5py
import numpy as np
import pytest

from campaign.archive import RunWriter, list_runs, open_run
from campaign.errors import ArchiveError, ExitCode


def read_all(path):
    """Everything a report would read, by trial."""
    return {archived.trial.number: archived.recording() for archived in open_run(path).trials}


def refused(path, match):
    with pytest.raises(ArchiveError, match=match) as caught:
        read_all(path)
    assert str(path) in str(caught.value)
    assert caught.value.exit_code is ExitCode.ARCHIVE
    assert "\n" not in str(caught.value)


def listed(path, match):
    """What is damaged is told of in a line, and everything else can be read; returns the run."""
    run = open_run(path)
    told = [str(damage) for damage in run.damaged]
    assert any(re.search(match, line) for line in told), told
    assert all("\n" not in line and str(path) not in line for line in told)
    for archived in run.trials:
        archived.recording()
    return run


@pytest.mark.parametrize("content", [b"", b"not an archive", b"\x89HDF\r\n\x1a\n" + b"\xff" * 500])
def test_what_is_not_hdf5_is_refused(tmp_path, content):
    path = tmp_path / "run.nxs"
    path.write_bytes(content)
    refused(path, "cannot be read|is not an archive")


def test_what_is_not_there_is_refused(tmp_path):
    refused(tmp_path / "run.nxs", "no such file")


def test_hdf5_that_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "other.nxs"
    with h5py.File(path, "w") as file:
        file["x"] = 1.0
    refused(path, "/run: is missing")


@pytest.mark.parametrize("share", [0.01, 0.3, 0.6, 0.9, 0.999])
def test_a_truncated_file_is_refused(sealed, share):
    content = sealed.read_bytes()
    sealed.write_bytes(content[: int(share * len(content))])
    refused(sealed, "cannot be read|is not an archive")


def test_a_newer_format_is_named(sealed):
    with h5py.File(sealed, "r+") as file:
        replace_integer(file["run/provenance"], "format", 99)
    refused(sealed, "has format 99")


def put_text(file, place, text):
    """Put another text where one is, with a checksum that holds."""
    del file[place]
    kind = h5py.string_dtype("utf-8", max(1, len(text)))
    file.create_dataset(place, data=np.array(text.encode(), dtype=kind))
    file[place].attrs["sha256"] = hashlib.sha256(text.encode()).hexdigest()


def replace_integer(group, name, value):
    del group[name]
    group[name] = np.array(value, "<i8")
    group[name].attrs["sha256"] = hashlib.sha256(np.array(value, "<i8").tobytes()).hexdigest()


def replace_samples(file, **options):
    """Replace a channel by a dataset made some other way, with its attributes."""
    data = file["trial_00001/data"]
    attributes = {k: v for k, v in data["gyro_rate"].attrs.items() if k != "DIMENSION_LIST"}
    del data["gyro_rate"]
    dataset = data.create_dataset("gyro_rate", **options)
    dataset.attrs.update(attributes)


def test_an_absurd_size_is_refused_before_memory_is_asked_for(sealed):
    with h5py.File(sealed, "r+") as file:
        replace_samples(file, shape=(2**50,), chunks=(1000,), dtype="<f8")
    refused(sealed, "states 1125899906842624 samples but stores 0 bytes")


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"data": np.zeros(50, "<f4"), "chunks": (50,)}, "not a chunked series of float64"),
        ({"data": np.zeros((50, 2)), "chunks": (50, 2)}, "not a chunked series of float64"),
        ({"data": [b"x"] * 50, "dtype": h5py.string_dtype()}, "not a chunked series"),
        ({"data": np.zeros(49), "chunks": (49,)}, "has 49 samples, and time has 50"),
        ({"data": np.zeros(50), "chunks": (50,)}, "does not match its checksum"),
        ({"data": np.zeros(50), "chunks": (50,), "compression": "lzf"}, "a filter other than"),
    ],
)
def test_samples_of_another_kind_are_refused(sealed, options, match):
    with h5py.File(sealed, "r+") as file:
        replace_samples(file, **options)
    refused(sealed, match)


def test_no_object_is_ever_read(sealed):
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001/record/reason"]
        file["trial_00001/record"].create_dataset(
            "reason", data=b"cos\nsystem\n", dtype=h5py.string_dtype()
        )
    run = listed(sealed, "^/trial_00001/record/reason: is not a text of fixed length")
    assert [trial.trial.number for trial in run.trials] == [2]


def test_links_are_not_followed(sealed, tmp_path):
    other = tmp_path / "other.h5"
    with h5py.File(sealed) as file, h5py.File(other, "w") as target:
        file.copy("trial_00001", target, "trial_00001")
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001"]
        file["trial_00001"] = h5py.ExternalLink(str(other), "/trial_00001")
    assert len(listed(sealed, "^/trial_00001: is a link").trials) == 1
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001"]
        file["trial_00001"] = h5py.SoftLink("/trial_00002")
    assert len(listed(sealed, "^/trial_00001: is a link").trials) == 1


@pytest.mark.parametrize("name", ["/trial_00001/data/command", "aside/command", ".", "", "x"])
def test_a_channel_is_not_looked_for_along_a_path(sealed, name):
    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data/aside"] = h5py.SoftLink("/trial_00002/data")
        channel = {"name": name, "unit": "", "label": "", "display_unit": "", "measured": True}
        put_text(file, "trial_00001/record/channels", json.dumps([channel]))
    refused(sealed, "is a path, not a name|is missing")


def test_samples_in_another_file_are_not_opened(sealed, tmp_path):
    outside = tmp_path / "secret"
    outside.write_bytes(bytes(400))
    with h5py.File(sealed, "r+") as file:
        replace_samples(file, shape=(50,), dtype="<f8", external=[(str(outside), 0, 400)])
    refused(sealed, "lies in another file")
    layout = h5py.VirtualLayout(shape=(50,), dtype="<f8")
    layout[:] = h5py.VirtualSource(str(outside), "x", shape=(50,))
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001/data/gyro_rate"]
        file["trial_00001/data"].create_virtual_dataset("gyro_rate", layout)
    refused(sealed, "lies in another file")


NONSENSE = ["", "nonsense", "[" * 20_000, '{"a":1}', "NaN"]


@pytest.mark.parametrize(
    "place",
    [
        "run/provenance/created",
        "run/outcome/status",
        "trial_00001/record/events",
        "trial_00001/record/channels",
    ],
)
@pytest.mark.parametrize("text", NONSENSE)
def test_text_that_is_not_what_belongs_there_is_refused(sealed, place, text):
    with h5py.File(sealed, "r+") as file:
        put_text(file, place, text)
    refused(sealed, "record|provenance|/run|trial_00001")


@pytest.mark.parametrize("place", ["provenance/tests", "plan/data", "journal/data"])
@pytest.mark.parametrize("text", NONSENSE)
def test_a_text_of_the_run_that_is_damaged_costs_only_itself(sealed, place, text):
    with h5py.File(sealed, "r+") as file:
        put_text(file, f"run/{place}", text)
    run = open_run(sealed)
    if text or place != "plan/data":
        run = listed(sealed, f"^/run/{place.removesuffix('/data')}|plan, line 1")
    assert (run.tests == ()) is (place == "provenance/tests")
    assert (run.plan == ()) is (place == "plan/data")
    assert len(run.trials) == 2


@pytest.mark.parametrize("place", ["trial", "outcome", "safe_state"])
@pytest.mark.parametrize("text", NONSENSE)
def test_a_trial_whose_record_is_damaged_costs_only_itself(sealed, place, text):
    with h5py.File(sealed, "r+") as file:
        put_text(file, f"trial_00001/record/{place}", text)
    run = listed(sealed, "^/trial_00001")
    assert [trial.trial.number for trial in run.trials] == [2]
    assert {damage.trial for damage in run.damaged} == {"trial-00001"}


def test_a_text_without_its_checksum_is_not_believed(sealed):
    with h5py.File(sealed, "r+") as file:
        for place in ("run/provenance/notes", "run/source_001/data"):
            del file[place].attrs["sha256"]
        put_text(file, "run/provenance/operator", "Eve")
        file["run/provenance/operator"].attrs["sha256"] = "0" * 64
    run = listed(sealed, "^/run/provenance/operator: does not match its checksum")
    assert len(run.damaged) == 3
    assert run.header.operator == ""
    assert len(run.header.sources) == 1


@pytest.mark.parametrize("name", ["run", "run/provenance", "run/outcome"])
def test_a_missing_group_is_named(sealed, name):
    with h5py.File(sealed, "r+") as file:
        del file[name]
    refused(sealed, f"/{name}: is missing")


@pytest.mark.parametrize("name", ["trial_00001", "trial_00001/record", "run/journal", "run/plan"])
def test_a_missing_group_that_the_rest_can_do_without_is_listed(sealed, name):
    with h5py.File(sealed, "r+") as file:
        del file[name]
    run = listed(sealed, f"^/{name}: is missing")
    assert len(run.trials) == (1 if name.startswith("trial") else 2)


def test_an_archive_from_before_a_trial_had_a_field_still_opens(sealed):
    with h5py.File(sealed, "r+") as file:
        tree = json.loads(file["trial_00001/record/trial"][()])
        del tree["task"]["start_angle"], tree["note"]
        put_text(file, "trial_00001/record/trial", json.dumps(tree))
        what = {key: tree[key] for key in ("bench", "seed", "task")}
        digest = hashlib.sha256(json.dumps(what, separators=(",", ":"), sort_keys=True).encode())
        put_text(file, "trial_00001/record/fingerprint", digest.hexdigest())
    assert open_run(sealed).trials[0].trial.task.start_angle == 0.0


def test_a_trial_that_is_not_what_ran_is_left_out(sealed):
    with h5py.File(sealed, "r+") as file:
        tree = json.loads(file["trial_00001/record/trial"][()])
        tree["bench"]["axis"]["inertia"] = 36.0
        put_text(file, "trial_00001/record/trial", json.dumps(tree))
    listed(sealed, "^/trial_00001/record: does not match its fingerprint")


def test_a_flipped_sample_is_named_by_trial_and_channel(sealed):
    with h5py.File(sealed, "r+") as file:
        dataset = file["trial_00002/data/friction_torque"]
        values = dataset[:]
        values[60] = np.nextafter(values[60], np.inf)
        dataset[:] = values
    refused(sealed, "/trial_00002/data/friction_torque: does not match its checksum")
    run = open_run(sealed)
    assert len(run.trials[0].recording().time) == 50
    assert len(run.problems()) == 1
    assert not run.unchanged()


def test_mutated_files_are_read_right_or_refused(sealed):
    original = read_all(sealed)
    content = sealed.read_bytes()
    rng = random.Random(2)
    refusals = 0
    for _ in range(60):
        mutated = bytearray(content)
        for _ in range(rng.choice([1, 4, 30])):
            place = rng.randrange(len(mutated) - 8)
            mutated[place : place + 8] = rng.choice([b"\xff" * 8, bytes(8), rng.randbytes(8)])
        sealed.write_bytes(mutated)
        try:
            found = read_all(sealed)
        except ArchiveError:
            refusals += 1
            continue
        for number, recording in found.items():
            assert recording["gyro_rate"].tobytes() == original[number]["gyro_rate"].tobytes()
    assert refusals > 10


def test_a_bad_file_is_listed_and_stalls_nothing(sealed):
    (sealed.parent / "2026-11-20T00-00-00-bad.nxs").write_bytes(b"\x89HDF\r\n\x1a\n")
    (sealed.parent / "2026-11-19T00-00-00-cut.partial").mkdir()
    listed = list_runs(sealed.parent)
    assert [bool(run.problem) for run in listed] == [True, True, False]
    assert listed[2].name == sealed.stem


def test_a_journal_cannot_name_a_file_outside_its_folder(tmp_path, kit):
    writer = RunWriter.create(tmp_path, kit.header(), [kit.trial(1)])
    kit.record(writer, kit.trial(1), 5)
    journal = writer.folder / "journal.jsonl"
    lines = journal.read_text().splitlines()
    entry = json.loads(lines[1]) | {"file": "../../trial-00001.nxs"}
    journal.write_text("\n".join([lines[0], json.dumps(entry), lines[1]]) + "\n")
    run = listed(writer.folder, "^journal.jsonl:2: is not a line of a journal")
    assert [trial.path.parent for trial in run.trials] == [writer.folder]


def test_a_trial_file_that_is_gone_or_damaged_costs_only_itself(tmp_path, kit):
    trials = [kit.trial(number) for number in (1, 2, 3)]
    writer = RunWriter.create(tmp_path, kit.header(), trials)
    for trial in trials:
        kit.record(writer, trial, 5)
    (writer.folder / "trial-00001.nxs").unlink()
    (writer.folder / "trial-00002.nxs").write_bytes(b"\x89HDF\r\n\x1a\n" * 9)
    run = listed(writer.folder, "^trial-00001.nxs: there is no such file")
    assert [damage.trial for damage in run.damaged] == ["trial-00001", "trial-00002"]
    assert [trial.trial.number for trial in run.trials] == [3]
