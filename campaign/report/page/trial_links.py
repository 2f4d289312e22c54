"""Links to the pages of trials."""

from __future__ import annotations

from collections.abc import Callable, Collection

FOLDER = "trials"
"""Of the report's folder, with the trials' own pages."""

TrialLink = Callable[[int], str | None]


def trial_file(number: int) -> str:
    """The page of a trial within the report's folder."""
    return f"{FOLDER}/trial-{number:05d}.html"


def trial_links(written: Collection[int]) -> TrialLink:
    """A function from a trial's number to the link from the report's page; None without a page.

    `written`: the trials that have a page.
    """
    there = frozenset(written)
    return lambda number: trial_file(number) if number in there else None
