"""Each archive of a test process is analysed once, however many tests follow or compare it.

That the same archive gives the same result anew is what tests of the report and of `rerun` hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType

import pytest

from campaign.api.analysis import AnalysedTest, analyse_run
from campaign.archive.reading.run_reader import RunReader
from campaign.experiments.interface import Experiment

Known = dict[tuple[object, ...], tuple[AnalysedTest, ...]]
KNOWN: Known = {}


def once(run: RunReader, experiments: Mapping[str, Experiment]) -> tuple[AnalysedTest, ...]:
    """`analyse_run`, unless this very file, unchanged, was analysed before."""
    at = run.path.stat()
    key = (str(run.path), at.st_ino, at.st_mtime_ns, at.st_size)
    if key not in KNOWN:
        KNOWN[key] = analyse_run(run, experiments)
    return KNOWN[key]


@contextmanager
def analysed_once(module: ModuleType) -> Iterator[None]:
    """While inside, `module` asks for analyses here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "analyse_run", once)
        yield
