"""Further formats of a report: one file per format, or an installed plug-in."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from campaign.errors import UsageError
from campaign.plugins import Kinds
from campaign.protocol.problems import allowed
from campaign.report.formats.interface import Format
from campaign.text import nearest


@cache
def formats() -> Kinds[Format]:
    """All formats besides the page, by name."""
    return Kinds("report format", __name__, "FORMAT", Format)


def chosen_formats(names: Iterable[str]) -> tuple[Format, ...]:
    """Formats of these names, each once.

    Raises UsageError for an unknown one, or for one whose requirements this machine lacks.
    """
    kinds = formats()
    chosen = []
    for name in dict.fromkeys(names):
        if name not in kinds:
            hint = nearest(name, kinds)
            raise UsageError(f"there is no report format {name!r}; {allowed(kinds)}{hint}")
        kinds[name].require()
        chosen.append(kinds[name])
    return tuple(chosen)
