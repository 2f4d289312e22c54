"""The result of verifying a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from campaign.archive.reading.damage import Damage

Progress = Callable[[int], object]
"""Is told how many bytes were read since the last time; about twice a run's bytes in all."""

STRUCTURE = "structure: not as it was sealed, though everything in it reads as it should"
UNREADABLE_HASH = "structure: has no hash of its own that could be read"
UNFINISHED = "structure: is not the file that the journal says was written"


@dataclass(frozen=True)
class Verification:
    """What was found.

    Attributes:
        path: of the run.
        problems: what is wrong, in the order it was found.
        remarks: what the format does not know, or what is not part of the run; harmless.
        trials: executed ones that were looked at, earlier attempts included.
        datasets: how many were read against their checksums.
        root: digest of the seal, which stands for the whole run; empty where there is none.
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
