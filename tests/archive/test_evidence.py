"""A forger at a sealed run: what he changes is found, unless he computes everything anew.

`open_run` lists what it needed and did not believe, a recording refuses what is read of it and was
changed, and `verify_run` finds all of it. Here he always computes the hash of the file anew, so
that nothing is left to that.
"""

from __future__ import annotations

import hashlib
import json
import random
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.sound_samples import whole_recording
from campaign.archive.verification.statement import run_statement
from campaign.archive.verification.verify_run import verify_run
from campaign.errors import ArchiveError
from campaign.recording import Ending, Fault, Outcome
from tests.archive.forging import (
    canonical,
    change_record,
    put_integer,
    put_text,
    rehash,
    reseal,
    series_digest,
    sha256,
    text_of,
)

ENTRIES = ("trial_00001", "trial_00002", "trial_00003", "trial_00003_attempt_1")
CHANNELS = ("command", "gyro_rate", "friction_torque")
EFFORTS = ("none", "checksums", "seal")
"""What he computes anew: nothing; of every text that he changes its own checksum; the seal, too."""


@pytest.fixture(scope="module")
def sealed_once(tmp_path_factory: pytest.TempPathFactory, kit) -> Path:
    """Three trials of 50 samples, the third one at its second attempt; sound; to be copied."""
    writer, trials = kit.begin(tmp_path_factory.mktemp("sealed"), 3)
    lost = Ending(Outcome.FAULT, "lost", fault=Fault.DRIVE)
    kit.recorded(writer, trials[2], kit.samples(50, 99), ending=lost)
    for trial in trials:
        kit.record(writer, trial, 50)
    path = writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)
    assert verify_run(path).sound
    return path


@pytest.fixture
def sealed(sealed_once: Path, tmp_path: Path) -> Path:
    """That run, of the test's own."""
    return Path(shutil.copy(sealed_once, tmp_path))


Put = Callable[[str, str], None]


@dataclass(frozen=True)
class Traces:
    """What an act ought to be found by.

    Attributes:
        verified: a pattern of what verifying tells of.
        unread: entries and channels that are refused when they are read.
        listed: a pattern of what opening lists; empty when it lists nothing.
        unopened: entries that are left out.
    """

    verified: str
    unread: frozenset[tuple[str, str]] = frozenset()
    listed: str = ""
    unopened: frozenset[str] = frozenset()


def _all(*entries: str) -> frozenset[tuple[str, str]]:
    return frozenset((entry, channel) for entry in entries for channel in CHANNELS)


def _exchange(group: h5py.Group, one: str, other: str) -> None:
    group.move(one, "aside")
    group.move(other, one)
    group.move("aside", other)


def exchange_channels(file, rng, put, effort):
    entry, (one, other) = rng.choice(ENTRIES), rng.sample(CHANNELS, 2)
    _exchange(file[f"{entry}/data"], one, other)
    return Traces(f"/{entry}/data/{one}: ", frozenset({(entry, one), (entry, other)}))


def exchange_data(file, rng, put, effort):
    one, other = rng.sample(ENTRIES, 2)
    file.move(f"{one}/data", "aside")
    file.move(f"{other}/data", f"{one}/data")
    file.move("aside", f"{other}/data")
    return Traces(f"/{one}/data/time|/{one}/data/{CHANNELS[0]}: ", _all(one, other))


def exchange_trials(file, rng, put, effort):
    one, other = rng.sample(ENTRIES, 2)
    _exchange(file, one, other)
    return Traces(f"/{one}/record/json: ", _all(one, other))


def edit_unit(file, rng, put, effort):
    entry, channel = rng.choice(ENTRIES), rng.choice(CHANNELS)
    file[f"{entry}/data/{channel}"].attrs["units"] = "mrad/s"
    return Traces(f"/{entry}/data/{channel}@units: ", frozenset({(entry, channel)}))


def edit_label(file, rng, put, effort):
    entry, channel = rng.choice(ENTRIES), rng.choice(CHANNELS)
    file[f"{entry}/data/{channel}"].attrs["long_name"] = "Nothing of interest"
    return Traces(f"/{entry}/data/{channel}@long_name: ")


def scale_samples(file, rng, put, effort):
    entry, channel = rng.choice(ENTRIES), rng.choice(CHANNELS)
    file[f"{entry}/data/{channel}"][...] = 0.5 * file[f"{entry}/data/{channel}"][...]
    return Traces(f"/{entry}/data/{channel}: ", frozenset({(entry, channel)}))


def stretch_time(file, rng, put, effort):
    entry = rng.choice(ENTRIES)
    file[f"{entry}/data/time"][...] = 2.0 * file[f"{entry}/data/time"][...]
    return Traces(f"/{entry}/data/time: ", _all(entry))


def remove_trial(file, rng, put, effort):
    entry = rng.choice(ENTRIES)
    del file[entry]
    return Traces(f"/{entry}: is missing", listed=f"/{entry}: ", unopened=frozenset({entry}))


def add_channel(file, rng, put, effort):
    entry = rng.choice(ENTRIES)
    file.copy(f"{entry}/data/command", file[f"{entry}/data"], "extra")
    return Traces(f"/{entry}/data/extra: is there, and was not announced")


def remove_channel(file, rng, put, effort):
    entry, channel = rng.choice(ENTRIES), rng.choice(CHANNELS)
    del file[f"{entry}/data/{channel}"]
    return Traces(f"/{entry}/data/{channel}: is missing", frozenset({(entry, channel)}))


def rename_channel(file, rng, put, effort):
    entry, channel = rng.choice(ENTRIES), rng.choice(CHANNELS)
    file[f"{entry}/data"].move(channel, "renamed")
    return Traces(f"/{entry}/data/{channel}: is missing", frozenset({(entry, channel)}))


def edit_title(file, rng, put, effort):
    entry = rng.choice(ENTRIES)
    put(f"{entry}/title", "a better trial")
    return Traces(f"/{entry}/title: ")


def edit_record(file, rng, put, effort):
    entry = rng.choice(ENTRIES)
    text = text_of(file, f"{entry}/record/json")
    put(f"{entry}/record/json", text.replace('"seed":', '"seed":1'))
    return Traces(f"/{entry}/record/json: ")


def edit_index(file, rng, put, effort):
    """A line says something else; its trial's own group still has the record."""
    lines = text_of(file, "run/index/data").splitlines()
    number = rng.randrange(len(lines))
    lines[number] = lines[number].replace('"samples":50', '"samples":40')
    put("run/index/data", "\n".join(lines) + "\n")
    return Traces("/run/index", listed="/run/index: " if effort == "seal" else "/run/index/data: ")


def exchange_records(file, rng, put, effort):
    """Two trials in the index take each other's numbers."""
    text = text_of(file, "run/index/data")
    one, other = '"number":1,', '"number":2,'
    assert one in text
    put("run/index/data", text.replace(one, "#").replace(other, one).replace("#", other))
    return Traces("/run/index", listed="/run/index: " if effort == "seal" else "/run/index/data: ")


def edit_journal(file, rng, put, effort):
    text = text_of(file, "run/journal/data")
    put("run/journal/data", text.replace('"outcome":"completed"', '"outcome":"limit"', 1))
    if effort == "seal":
        what = r"/trial_0000\d.*: has outcome 'completed', and the journal says 'limit'"
        return Traces(what, listed="/run/outcome/trials_failed: ")
    return Traces("/run/journal/data: ", listed="/run/journal/data: ")


def exchange_digests(file, rng, put, effort):
    """Two trials in the journal take each other's records: then neither is the one it names."""
    text = text_of(file, "run/journal/data")
    one, other = (sha256(text_of(file, f"{entry}/record/json")) for entry in ENTRIES[:2])
    put("run/journal/data", text.replace(one, "#").replace(other, one).replace("#", other))
    if effort == "seal":
        both = frozenset(ENTRIES[:2])
        return Traces("/trial_0000[12]", listed="/trial_0000[12]: ", unopened=both)
    return Traces("/run/journal/data: ", listed="/run/journal/data: ")


def edit_bench(file, rng, put, effort):
    put("run/trees/data", text_of(file, "run/trees/data").replace("35.0", "36.0"))
    if effort == "seal":  # the trees have digests of their own; those of the groups are read
        return Traces("plan-trees.jsonl: line . does not match its digest")
    return Traces("/run/trees/data: ", listed="/run/trees/data: ")


def add_to_the_seal(file, rng, put, effort):
    """A text that was never there."""
    put("run/source_009/data", "[[test]]")
    put("run/source_009/file_name", "another.toml")
    if effort == "seal":
        return Traces("")  # what was not there before contradicts nothing
    return Traces("/run/source_009/file_name: ", listed="/run/source_009/file_name: was not there")


ACTS = [
    exchange_channels, exchange_data, exchange_trials, edit_unit, edit_label, scale_samples,
    stretch_time, remove_trial, add_channel, remove_channel, rename_channel, edit_title,
    edit_record, edit_index, exchange_records, edit_journal, exchange_digests, edit_bench,
    add_to_the_seal,
]  # fmt: skip


def committed(path: Path, act: Callable[..., Traces], seed: int, effort: str) -> Traces:
    """Do it, and compute anew what he cares to."""
    with h5py.File(path, "r+") as file:

        def put(place: str, text: str) -> None:
            assert place not in file or text != text_of(file, place)
            put_text(file, place, text, honest=effort == "none")

        traces = act(file, random.Random(f"{act.__name__} {seed}"), put, effort)
        if effort == "seal":
            reseal(file)
    rehash(path)
    return traces


def attempts(path: Path) -> dict[str, ArchivedTrial]:
    run = open_run(path)
    earlier = [attempt for attempts in run.earlier_attempts.values() for attempt in attempts]
    return {archived.entry: archived for archived in (*run.trials, *earlier)}


def recorded(path: Path) -> dict[tuple[str, str], bytes]:
    """Every channel that can be read, by entry and name: trial, time, unit and samples."""
    found = {}
    for entry, archived in attempts(path).items():
        trial = archived.trial.model_dump_json()
        about = f"{trial} {archived.ending} {archived.started}"
        recording = None
        for info in archived.channels():
            try:
                recording = recording or archived.recording()
                samples = recording[info.name].tobytes()
            except ArchiveError as error:
                assert str(path) in str(error)  # noqa: PT017 (the line says where)
                continue
            found[entry, info.name] = (
                f"{about} {info}".encode() + recording.time.tobytes() + samples
            )
    return found


@pytest.mark.parametrize("effort", EFFORTS)
@pytest.mark.parametrize("act", ACTS)
def test_an_act_is_found_by_those_whom_it_concerns(sealed, act, effort):
    before = recorded(sealed)
    traces = committed(sealed, act, 1, effort)
    listed = [str(damage) for damage in open_run(sealed).damaged]
    assert any(re.match(traces.listed, line) for line in listed) is bool(traces.listed), listed
    assert before.keys() - recorded(sealed).keys() == traces.unread | _all(*traces.unopened)
    verified = [str(damage) for damage in verify_run(sealed).problems]
    assert any(re.match(traces.verified, line) for line in verified) is bool(traces.verified), (
        verified
    )


SEEDS = (0, 1, *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(2, 20)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_is_delivered_is_what_was_recorded(sealed, seed):
    """However it was changed, a reader gets it as it was, or is refused."""
    before, content = recorded(sealed), sealed.read_bytes()
    for act in ACTS:
        for effort in EFFORTS:
            committed(sealed, act, seed, effort)
            after = recorded(sealed)
            assert after.items() <= before.items(), (act, effort)
            sealed.write_bytes(content)


def test_samples_that_are_removed_with_an_excuse_are_told_of(sealed):
    """`not_kept` is not bound by the seal: samples may be dropped. It hides nothing, though."""
    with h5py.File(sealed, "r+") as file:
        del file["trial_00002"]
        put_text(file, "run/not_kept/type", "application/json")
        put_text(file, "run/not_kept/file_name", "not-kept.json")
        put_text(file, "run/not_kept/data", '{"trial_00002":"no room"}')
    rehash(sealed)
    run = open_run(sealed)
    assert run.damaged == ()
    assert run.trials[1].channel_names() == set(CHANNELS)
    with pytest.raises(ArchiveError, match="its samples were not kept: no room"):
        run.trials[1].recording()
    found = verify_run(sealed)
    assert found.sound
    (remark,) = found.remarks
    assert remark.trial == "trial-00002"
    assert remark.reason == "no samples of it are kept: no room; their digests are"


@pytest.mark.parametrize("text", ["", "nonsense", "[]", "[" * 90_000])
def test_an_excuse_that_makes_no_sense_is_none(sealed, text):
    with h5py.File(sealed, "r+") as file:
        del file["trial_00002"]
        put_text(file, "run/not_kept/data", text)
    rehash(sealed)
    assert not verify_run(sealed).sound
    assert [trial.trial.number for trial in open_run(sealed).trials if _readable(trial)] == [1, 3]


def _readable(archived: ArchivedTrial) -> bool:
    try:
        whole_recording(archived)
    except ArchiveError:
        return False
    return True


def everything_scaled(file: h5py.File) -> None:
    place = "trial_00001/data/friction_torque"
    file[place][...] = 0.5 * file[place][...]
    digest = series_digest(file[place][...])
    change_record(file, "trial_00001", lambda record: record["channels"][2].update(sha256=digest))


def everything_exchanged(file: h5py.File) -> None:
    _exchange(file["trial_00001/data"], "command", "gyro_rate")

    def exchange(record):
        one, other, _ = record["channels"]
        one["sha256"], other["sha256"] = other["sha256"], one["sha256"]
        for channel in (one, other):
            item = file[f"trial_00001/data/{channel['name']}"]
            item.attrs["long_name"] = f"{channel['label']} ({channel['unit']})"

    change_record(file, "trial_00001", exchange)


def everything_removed(file: h5py.File) -> None:
    """A trial was never executed: its group, its line of the index, its line of the journal."""
    digest = sha256(text_of(file, "trial_00002/record/json"))
    del file["trial_00002"]
    for place in ("run/journal/data", "run/index/data"):
        lines = text_of(file, place).splitlines()
        kept = [line for line in lines if digest not in line and sha256(line) != digest]
        assert len(kept) == len(lines) - 1
        put_text(file, place, "\n".join(kept) + "\n")
    put_integer(file, "run/outcome/trials_finished", 2)
    reseal(file)


def everything_said_by_another(file: h5py.File) -> None:
    put_text(file, "run/provenance/operator", "Eve")
    put_text(file, "run/provenance/title", "A better run")
    put_text(file, "run/title", "A better run")
    reseal(file)


@pytest.mark.parametrize(
    "forge",
    [everything_scaled, everything_exchanged, everything_removed, everything_said_by_another],
)
def test_who_computes_everything_anew_is_not_found_but_by_a_signature(sealed, forge):
    """No checksum can help that: whoever can write the file can write its checksums. What is signed
    is the digest of the seal, and that cannot be kept.
    """
    root, signed = open_run(sealed).root, run_statement(sealed)
    with h5py.File(sealed, "r+") as file:
        forge(file)
    rehash(sealed)
    found = verify_run(sealed)
    assert found.problems == ()
    assert open_run(sealed).problems() == []
    assert found.root == open_run(sealed).root != root
    assert run_statement(sealed) != signed


def test_the_seal_of_another_run_is_noticed(sealed):
    with h5py.File(sealed, "r+") as file:
        seal = json.loads(text_of(file, "run/outcome/seal"))
        put_text(file, "run/outcome/seal", canonical(seal | {"run": "another"}))
    rehash(sealed)
    (damage,) = open_run(sealed).damaged
    assert str(damage).startswith("/run/outcome/seal: is of the run 'another', not of ")
    assert not verify_run(sealed).sound


@pytest.mark.parametrize("place", ["journal/data", "index/data", "trees/data", "outcome/status"])
def test_a_seal_that_says_less_is_noticed(sealed, place):
    """What the seal does not bind could be edited; verifying knows what it has to bind."""
    with h5py.File(sealed, "r+") as file:
        seal = json.loads(text_of(file, "run/outcome/seal"))
        del seal["texts"][place]
        put_text(file, "run/outcome/seal", canonical(seal))
    rehash(sealed)
    found = [str(damage) for damage in verify_run(sealed).problems]
    if place == "outcome/status":
        assert found[0].startswith("/run/outcome/status: was not there when the run was sealed")
    else:
        assert f"/run/{place}: is missing from the seal" in found


def test_samples_that_are_there_are_checked_whatever_is_said_of_them(sealed):
    """`not_kept` is not bound by the seal, so that samples may be dropped from a signed run; it
    excuses samples that are missing, and none that are there."""
    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data/gyro_rate"][...] = 0.5 * file["trial_00001/data/gyro_rate"][...]
        note = file.create_group("run/not_kept")
        note.attrs["NX_class"] = "NXnote"
        for name in ("type", "file_name"):
            put_text(file, f"run/not_kept/{name}", "x")
        put_text(file, "run/not_kept/data", canonical({"trial_00001": "the disk was full"}))
    rehash(sealed)
    places = [damage.place for damage in verify_run(sealed).problems]
    assert "/trial_00001" in places
    assert "/trial_00001/data/gyro_rate" in places
    with pytest.raises(ArchiveError, match="does not match its checksum"):
        open_run(sealed).trials[0].recording()["gyro_rate"]


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("run/provenance/notes", "/run/provenance/notes: is missing"),
        ("run/provenance/overrides", "/run/provenance/overrides: is missing"),
        ("run/source_001", "/run/source_001"),
    ],
)
def test_what_was_sealed_and_is_gone_is_told_by_who_opens(sealed, place, said):
    with h5py.File(sealed, "r+") as file:
        del file[place]
    rehash(sealed)
    assert any(str(damage).startswith(said) for damage in open_run(sealed).damaged)


@pytest.mark.parametrize(
    ("place", "text"),
    [
        ("outcome/status", "interrupted"),
        ("end_time", "2026-11-21T09:59:00Z"),
        ("start_time", "2026-11-21T09:00:00Z"),
        ("entry_identifier", "2026-11-21T09-36-58-another"),
        ("title", "Another"),
    ],
)
def test_texts_that_contradict_each_other_are_told_though_the_seal_fits(sealed, place, text):
    name = open_run(sealed).name
    with h5py.File(sealed, "r+") as file:
        put_text(file, f"run/{place}", text)
        reseal(file)
        seal = json.loads(text_of(file, "run/outcome/seal"))
        put_text(file, "run/outcome/seal", canonical(seal | {"run": name}))
    rehash(sealed)
    assert f"/run/{place}" in [damage.place for damage in open_run(sealed).damaged]
    assert not verify_run(sealed).sound


@pytest.mark.parametrize("note", ["trees", "journal", "index"])
def test_bytes_that_are_no_text_cost_a_line_and_not_the_run(sealed, note):
    """Whoever made them had the seal fit them."""
    place = f"run/{note}/data"
    with h5py.File(sealed, "r+") as file:
        raw = text_of(file, place).encode().replace(b":", b"\xff", 1)
        put_text(file, place, "x" * len(raw))
        file[place][()] = np.bytes_(raw)
        seal = json.loads(text_of(file, "run/outcome/seal"))
        seal["texts"][note + "/data"] = hashlib.sha256(raw).hexdigest()
        put_text(file, "run/outcome/seal", canonical(seal))
    rehash(sealed)
    assert [archived.trial.number for archived in open_run(sealed).trials] == [1, 2, 3]
    assert not verify_run(sealed).sound


def test_a_trial_of_which_the_journal_no_longer_tells_is_told(sealed):
    with h5py.File(sealed, "r+") as file:
        lines = text_of(file, "run/journal/data").splitlines(keepends=True)
        kept = [line for line in lines if '"trial":2' not in line]
        assert len(kept) == len(lines) - 1
        put_text(file, "run/journal/data", "".join(kept))
        reseal(file)
    rehash(sealed)
    assert "/run/index" in [damage.place for damage in open_run(sealed).damaged]


@pytest.mark.parametrize("name", ["units", "long_name"])
def test_the_time_has_its_unit_too(sealed, name):
    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data/time"].attrs[name] = "ms"
    rehash(sealed)
    assert not verify_run(sealed).sound
    if name == "units":
        with pytest.raises(ArchiveError, match="@units: is 'ms', and 's' was recorded"):
            open_run(sealed).trials[0].recording()


@pytest.mark.parametrize(("name", "value"), [("signal", "friction_torque"), ("axes", ["command"])])
def test_what_viewers_plot_is_what_was_recorded(sealed, name, value):
    with h5py.File(sealed, "r+") as file:
        file["trial_00001/data"].attrs[name] = value
    rehash(sealed)
    (damage,) = verify_run(sealed).problems
    assert damage.place == f"/trial_00001/data@{name}"
