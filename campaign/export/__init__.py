"""Export of recordings for other programs: one file per format, or an installed plug-in."""

from __future__ import annotations

from functools import cache

from campaign.export.interface import ExportKind
from campaign.plugins import Kinds


@cache
def exports() -> Kinds[ExportKind]:
    """All formats, by name."""
    return Kinds("export format", __name__, "EXPORT", ExportKind)
