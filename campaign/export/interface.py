"""The interface of an export format: one recording into one file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from campaign.api import TrialView
from campaign.recording import Recording


@dataclass(frozen=True)
class ExportKind:
    """An export format, selected by `campaign export --to NAME`.

    Attributes:
        suffix: suffix of its files, e.g. `.csv`.
        write: writes a complete recording in SI and at full precision into a new file. Raises
            UsageError when the format cannot hold it, or when a library is missing. A format with
            metadata states there which parts of the trial's run are `damaged`.
    """

    name: str
    summary: str
    suffix: str
    write: Callable[[TrialView, Recording, Path], None]
