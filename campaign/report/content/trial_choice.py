"""Trials with a page of their own: `failed`, `all`, numbers, ranges."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

from campaign.archive.reading.damage_words import lost_trials
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import UsageError
from campaign.recording import Outcome

HOW = "write failed, all, N, N..M, or several of them with commas"
TOLD = 8
"""Maximum number of ranges in a message."""

_ONE = re.compile(r"(?:trial-)?(\d{1,10})")


def chosen_trials(run: RunReader, wanted: str) -> tuple[int, ...]:
    """Numbers of the executed trials that `wanted` selects, in plan order; none for "".

    Damaged trials are included. Raises UsageError for invalid text and for numbers of unknown
    trials; the message lists the executed ones.
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
    """Numbers of all executed trials, including damaged ones, in plan order."""
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
    selected = {number for number in executed if first <= number <= last}
    if not selected:
        what = f"trial {first} was not" if first == last else "none of these trials was"
        raise UsageError(f"--trials {part}: {what} executed; {_there(run, executed)}")
    return selected


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
    """Numbers as ranges: `1 to 12, 14, 16 to 20`."""
    ranges: list[list[int]] = []
    for number in sorted(numbers):
        if ranges and number == ranges[-1][1] + 1:
            ranges[-1][1] = number
        else:
            ranges.append([number, number])
    texts = [str(a) if a == b else f"{a} to {b}" for a, b in ranges[:TOLD]]
    return ", ".join([*texts, "…"] if len(ranges) > TOLD else texts)
