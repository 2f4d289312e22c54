"""What is wrong with the channels of a described recording, and what a mapping can say about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from campaign.importing.defects import Defect, find
from campaign.importing.described import Described
from campaign.importing.opened import OpenedFiles
from campaign.importing.reader import RecordingReader

AT_ONCE = 2_000_000
"""samples that are looked at together: memory does not grow with a recording."""
WRAPAROUND = "wraparound"
QUIET = frozenset({"quantisation", "constant"})
"""Kinds that are in every recording: nobody needs to be told of them once more."""

_REMEDIES = {
    "times": "correct its 'unit' or 'times'",
    "sign": "correct its 'sign'",
    "delay": "put it back by 'delay'",
    "unwrap": 'repair = ["unwrap"] makes it continuous',
}


def defects_of(described: Described, opened: OpenedFiles, gear: float | None) -> Iterator[Defect]:
    """Of the channels that are columns, on the trial's own even clock; each kind once.

    A long recording is looked at part by part; rows are those of the file.
    """
    reader = RecordingReader(described, opened)
    names = [each.name for each in described.channels if each.how == "column"]
    told: set[tuple[str, tuple[str, ...]]] = set()
    for first in range(0, described.samples, AT_ONCE):
        stop = min(first + AT_ONCE, described.samples)
        if stop - first < 2 and first:
            return
        samples = reader.samples(names, first, stop)
        time = np.arange(first, stop) / described.sample_rate
        for defect in find(time, dict(zip(names, samples, strict=True)), gear=gear):
            key = (defect.kind, defect.channels)
            if key in told or defect.kind in QUIET:
                continue
            told.add(key)
            yield replace(defect, rows=(defect.rows[0] + first, defect.rows[1] + first))


def remedy(defect: Defect) -> str:
    """What a mapping can say about a defect."""
    does = _REMEDIES.get(defect.repair, "")
    accepted = f'accept = ["{defect.kind}"] takes it as it is'
    return f"{does}, or {accepted}" if does else accepted
