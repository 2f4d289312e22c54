"""A trial's fingerprint is that of what the trial says, however the trial was made."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from campaign import recording
from campaign import trial as asked
from campaign.trial import Task, Trial

TASK = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=1000.0)


def trial(**changes: Any) -> Trial:
    given: dict[str, Any] = {"bench": {"inertia": 35.0}, "task": TASK, "seed": 1, **changes}
    return Trial(number=1, test="a", kind="move", **given)


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 2},
        {"bench": {"inertia": 36.0}},
        {"task": TASK.model_copy(update={"duration": 2.0})},
    ],
)
@pytest.mark.parametrize("deep", [False, True])
def test_a_changed_copy_has_a_fingerprint_of_its_own(change: dict[str, Any], deep: bool):
    original = trial()
    before = original.fingerprint  # which keeps it
    changed = original.model_copy(update=change, deep=deep)
    assert changed.fingerprint == trial(**change).fingerprint != before
    assert original.fingerprint == before


def test_what_determines_no_sample_changes_no_fingerprint():
    original = trial()
    before = original.fingerprint
    assert original.model_copy(update={"number": 7, "note": "again"}).fingerprint == before
    assert copy.copy(original).fingerprint == copy.deepcopy(original).fingerprint == before


def test_what_plug_ins_imported_from_here_is_what_came_back():
    nouns = {
        name
        for name, thing in vars(recording).items()
        if getattr(thing, "__module__", "") == recording.__name__ and not name.startswith("_")
    }
    assert nouns > {"Recording", "Channel", "Ending", "Outcome", "MemoryRecorder", "lost_samples"}
    for name in (nouns - {"record"}) | {"Array"}:  # `record` came later
        assert getattr(asked, name) is getattr(recording, name)


@pytest.mark.parametrize(
    ("duration", "rate", "samples"),
    [
        (0.29, 100.0, 29),
        (0.7, 10.0, 7),
        (1.999, 1.0, 1),
        (2.5, 1.0, 2),
        (0.1, 1.0, 1),
        (1e4, 1e4, 10**8),
    ],
)
def test_samples_are_the_whole_periods_of_the_duration(
    duration: float, rate: float, samples: int
) -> None:
    task = Task(mode="torque", duration=duration, window=(0.0, duration), sample_rate=rate)
    assert task.samples == samples
