"""A file that nobody vouches for is read right or refused with a message: never anything else."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import list_runs
from campaign.archive.reading.sound_samples import whole_recording
from campaign.archive.verification.verify_run import verify_run
from campaign.errors import ArchiveError, ExitCode
from tests.archive.forging import (
    canonical,
    change_record,
    put_record,
    put_samples,
    put_text,
    reseal,
    sha256,
    text_of,
)
from tests.archive.test_kept import KEPT


def read_all(path):
    """Everything a report would read, by trial."""
    trials = open_run(path).trials
    return {archived.trial.number: whole_recording(archived) for archived in trials}


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
        whole_recording(archived)
    return run


def placed(path, match):
    """Verifying tells of it in a line that begins with its place."""
    told = [str(damage) for damage in verify_run(path).problems]
    assert any(re.match(match, line) for line in told), told


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
    kept = content[: int(share * len(content))]
    sealed.write_bytes(kept)
    refused(sealed, f"is cut off: {len(kept)} of {len(content)} bytes are there; copy it again")


def test_an_absurd_size_is_refused_before_memory_is_asked_for(sealed):
    with h5py.File(sealed, "r+") as file:
        absurd = {"shape": (2**50,), "chunks": (1000,), "compression": "gzip", "dtype": "<f8"}
        put_samples(file, "trial_00001/data/gyro_rate", **absurd)
    refused(sealed, "has 1125899906842624 samples, and 50 were recorded")
    with h5py.File(sealed, "r+") as file:
        change_record(file, "trial_00001", lambda record: record.update(samples=2**50))
    refused(sealed, "has 50 samples, and 1125899906842624 were recorded")


def test_an_absurd_size_that_the_record_confirms_is_refused(sealed):
    """Time and record agree with it, and nothing of it is stored."""
    with h5py.File(sealed, "r+") as file:
        data = file["trial_00001/data"]
        del data["time"]
        data.create_dataset("time", (2**50,), "<f8", chunks=(1000,), compression="gzip")
        data["time"].attrs["units"] = "s"
        change_record(file, "trial_00001", lambda record: record.update(samples=2**50))
    refused(sealed, "/trial_00001.*: cannot be read")


def test_a_chunk_that_would_take_all_memory_is_refused(sealed):
    with h5py.File(sealed, "r+") as file:
        huge = {"maxshape": (None,), "chunks": (1 << 28,), "compression": "gzip", "dtype": "<f8"}
        put_samples(file, "trial_00001/data/gyro_rate", shape=(50,), **huge)
    refused(sealed, "has chunks of 268435456 samples")


PACKED = {"compression": "gzip", "chunks": (50,)}


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"data": np.zeros(50, "<f4"), **PACKED}, "not a chunked series of float64"),
        ({"data": np.zeros(50, ">f8"), **PACKED}, "not a chunked series of float64"),
        ({"data": np.zeros(50, "<i8"), **PACKED}, "not a chunked series of float64"),
        ({"data": np.zeros((50, 2)), **PACKED, "chunks": (50, 2)}, "not a chunked series"),
        ({"data": [b"x"] * 50, "dtype": h5py.string_dtype(), **PACKED}, "not a chunked series"),
        ({"data": np.zeros(50)}, "not a chunked series"),
        ({"data": np.zeros(49), **PACKED, "chunks": (49,)}, "has 49 samples, and 50 were recorded"),
        ({"data": np.zeros(50), **PACKED}, "does not match its checksum"),
        ({"data": np.zeros(50), "chunks": (50,)}, "a filter other than"),
        ({"data": np.zeros(50), "chunks": (50,), "compression": "lzf"}, "a filter other than"),
        ({"data": np.zeros(50), **PACKED, "fletcher32": True}, "a filter other than"),
    ],
)
def test_samples_of_another_kind_are_refused(sealed, options, match):
    with h5py.File(sealed, "r+") as file:
        put_samples(file, "trial_00001/data/gyro_rate", **options)
    refused(sealed, f"/trial_00001/data/gyro_rate: .*{match}")


def test_samples_that_another_program_packed_are_read(sealed):
    """What counts are the samples, not the bytes: the digest is of numbers."""
    with h5py.File(sealed, "r+") as file:
        samples = file["trial_00001/data/gyro_rate"][:]
        other = {"shuffle": True, "compression": "gzip", "compression_opts": 9, "chunks": (7,)}
        put_samples(file, "trial_00001/data/gyro_rate", data=samples, **other)
    found = read_all(sealed)[1]["gyro_rate"]
    assert found.tobytes() == samples.tobytes()
    assert not [damage for damage in verify_run(sealed).problems if damage.trial]


def test_no_object_is_ever_read(sealed):
    with h5py.File(sealed, "r+") as file:
        for place in ("run/plan/data", "trial_00001/record/json"):
            del file[place]
            file.create_dataset(place, data=b"cos\nsystem\n", dtype=h5py.string_dtype())
    run = listed(sealed, "^/run/plan/data: is not a text of fixed length")
    assert [trial.trial.number for trial in run.trials] == [1, 2]
    placed(sealed, "/trial_00001/record/json: is not a text of fixed length")


@pytest.mark.parametrize("kind", ["external", "soft"])
def test_links_are_not_followed(sealed, tmp_path, kind):
    other = tmp_path / "other.h5"
    with h5py.File(sealed) as file, h5py.File(other, "w") as target:
        file.copy("trial_00001", target, "trial_00001")
        file.copy("trial_00001", target, "trial_00002")
    with h5py.File(sealed, "r+") as file:
        file.move("trial_00001", "aside")
        link = h5py.ExternalLink(str(other), "/trial_00001")
        file["trial_00001"] = link if kind == "external" else h5py.SoftLink("/aside")
    refused(sealed, "/trial_00001: is a link, and links are not followed")
    placed(sealed, "/trial_00001: is a link")
    assert len(whole_recording(open_run(sealed).trials[1]).time) == 120
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001"]
        file.move("aside", "trial_00001")
        file.move("trial_00001/data/command", "aside")
        link = h5py.ExternalLink(str(other), "/trial_00001/data/command")
        file["trial_00001/data/command"] = link if kind == "external" else h5py.SoftLink("/aside")
    refused(sealed, "/trial_00001/data/command: is a link, and links are not followed")


@pytest.mark.parametrize("name", ["/trial_00001/data/command", "aside/command", ".", "..", "", "x"])
def test_a_channel_is_not_looked_for_along_a_path(sealed, name):
    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data/aside"] = h5py.SoftLink("/trial_00002/data")
        change_record(file, "trial_00001", lambda record: record["channels"][0].update(name=name))
    refused(sealed, "/trial_00001.*: (is missing|is a path, not a name|cannot be read)")


def test_samples_in_another_file_are_not_opened(sealed, tmp_path):
    outside = tmp_path / "secret"
    outside.write_bytes(bytes(400))
    with h5py.File(sealed, "r+") as file:
        put_samples(
            file,
            "trial_00001/data/gyro_rate",
            shape=(50,),
            dtype="<f8",
            external=[(str(outside), 0, 400)],
        )
    refused(sealed, "/gyro_rate: is not a chunked series")
    layout = h5py.VirtualLayout(shape=(50,), dtype="<f8")
    layout[:] = h5py.VirtualSource(str(outside), "x", shape=(50,))
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001/data/gyro_rate"]
        file["trial_00001/data"].create_virtual_dataset("gyro_rate", layout)
    refused(sealed, "/gyro_rate: is not a chunked series")


NONSENSE = ["", "nonsense", "[" * 20_000, '{"a":1}', "NaN"]


@pytest.mark.parametrize("place", ["provenance/created", "outcome/status", "outcome/safe_state"])
@pytest.mark.parametrize("text", NONSENSE)
@pytest.mark.parametrize("anew", [False, True])
def test_text_that_is_not_what_belongs_there_is_refused(sealed, place, text, anew):
    """Also where the seal says that it belongs there."""
    with h5py.File(sealed, "r+") as file:
        put_text(file, f"run/{place}", text)
        if anew:
            reseal(file)
    refused(sealed, "/run" if anew else f"/run/{place}: does not match its checksum")


@pytest.mark.parametrize("place", ["provenance/tests", "plan/data", "journal/data"])
@pytest.mark.parametrize("text", NONSENSE)
@pytest.mark.parametrize("anew", [False, True])
def test_a_text_of_the_run_that_is_damaged_costs_only_itself(sealed, place, text, anew):
    with h5py.File(sealed, "r+") as file:
        put_text(file, f"run/{place}", text)
        if anew:
            reseal(file)
    run = open_run(sealed)
    if text or not anew or place != "plan/data":  # an empty plan is one, of no trials
        run = listed(sealed, f"^/run/{place.removesuffix('/data')}|plan, line 1")
    assert (run.tests == ()) is (place == "provenance/tests")
    assert (run.plan == ()) is (place == "plan/data")
    assert [trial.trial.number for trial in run.trials] == [1, 2]


def only_the_first_is_refused(path):
    """All digests hold: opening parses no record; the trial is refused when it is asked for."""
    run = open_run(path)
    assert run.damaged == ()
    with pytest.raises(ArchiveError, match=r": /trial_00001"):
        _ = run.trials[0]
    assert len(whole_recording(run.trials[1]).time) > 0
    placed(path, "/trial_00001")


@pytest.mark.parametrize("place", ["trial", "outcome", "safe_state", "channels", "events"])
@pytest.mark.parametrize("value", ["", "nonsense", [[[1]]], {"a": 1}, 1.5, None])
def test_a_record_that_makes_no_sense_costs_only_its_trial(sealed, place, value):
    with h5py.File(sealed, "r+") as file:
        change_record(file, "trial_00001", lambda record: record.update({place: value}))
    only_the_first_is_refused(sealed)


@pytest.mark.parametrize("text", NONSENSE)
def test_a_record_that_is_none_costs_only_its_trial(sealed, text):
    with h5py.File(sealed, "r+") as file:
        put_record(file, "trial_00001", text)
        reseal(file)
    only_the_first_is_refused(sealed)


@pytest.mark.parametrize("kept", [False, True])
def test_a_heap_that_hdf5_would_never_leave_is_damage(sealed, tmp_path, kept):
    """In archives of today, and in older ones, whose checksums are in heaps too."""
    path = shutil.copy(KEPT / "format-3.nxs", tmp_path) if kept else sealed
    damage_heaps(path)
    reading = [sys.executable, "-m", "campaign", "verify", str(path)]
    done = subprocess.run(reading, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == ExitCode.ARCHIVE
    assert "cannot be read: its attributes are damaged" in done.stdout + done.stderr


def damage_heaps(path):
    """Set the size of the free space of every heap to zero: HDF5 steps through it for ever."""
    content = bytearray(Path(path).read_bytes())
    for heap in re.finditer(rb"GCOL\x01\0\0\0", content):
        place = heap.start() + 16
        while int.from_bytes(content[place : place + 2], "little"):  # an object, not free space
            size = int.from_bytes(content[place + 8 : place + 16], "little")
            place += 16 + (size + 7) // 8 * 8
        content[place + 8 : place + 16] = bytes(8)
    Path(path).write_bytes(content)


def test_verifying_names_each_forged_record_of_trials_without_samples(sealed):
    entries = ("trial_00001", "trial_00002")
    with h5py.File(sealed, "r+") as file:
        for entry in entries:
            change_record(file, entry, lambda record: record.update({"channels": 1.5}))
        for entry in entries:
            del file[entry]
        put_text(file, "run/not_kept/type", "application/json")
        put_text(file, "run/not_kept/file_name", "not-kept.json")
        put_text(file, "run/not_kept/data", json.dumps(dict.fromkeys(entries, "no room")))
    for entry in entries:
        placed(sealed, f"/{entry}: channels: ")


def test_a_text_is_held_against_the_seal_whatever_its_own_checksum_says(sealed):
    with h5py.File(sealed, "r+") as file:
        for place in ("run/provenance/notes", "run/source_001/data"):
            del file[place].attrs["sha256"]
        put_text(file, "run/provenance/operator", "Eve")
    run = listed(sealed, "^/run/provenance/operator: does not match its checksum")
    assert len(run.damaged) == 1
    assert run.header.operator == ""
    assert len(run.header.sources) == 2


def test_without_the_seal_a_text_needs_its_own_checksum(sealed):
    with h5py.File(sealed, "r+") as file:
        for place in ("run/provenance/notes", "run/source_001/data"):
            del file[place].attrs["sha256"]
        del file["run/outcome/seal"]
        put_text(file, "run/provenance/operator", "Eve", honest=True)
    run = listed(sealed, "^/run/provenance/operator: does not match its checksum")
    assert {damage.place for damage in run.damaged} >= {
        "/run/outcome/seal",
        "/run/provenance/notes@sha256",
        "/run/source_001/data@sha256",
    }
    assert run.header.operator == ""
    assert len(run.header.sources) == 1
    assert run.root == ""


def test_a_text_that_was_not_sealed_is_not_believed(sealed):
    with h5py.File(sealed, "r+") as file:
        put_text(file, "run/source_003/data", "[evil]")
        put_text(file, "run/source_003/file_name", "evil.toml")
    run = listed(sealed, "^/run/source_003/file_name: was not there when the run was sealed")
    assert "evil.toml" not in run.header.sources


@pytest.mark.parametrize("name", ["run", "run/provenance", "run/outcome"])
def test_a_missing_group_is_named(sealed, name):
    with h5py.File(sealed, "r+") as file:
        del file[name]
    refused(sealed, f"/{name}: is missing")


@pytest.mark.parametrize(
    "name", ["trial_00001", "run/journal", "run/plan", "run/index", "run/trees", "run/outcome/seal"]
)
def test_what_is_missing_and_the_rest_can_do_without_is_listed(sealed, name):
    with h5py.File(sealed, "r+") as file:
        del file[name]
    run = listed(sealed, f"^/{name}.*: is missing")
    assert len(run.trials) == (1 if name.startswith("trial") else 2)


def test_a_trial_whose_own_record_is_gone_is_known_by_the_index(sealed):
    with h5py.File(sealed, "r+") as file:
        del file["trial_00001/record"]
    assert len(read_all(sealed)) == 2
    placed(sealed, "/trial_00001/record: is missing")


def test_an_archive_from_before_a_trial_had_a_field_still_opens(sealed, kit):
    def older(record):
        del record["trial"]["task"]["start_angle"], record["trial"]["note"]
        what = {"bench": kit.trial(1).bench} | {n: record["trial"][n] for n in ("seed", "task")}
        record["fingerprint"] = sha256(canonical(what))

    with h5py.File(sealed, "r+") as file:
        change_record(file, "trial_00001", older)
    assert open_run(sealed).trials[0].trial.task.start_angle == 0.0
    found = [damage.place for damage in verify_run(sealed).problems]
    assert "/trial_00001/record" not in found  # the fingerprint is that of what was stored


def test_a_bench_that_is_not_what_ran_is_not_used(sealed, kit):
    with h5py.File(sealed, "r+") as file:
        trees = text_of(file, "run/trees/data").replace("35.0", "36.0")
        put_text(file, "run/trees/data", trees)
        reseal(file)
    assert open_run(sealed).trials[0].trial.bench == kit.trial(1).bench  # from its own group
    with h5py.File(sealed, "r+") as file:
        put_text(file, "trial_00001/record/trees", trees)
    with pytest.raises(ArchiveError, match=r"/trial_00001/record/trees: line . does not match"):
        _ = open_run(sealed).trials[0]
    assert open_run(sealed).trials[1].trial.number == 2


def test_a_bad_file_is_listed_and_stalls_nothing(sealed):
    (sealed.parent / "2026-11-20T00-00-00-bad.nxs").write_bytes(b"\x89HDF\r\n\x1a\n")
    (sealed.parent / "2026-11-19T00-00-00-cut.partial").mkdir()
    listed = list_runs(sealed.parent)
    assert [bool(run.problem) for run in listed] == [True, True, False]
    assert listed[2].name == sealed.stem


def test_a_journal_cannot_name_a_file_outside_its_folder(tmp_path, kit):
    writer, _ = kit.begin(tmp_path, 1, [5])
    journal = writer.folder / "journal.jsonl"
    lines = journal.read_text().splitlines()
    entry = json.loads(lines[1]) | {"file": "../../trial-00001.trial"}
    journal.write_text("\n".join([lines[0], json.dumps(entry), lines[1]]) + "\n")
    run = listed(writer.folder, "^journal.jsonl:2: is not a line of a journal")
    assert [trial.path.parent for trial in run.trials] == [writer.folder]


def test_a_trial_file_that_is_gone_or_damaged_costs_only_itself(tmp_path, kit):
    writer, _ = kit.begin(tmp_path, 3, [5] * 3)
    writer.close()
    (writer.folder / "trial-00001.trial").unlink()
    (writer.folder / "trial-00002.trial").write_bytes(b"\x89HDF\r\n\x1a\n" * 9)
    run = listed(writer.folder, "^trial-00001.trial: there is no such file")
    assert [damage.trial for damage in run.damaged] == ["trial-00001", "trial-00002"]
    assert [trial.trial.number for trial in run.trials] == [3]
