"""The results file of a run, `RUN-results.nxs`: names of its groups and fields.

Nothing of it goes into the sealed run, which says what happened; this says what a program of one
version made of it, and another version may make something else.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from campaign.archive.layout.header import PARTIAL, SEALED
from campaign.result import Result, Table

ENDING = f"-results{SEALED}"
FORMAT = 2
"""Version of the layout (`docs/results-as-data.md`)."""
ENTRY = "results"
"""The one group of the file, in place of a run's `run`."""
RECORD = "record"
"""What a program reads back: the same as all else in the file says, as one text."""
HASH = "run/file_sha256"


@dataclass(frozen=True)
class ResultsOfTest:
    """What the analysis of one test found.

    Attributes:
        problem: why there is no result, in one line; empty when there is one.
        program, version: what analysed it: of an installed experiment its distribution.
    """

    name: str
    kind: str
    title: str
    result: Result
    problem: str = ""
    program: str = "campaign"
    version: str = ""


@dataclass(frozen=True)
class RunResults:
    """What analysis found in a run, and in which run.

    Attributes:
        run: the run's name.
        file: the name of its file or folder, beside which this is kept.
        root: the digest that stands for all of the run: `RunReader.identity`.
        date: when the run ended, or began where it has not ended, ISO 8601; never the clock's time.
        version: of this program.
        sources: hash of all the code that analysed: `source_hash`.
        measured_anew: whether the recordings were measured by that code, whatever was archived.
        damaged: in words, what of the run could not be used.
        published: the published values beside what was found; None where none take part.
        telling: test and key of the figure that viewers open first; None without any.
    """

    run: str
    file: str
    root: str
    date: str
    version: str
    sources: str
    tests: tuple[ResultsOfTest, ...]
    title: str = ""
    measured_anew: bool = False
    damaged: tuple[str, ...] = ()
    published: Table | None = None
    telling: tuple[str, str] | None = None


def results_path(run: Path) -> Path:
    """Where the results of the run at `run`, a file or a folder, are kept."""
    name = run.name.removesuffix(SEALED).removesuffix(PARTIAL)
    return run.with_name(f"{name}{ENDING}")
