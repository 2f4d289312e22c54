"""Safe, unique and stable names on the page and in the folder; links to the pages of trials."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence

FOLDER = "trials"
"""Subfolder of the report's folder with the pages of trials."""


class Names:
    """Generator of unique names."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def unique(self, *candidates: str) -> str:
        """First free name of `candidates`, else the last one with the first free number."""
        wanted = [slug(candidate) for candidate in candidates]
        numbered = (f"{wanted[-1]}-{n}" for n in range(2, len(self._taken) + 3))
        name = next(name for name in (*wanted, *numbered) if name not in self._taken)
        self._taken.add(name)
        return name


def slug(text: str) -> str:
    """Lower-case letters, digits, dots and hyphens: `Table 5.8` is `table-5.8`."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:80] or "unnamed"


def stood_for(numbers: Sequence[str], reproduces: Sequence[str], prefix: str) -> tuple[str, ...]:
    """Numbers of published figures or tables that the test declares to reproduce."""
    return tuple(number for number in numbers if f"{prefix}{number}" in reproduces)


def figure_name(thesis: Sequence[str], test: str, key: str) -> tuple[str, ...]:
    """Candidates for a figure's name: its published number, then its own key."""
    own = f"{test}-{key}"
    return (f"figure-{thesis[0]}", f"figure-{thesis[0]}-{own}") if thesis else (own,)


def trial_file(number: int) -> str:
    """Path of a trial's page within the report's folder."""
    return f"{FOLDER}/trial-{number:05d}.html"


def trial_links(written: Collection[int]) -> Callable[[int], str | None]:
    """Function from a trial's number to the link from the report's page; None without a page.

    `written`: numbers of the trials with a page.
    """
    with_page = frozenset(written)
    return lambda number: trial_file(number) if number in with_page else None
