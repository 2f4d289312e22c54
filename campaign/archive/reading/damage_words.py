"""Damage of a run as text: for a terminal, a warning or a file."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.plain_text import printable
from campaign.text import count, shortened

FILE = "damaged.csv"
"""Name of the list of a run's damage, in a folder exported from the run."""
COLUMNS = ("place", "trial", "channel", "reason")
WARNED = 5
"""Maximum number of damaged items that one warning lists."""

_NUMBER = re.compile(r"trial-(\d{5,10})")


def in_words(damage: Damage) -> str:
    """One line: trial and channel (if any), place, reason."""
    owner = ", ".join(filter(None, (damage.trial, damage.channel)))
    return printable(f"{owner}: {damage}" if owner else str(damage))


def heading(path: Path, damaged: Sequence[Damage]) -> str:
    """Statement that a run is damaged, with the number of places."""
    places = count(len(damaged), "place")
    return f"{path}: damaged, missing or not as it was archived, in {places}"


def listed(damaged: Sequence[Damage], most: int) -> list[str]:
    """The first `most` items, one per line, then the number of the others."""
    return shortened([in_words(each) for each in damaged], most)


def in_one_line(path: Path, damaged: Sequence[Damage]) -> str:
    """Heading and list in one line, for a warning or an error."""
    return f"{heading(path, damaged)}: {'; '.join(listed(damaged, WARNED))}"


def damaged_csv(damaged: Iterable[Damage]) -> str:
    """`damaged.csv`: one line per damage."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for each in damaged:
        row = (each.place, each.trial, each.channel, each.reason)
        writer.writerow([printable(cell) for cell in row])
    return text.getvalue()


def trial_number(damage: Damage) -> int | None:
    """The number of the damaged trial; None if the damage is not of one trial."""
    match = _NUMBER.match(damage.trial)
    return int(match[1]) if match else None


def lost_trials(run: RunReader) -> dict[int, Damage]:
    """Damage of the executed trials that are missing in `run.trials`, by trial number."""
    readable = {each.number for each in run.outlines} if run.damaged else set()
    lost = ((trial_number(damage), damage) for damage in reversed(run.damaged))
    return {n: damage for n, damage in lost if n is not None and n not in readable}


def hidden_trials(run: RunReader) -> int:
    """Number of planned trials of which it is unknown whether they were executed.

    The journal, or the index of a sealed run, is sufficient to know it for all; then 0.
    """
    places = [damage.place for damage in run.damaged]
    unknown = any("journal" in place for place in places) and (
        not run.sealed or any("/index" in place for place in places)
    )
    return max(0, len(run.plan) - len(run.trials) - len(lost_trials(run))) if unknown else 0


def of_test(run: RunReader, test: str) -> tuple[Damage, ...]:
    """Damage that concerns one test: of its trials, of trials of unknown test, and of the run.

    The plan gives the test of an unreadable trial.
    """
    tests = {planned.number: planned.test for planned in run.plan}
    tests |= {each.number: each.test for each in run.outlines}
    return tuple(
        damage
        for damage in run.damaged
        if (number := trial_number(damage)) is None or tests.get(number, test) == test
    )
