"""The result of verifying a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from campaign.archive.reading.damage import Damage

Progress = Callable[[int], object]
"""Callback with the bytes read since its last call; in total about twice the size of a run."""

STRUCTURE = "structure: not as it was sealed, though everything in it reads as it should"
UNREADABLE_HASH = "structure: has no hash of its own that could be read"
UNFINISHED = "structure: is not the file that the journal says was written"


@dataclass(frozen=True)
class Verification:
    """Result of a verification.

    Attributes:
        path: of the run.
        problems: errors, in the order of detection.
        remarks: items unknown to the format or not part of the run; harmless.
        trials: number of executed trials checked, earlier attempts included.
        datasets: number of datasets compared with their checksums.
        root: digest of the seal, which represents the whole run; empty if there is no seal.
    """

    path: Path
    problems: tuple[Damage, ...]
    remarks: tuple[Damage, ...]
    trials: int
    datasets: int
    root: str = ""

    @property
    def sound(self) -> bool:
        return not self.problems
