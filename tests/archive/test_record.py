"""A trial's record: what it says comes back as it was, and its text is what the digest is of."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.layout.record import (
    EventRecord,
    PreviewRecord,
    SeriesRecord,
    TrialRecord,
    parse_trees,
    plain,
    shared_trees,
    trees_text,
)
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_samples import RecordedSamples, archived_trial
from campaign.archive.reading.open_run import open_run
from campaign.errors import ArchiveError
from campaign.estimate import Estimate, Window
from campaign.policy import SampleRetention
from campaign.reason import NONE, Cause, Reason
from campaign.recording import ChannelInfo, Ending, Fault, Outcome, SafeState

ENDING = Ending(
    Outcome.FAULT,
    "no word for 1 s: «ü»",
    SafeState.NOT_CONFIRMED,
    Fault.LOST_CONNECTION,
    {"latency_ms": {"most": np.float64(4.5), "mean": float("nan")}, "resends": np.int64(3)},
)
TELEMETRY = {"latency_ms": {"most": 4.5, "mean": "nan"}, "resends": 3}
FEW = Cause("too few runs", "{runs} run in {within:g} s")
ESTIMATES = (
    Estimate("coulomb_torque", 0.25, "N m", 0.2, 0.3, 0.95, "bootstrap"),
    Estimate(
        "stribeck_rate", np.float64(5e-324), "rad/s", reason=FEW(runs=np.int64(1), within=2.0)
    ),
)
WINDOWS = (Window("steady", 0.5, 1.75),)


@pytest.fixture
def record(kit) -> TrialRecord:
    """One with something in every field."""
    described, _ = shared_trees(kit.trial(7))
    channels = [
        SeriesRecord.of(ChannelInfo("gyro_rate", "rad/s", "Rate", "deg/s", True, 8000.0), "1" * 64),
        SeriesRecord.of(ChannelInfo("torque", "N m", "Torque", "N m", False), "2" * 64),
    ]
    preview = PreviewRecord(channel="gyro_rate", samples=20_000, time="3" * 64, values="4" * 64)
    return TrialRecord(
        trial=described, label=kit.trial(7).label, fingerprint=kit.trial(7).fingerprint, attempt=3,
        started=kit.STARTED, ended=kit.ENDED, **vars(ENDING) | {"telemetry": TELEMETRY},
        samples=40_000, time="0" * 64, channels=tuple(channels), preview=preview,
        events=(EventRecord(time=0.25, text="the load breaks away ↗"),),
        windows=WINDOWS, estimates=ESTIMATES,
    )  # fmt: skip


@pytest.fixture
def least(kit) -> TrialRecord:
    """One of a trial that recorded nothing."""
    trial = kit.trial(1)
    described, _ = shared_trees(trial)
    return TrialRecord(
        trial=described, label=trial.label, fingerprint=trial.fingerprint, attempt=1,
        started=kit.STARTED, ended=kit.ENDED, **vars(Ending(Outcome.COMPLETED)),
    )  # fmt: skip


def test_a_reason_of_an_older_archive_is_its_text(record):
    tree = json.loads(record.text)
    tree["estimates"][1]["reason"] = "one run only"
    first, second = TrialRecord.model_validate(tree).estimates
    assert second.reason == Reason("text", "one run only")
    assert first.reason == NONE


@pytest.mark.parametrize("which", ["record", "least"])
def test_a_record_is_its_text(which, request):
    record = request.getfixturevalue(which)
    again = TrialRecord.model_validate_json(record.text)
    assert again == record
    assert again.text == record.text
    assert record.sha256 == hashlib.sha256(record.text.encode()).hexdigest()
    canonical = json.dumps(json.loads(record.text), sort_keys=True, separators=(",", ":"))
    assert record.text == canonical
    assert "\n" not in record.text  # it is a line of the index


def test_what_a_record_says_is_what_was_recorded(record, kit):
    again = TrialRecord.model_validate_json(record.text)
    assert again.ending == replace(ENDING, telemetry=TELEMETRY)
    assert again.windows == WINDOWS
    assert again.estimates == ESTIMATES
    assert again.series == (
        ChannelInfo("gyro_rate", "rad/s", "Rate", "deg/s", True, 8000.0),
        ChannelInfo("torque", "N m", "Torque", "N m", False),
    )
    assert [(event.time, event.text) for event in again.events] == [
        (0.25, "the load breaks away ↗")
    ]
    assert (again.number, again.attempt, again.samples) == (7, 3, 40_000)


def test_what_says_nothing_is_left_out(least):
    absent = {"fault", "telemetry", "samples", "time", "channels", "preview", "events"}
    assert not (absent | {"windows", "estimates"}) & json.loads(least.text).keys()


def test_a_trial_is_restored_from_its_record_and_the_trees(record, kit):
    described, trees = shared_trees(kit.trial(7))
    assert set(trees) == {described["bench"], described["options"]} == record.tree_names
    assert record.restored(parse_trees(trees_text(trees))) == kit.trial(7)
    assert record.fingerprint_of(trees) == kit.trial(7).fingerprint
    with pytest.raises(LookupError):
        record.restored({})


def test_its_fingerprint_covers_a_truth_and_a_recording(kit, record):
    trial = kit.trial(7).model_copy(update={"truth": "1" * 64, "recording": {"log.csv": "2" * 64}})
    described, trees = shared_trees(trial)
    described_record = record.model_copy(update={"trial": described})
    assert described_record.fingerprint_of(trees) == trial.fingerprint
    assert trial.fingerprint != kit.trial(7).fingerprint


def test_a_tree_that_is_not_that_of_its_digest_is_refused(kit):
    _, trees = shared_trees(kit.trial(1))
    text = trees_text(trees)
    assert parse_trees(text) == trees
    with pytest.raises(ValueError, match=r"line \d does not match its digest"):
        parse_trees(text.replace("35.0", "36.0"))
    for nonsense in ("[]\n", "{}\n", "nonsense\n", "[" * 90_000, '{"sha256":1,"tree":{}}\n'):
        with pytest.raises(ValueError, match="line 1 does not match"):
            parse_trees(nonsense)


def test_a_record_of_a_later_program_is_read(record):
    """What it does not know it leaves alone; the digest is of the text, not of what was read."""
    tree = json.loads(record.text) | {"humidity": 0.4}
    tree["channels"][0]["colour"] = "red"
    assert TrialRecord.model_validate(tree) == record


def test_windows_and_estimates_of_an_older_record_are_read(record, kit):
    _, trees = shared_trees(kit.trial(7))
    archived = archived_trial(RecordedSamples(Path("run.nxs"), "trial_00007", record), trees)
    assert archived.windows == WINDOWS
    assert archived.estimates == ESTIMATES


def test_samples_that_were_not_kept_have_their_digests_and_say_why(tmp_path, kit):
    writer, trials = kit.begin(tmp_path, 2)
    how = kit.CHANNELS, SampleRetention("none")
    kit.recorded(writer, trials[0], 100, *how, ending=ENDING)
    kit.record(writer, trials[1], 10)
    for look in (lambda: writer.folder, lambda: writer.seal(RunStatus.COMPLETE, ended=kit.ENDED)):
        run = open_run(look())
        assert run.damaged == ()
        assert run.problems() == []
        archived = run.trials[0]
        assert archived.trial == trials[0]
        assert archived.channels() == kit.CHANNELS
        assert archived.ending == replace(ENDING, telemetry=TELEMETRY)
        with pytest.raises(ArchiveError, match="not kept: the protocol says keep = none"):
            archived.recording()
        told = json.loads(archived.samples.record.text)["channels"]
        assert len({channel["sha256"] for channel in told}) == len(kit.CHANNELS)
        assert len(run.trials[1].recording().time) == 10


def test_a_record_is_written_as_the_format_says(record, kit):
    """Every field under its name, what is as usual left out."""
    tree = json.loads(record.text)
    trial = tree.pop("trial")
    assert trial["number"] == 7
    assert record.tree_names == {trial["bench"], trial["options"]}
    assert tree == {
        "label": kit.trial(7).label,
        "fingerprint": kit.trial(7).fingerprint,
        "attempt": 3,
        "started": kit.STARTED,
        "ended": kit.ENDED,
        "outcome": "fault",
        "reason": "no word for 1 s: «ü»",
        "safe_state": SafeState.NOT_CONFIRMED.value,
        "fault": Fault.LOST_CONNECTION.value,
        "telemetry": TELEMETRY,
        "samples": 40_000,
        "time": "0" * 64,
        "channels": [
            {"name": "gyro_rate", "unit": "rad/s", "label": "Rate", "display_unit": "deg/s",
             "own_rate": 8000.0, "sha256": "1" * 64},
            {"name": "torque", "unit": "N m", "label": "Torque", "display_unit": "N m",
             "measured": False, "sha256": "2" * 64},
        ],
        "preview": {"channel": "gyro_rate", "samples": 20_000, "time": "3" * 64,
                    "values": "4" * 64},
        "events": [{"time": 0.25, "text": "the load breaks away ↗"}],
        "windows": [{"name": "steady", "start": 0.5, "stop": 1.75}],
        "estimates": [
            {"name": "coulomb_torque", "value": 0.25, "unit": "N m", "low": 0.2, "high": 0.3,
             "level": 0.95, "method": "bootstrap"},
            {"name": "stribeck_rate", "value": 5e-324, "unit": "rad/s",
             "reason": {"code": "too few runs", "text": "1 run in 2 s",
                        "values": [["runs", 1], ["within", 2.0]]}},
        ],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("place", "least_value"), [("attempt", 1), ("samples", 0), ("preview.samples", 0)]
)
def test_counts_have_their_least_value(record, place, least_value):
    def with_count(count: int) -> dict[str, object]:
        tree = json.loads(record.text)
        *outer, name = place.split(".")
        (tree[outer[0]] if outer else tree)[name] = count
        return tree

    TrialRecord.model_validate(with_count(least_value))
    with pytest.raises(ValueError, match="greater than or equal to"):
        TrialRecord.model_validate(with_count(least_value - 1))


def test_a_record_cannot_be_changed(record):
    """Its text and its digest are made once."""
    for part, field in ((record, "attempt"), (record.channels[0], "unit")):
        with pytest.raises(ValueError, match="frozen"):
            setattr(part, field, None)
    assert record.text is record.text


class _Odd:
    def __str__(self) -> str:
        return "odd"


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (None, None), (True, True), (np.bool_(True), True), (3, 3), (np.int32(3), 3), (0.5, 0.5),
        (np.float32(0.5), 0.5), (float("inf"), "inf"), (np.float64("-inf"), "-inf"),
        ("text", "text"), (np.str_("text"), "text"), ((1, [2.0, None]), [1, [2.0, None]]),
        (np.array([[1, 2], [3, 4]]), [[1, 2], [3, 4]]),
        ({1: {"a": (np.nan,)}}, {"1": {"a": ["nan"]}}), (_Odd(), "odd"), (b"bytes", "b'bytes'"),
        ({"a"}, "{'a'}"),
    ],
)  # fmt: skip
def test_whatever_a_backend_measured_of_itself_becomes_json(value, told):
    found = plain(value)
    assert found == told
    assert type(found) is type(told)
    assert json.loads(json.dumps(found, allow_nan=False)) == told


def test_trees_stand_in_the_order_of_their_digests_however_they_came(kit):
    _, trees = shared_trees(kit.trial(1))
    backwards = dict(sorted(trees.items(), reverse=True))
    lines = trees_text(backwards).splitlines()
    assert [json.loads(line)["sha256"] for line in lines] == sorted(trees)
    with pytest.raises(ValueError, match="line 2 does not match"):
        parse_trees("\n".join([lines[0], lines[1][:-1]]))
