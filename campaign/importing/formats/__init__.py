"""Formats of recordings: one file per format, or an installed plug-in."""

from __future__ import annotations

from functools import cache

from campaign.importing.interface import RecordingFormat
from campaign.plugins import Kinds


@cache
def recording_formats() -> Kinds[RecordingFormat]:
    """Every format, by name."""
    return Kinds("recording format", __name__, "FORMAT", RecordingFormat)
