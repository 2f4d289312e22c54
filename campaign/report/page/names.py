"""Names on the page and in the folder: safe, unique, stable."""

from __future__ import annotations

import re
from collections.abc import Sequence


class Names:
    """Hands out names that nobody had before."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def unique(self, *candidates: str) -> str:
        """The first free one of `candidates`, else the last with the first free number."""
        wanted = [slug(candidate) for candidate in candidates]
        numbered = (f"{wanted[-1]}-{n}" for n in range(2, len(self._taken) + 3))
        name = next(name for name in (*wanted, *numbered) if name not in self._taken)
        self._taken.add(name)
        return name


def slug(text: str) -> str:
    """Lower-case letters, digits, dots and hyphens: `Table 5.8` is `table-5.8`."""
    return re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:80] or "unnamed"


def stood_for(numbers: Sequence[str], reproduces: Sequence[str], prefix: str) -> tuple[str, ...]:
    """Which of the numbers that a figure or table can stand for its test says it reproduces."""
    return tuple(number for number in numbers if f"{prefix}{number}" in reproduces)


def figure_name(thesis: Sequence[str], test: str, key: str) -> tuple[str, ...]:
    """Candidates for a figure: the published number it stands for, then its own key."""
    own = f"{test}-{key}"
    return (f"figure-{thesis[0]}", f"figure-{thesis[0]}-{own}") if thesis else (own,)
