"""Damage of a run as text: for a terminal, a warning or a file."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.plain_text import printable

FILE = "damaged.csv"
"""What lists the damage of a run in a folder that was made from it."""
COLUMNS = ("place", "trial", "channel", "reason")
WARNED = 5
"""Most damage that one warning names."""

_NUMBER = re.compile(r"trial-(\d{5,10})")


def in_words(damage: Damage) -> str:
    """Trial and channel, where it has them, place and reason: one line."""
    whose = ", ".join(filter(None, (damage.trial, damage.channel)))
    return printable(f"{whose}: {damage}" if whose else str(damage))


def heading(path: Path, damaged: Sequence[Damage]) -> str:
    """That a run is damaged, and in how many places."""
    places = "1 place" if len(damaged) == 1 else f"{len(damaged)} places"
    return f"{path}: damaged, missing or not as it was archived, in {places}"


def listed(damaged: Sequence[Damage], most: int) -> Iterator[str]:
    """The first `most`, a line each, and how many more there are."""
    yield from map(in_words, damaged[:most])
    if len(damaged) > most:
        yield f"and {len(damaged) - most} more"


def in_one_line(path: Path, damaged: Sequence[Damage]) -> str:
    """All of the above in one line, for a warning or an error."""
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
    """The number of the trial that is damaged, when it is one trial's."""
    match = _NUMBER.match(damage.trial)
    return int(match[1]) if match else None


def lost_trials(run: RunReader) -> dict[int, Damage]:
    """The executed trials that are not among `run.trials`, by number, each with what is wrong."""
    there = {each.number for each in run.outlines} if run.damaged else set()
    lost = ((trial_number(damage), damage) for damage in reversed(run.damaged))
    return {n: damage for n, damage in lost if n is not None and n not in there}


def hidden_trials(run: RunReader) -> int:
    """How many planned trials nobody knows of whether they were executed; 0 where that is known.

    The journal tells it and, of a sealed run, the index as well: one of them is enough.
    """
    places = [damage.place for damage in run.damaged]
    untold = any("journal" in place for place in places) and (
        not run.sealed or any("/index" in place for place in places)
    )
    return max(0, len(run.plan) - len(run.trials) - len(lost_trials(run))) if untold else 0


def of_test(run: RunReader, test: str) -> tuple[Damage, ...]:
    """What touches one test: its trials, those of which nobody knows whose they are, and the run.

    A trial that cannot be read is known by its line of the plan.
    """
    tests = {planned.number: planned.test for planned in run.plan}
    tests |= {each.number: each.test for each in run.outlines}
    return tuple(
        damage
        for damage in run.damaged
        if (number := trial_number(damage)) is None or tests.get(number, test) == test
    )
