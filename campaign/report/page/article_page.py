"""Building pages of comparisons, trends and identifications."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from campaign.api.analysis import one_line
from campaign.report.page.folder import Folder

T = TypeVar("T")


@dataclass
class PageParts:
    """What is collected while a page is laid out."""

    folder: Folder = field(default_factory=Folder)
    problems: list[str] = field(default_factory=list)

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """What `make` makes; one bad figure must not cost the page."""
        try:
            return make()
        except Exception as error:  # noqa: BLE001 (it may be a plug-in's)
            self.problems.append(f"{what} cannot be shown: {one_line(error)}")
            return None
