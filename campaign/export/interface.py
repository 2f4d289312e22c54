"""The interface of an export format: one recording into one file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from campaign.api import TrialView
from campaign.recording import Recording


@dataclass(frozen=True)
class ExportKind:
    """A format as `campaign export --to NAME` finds it.

    Attributes:
        suffix: of its files, e.g. `.csv`.
        write: writes a recording, all of it in SI and at full precision, into a new file. Raises
            UsageError when the format cannot hold it, or when a library is missing. A format with
            metadata says there what is `damaged` of the trial's run.
    """

    name: str
    summary: str
    suffix: str
    write: Callable[[TrialView, Recording, Path], None]
