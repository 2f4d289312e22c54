"""Figures of a run by matplotlib; imports the report's drawing code on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING

from campaign.api.analysis import TestAnalysis, analyse_run, published_of
from campaign.archive.layout.results import RunResults
from campaign.archive.reading.run_reader import RunReader
from campaign.experiments import experiments

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(run: RunReader, found: RunResults, wanted: str) -> Figure:
    """Draw a figure of the report from a run's results; see `Results.plot`."""
    from campaign.report.one_figure import sheet_of

    known = {
        test.name: TestAnalysis(
            test.result,
            tuple(each.trial.number for each in run.trials_of(test.name)),
            test.problem,
        )
        for test in found.tests
    }
    tests = analyse_run(run, experiments(), found=known)
    return sheet_of(tests, published_of(run), wanted)
