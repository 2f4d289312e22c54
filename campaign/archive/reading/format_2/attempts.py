"""Attempts at a trial that a later one replaced: kept, and no analysis sees them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from campaign.archive.layout.journal import JOURNAL, read_journal
from campaign.archive.reading import guarded
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.format_2.trials import read_trial, read_trial_file

_ENTRY = re.compile(r"trial_([0-9]{5,10})_attempt_([0-9]{1,6})")


def read_earlier(path: Path, damaged: DamageList) -> dict[int, tuple[ArchivedTrial, ...]]:
    """By trial number, its attempts but the last, in order; what cannot be read is noted."""
    found: dict[int, list[ArchivedTrial]] = {}
    read = _in_folder(path, damaged) if path.is_dir() else _in_file(path, damaged)
    for number, archived in read:
        found.setdefault(number, []).append(archived)
    return {number: tuple(attempts) for number, attempts in sorted(found.items())}


def _in_folder(folder: Path, damaged: DamageList) -> Iterator[tuple[int, ArchivedTrial]]:
    for number, attempts in read_journal(folder / JOURNAL).earlier.items():
        for finished in attempts:
            with damaged.noting():
                yield number, read_trial_file(folder / finished.file, number)


def _in_file(path: Path, damaged: DamageList) -> Iterator[tuple[int, ArchivedTrial]]:
    with guarded.open_file(path) as file:
        matches = filter(None, map(_ENTRY.fullmatch, guarded.names(file)))
        for match in sorted(matches, key=lambda m: (int(m[1]), int(m[2]))):
            with damaged.noting():
                yield int(match[1]), read_trial(path, file, int(match[1]), match[0])
