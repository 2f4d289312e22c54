"""One test of an archived run: its trials, and what its analysis finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from campaign.access.tables import result_table, trials_table
from campaign.access.trial import TrialView
from campaign.archive import ArchivedTrial
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.experiments.interface import TestData, result_of
from campaign.result import Result
from campaign.trial import Tree

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class TestView:
    """One test of a run; iterating over it gives its executed trials.

    Attributes:
        options: normalised (SI), before the sweep.
        archived: its executed trials, in plan order.
    """

    __test__ = False  # it is not one of pytest's

    name: str
    kind: str
    title: str
    options: Tree
    archived: tuple[ArchivedTrial, ...] = field(repr=False)

    @property
    def trials(self) -> pd.DataFrame:
        """One row per executed trial, its number as index."""
        return trials_table(self.archived)

    @cached_property
    def result(self) -> Result:
        """What the experiment's analysis finds in these trials, by this program; computed once.

        Raises UsageError when no experiment of that kind is installed.
        """
        experiment = experiments().get(self.kind)
        if experiment is None:
            raise UsageError(f"no experiment is called {self.kind!r}; install what provides it")
        data = TestData(self.name, self.kind, self.options, self.archived)
        return result_of(experiment, data)

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of the analysis by their key, unrounded, SI; units in `attrs`."""
        return {table.key: result_table(table) for table in self.result.tables}

    def __iter__(self) -> Iterator[TrialView]:
        return (TrialView(archived) for archived in self.archived)

    def __len__(self) -> int:
        return len(self.archived)

    def __repr__(self) -> str:
        return f"<test {self.name} ({self.kind}): {len(self)} trials>"
