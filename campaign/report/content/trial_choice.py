"""Trials with a page of their own: `failed`, `all`, numbers, ranges."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

from campaign.archive import RunReader
from campaign.archive.reading.damage_words import lost_trials
from campaign.errors import UsageError
from campaign.recording import Outcome

HOW = "write failed, all, N, N..M, or several of them with commas"
TOLD = 8
"""Most stretches of numbers that a message names."""

_ONE = re.compile(r"(?:trial-)?(\d{1,10})")


def chosen_trials(run: RunReader, wanted: str) -> tuple[int, ...]:
    """The numbers of executed trials that `wanted` means, in the plan's order; none for "".

    Damaged trials are among them. Raises UsageError for what cannot be read, and for numbers of
    trials that there are not, saying which there are.
    """
    executed = executed_trials(run)
    chosen: set[int] = set()
    for part in filter(None, (each.strip() for each in wanted.split(","))):
        if part == "all":
            chosen.update(executed)
        elif part == "failed":
            failed = (e for e in run.trials if e.ending.outcome is not Outcome.COMPLETED)
            chosen |= {each.trial.number for each in failed} | set(lost_trials(run))
        else:
            chosen |= _numbered(run, part, executed)
    if wanted and not chosen and not wanted.strip(" ,"):
        raise UsageError(f"--trials {wanted!r} names no trial; {HOW}")
    return tuple(sorted(chosen))


def executed_trials(run: RunReader) -> tuple[int, ...]:
    """The numbers of all executed trials, damaged ones among them, in the plan's order."""
    return tuple(sorted({each.trial.number for each in run.trials} | set(lost_trials(run))))


def _numbered(run: RunReader, part: str, executed: Collection[int]) -> set[int]:
    ends = [_number(end.strip(), part) for end in part.split("..", 1)]
    first, last = ends[0], ends[-1]
    if first > last:
        raise UsageError(f"--trials {part}: ends before it begins; write {last}..{first}")
    planned = {each.number for each in run.plan} | set(executed)
    for end in ends:
        if end not in planned:
            raise UsageError(f"--trials {part}: there is no trial {end}; {_there(run, executed)}")
    found = {number for number in executed if first <= number <= last}
    if not found:
        what = f"trial {first} was not" if first == last else "none of these trials was"
        raise UsageError(f"--trials {part}: {what} executed; {_there(run, executed)}")
    return found


def _number(text: str, part: str) -> int:
    match = _ONE.fullmatch(text)
    if match is None:
        raise UsageError(f"--trials {part}: {text!r} is no number of a trial; {HOW}")
    return int(match[1])


def _there(run: RunReader, executed: Collection[int]) -> str:
    if not executed:
        return f"no trial of {run.name} was executed"
    return f"executed in {run.name}: {stretches(executed)}"


def stretches(numbers: Iterable[int]) -> str:
    """`1 to 12, 14, 16 to 20`."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    told = [str(a) if a == b else f"{a} to {b}" for a, b in found[:TOLD]]
    return ", ".join([*told, "…"] if len(found) > TOLD else told)
