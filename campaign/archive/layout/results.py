"""The results file of a run, `RUN-results.nxs`: names of its groups and fields.

It is not part of the sealed run. The run holds the recordings; this file holds the analysis by one
program version, and another version may give other results.
"""

from __future__ import annotations

from dataclasses import dataclass

from campaign.result import Result, Table

FORMAT = 2
"""Version of the layout (`docs/results-as-data.md`)."""
ENTRY = "results"
"""The one group of the file, in place of a run's `run`."""
RECORD = "record"
"""Note that a program reads back: the content of the whole file as one text."""
HASH = "run/file_sha256"


@dataclass(frozen=True)
class ResultsOfTest:
    """Result of the analysis of one test.

    Attributes:
        problem: reason for a missing result, in one line; empty if there is one.
        program, version: the analysis program; for an installed experiment its distribution.
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
    """Results of all tests of a run, with the identity of the run.

    Attributes:
        run: the run's name.
        file: name of its file or folder, beside which the results are stored.
        root: the digest that identifies the run: `RunReader.identity`.
        date: end of the run, or its start if it has not ended, ISO 8601; never the current time.
        version: version of this program.
        sources: hash of all analysis code: `source_hash`.
        measured_anew: whether that code measured the recordings again, despite archived metrics.
        damaged: damage that excluded parts of the run, as text.
        published: comparison with published values; None if there are none.
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
