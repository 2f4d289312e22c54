"""Recordings in the formats of other programs: one file per format, or an installed plug-in."""

from __future__ import annotations

from functools import cache

from campaign.export.interface import ExportKind
from campaign.plugins import discover


@cache
def exports() -> dict[str, ExportKind]:
    """Every format, by name."""
    return discover(__name__, "EXPORT", "campaign.exports")
