"""One test of an archived run: its trials and its analysis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.api.damage_warnings import report_damage
from campaign.api.estimates import findings_table, metrics_table
from campaign.api.tables import result_table, trials_table
from campaign.api.trial import TrialView
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.sound_samples import Trials, without_damaged
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import TestData
from campaign.result import Result
from campaign.trial import Tree

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class TestView:
    """One test of a run; iterating over it gives its executed trials.

    Attributes:
        options: normalized (SI), before the sweep.
        archived: its executed trials, in plan order.
        run: path of the run.
        damaged: damage of this test, or of no trial, that was detected at opening of the run.
        strict: whether a damaged trial that an analysis leaves out is an error.
        measure_anew: whether the analysis measures the recordings and ignores archived metrics.
    """

    __test__ = False  # no class of pytest's

    name: str
    kind: str
    title: str
    options: Tree
    archived: Sequence[ArchivedTrial] = field(repr=False)
    run: Path = field(default=Path(), repr=False)
    damaged: tuple[Damage, ...] = field(default=(), repr=False)
    strict: bool = field(default=False, repr=False)
    measure_anew: bool = field(default=False, repr=False)

    @property
    def trials(self) -> pd.DataFrame:
        """One row per executed trial, its number as index; `attrs["damaged"]` as for the run."""
        return trials_table(self.archived, self.damaged)

    @property
    def result(self) -> Result:
        """Result of the experiment's analysis of these trials; computed once.

        The analysis leaves damaged trials out; an ArchiveWarning names them.

        Raises UsageError if no experiment of that kind is installed; ArchiveError for trials left
        out if the run was opened with `strict`.
        """
        return self._analysed[0]

    @cached_property
    def _analysed(self) -> tuple[Result, tuple[Damage, ...]]:
        """The result, and the damage of the underlying trials."""
        experiment = experiments().get(self.kind)
        if experiment is None:
            raise UsageError(f"no experiment is called {self.kind!r}; install what provides it")

        def analyse(trials: Trials) -> Result:
            return result_of(experiment, TestData(self.name, self.kind, self.options, trials))

        trials = tuple(self.archived)
        if self.measure_anew:
            trials = tuple(trial.unmeasured() for trial in trials)
        result, _, detected = without_damaged(self.run, trials, analyse)
        damaged = tuple(dict.fromkeys((*self.damaged, *detected)))
        left_out = [damage for damage in damaged if damage.trial]
        report_damage(self.run, left_out, strict=self.strict)
        return result, damaged

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of the analysis by their key, unrounded, SI; units in `attrs`.

        `attrs["damaged"]` describes the damage of the underlying trials.
        """
        result, damaged = self._analysed
        return {table.key: result_table(table, damaged) for table in result.tables}

    @property
    def findings(self) -> pd.DataFrame:
        """The numbers of the analysis (SI), one row each, with interval or the reason for none."""
        result, damaged = self._analysed
        return findings_table(result.findings, damaged)

    @property
    def metrics(self) -> pd.DataFrame:
        """Metrics of each recording from execution (SI), one row per number; may be empty.

        Columns: number of the trial, columns of `findings`, and last the code that measured it.
        """
        return metrics_table(self.archived, self.damaged)

    def __iter__(self) -> Iterator[TrialView]:
        return (TrialView(archived, damaged=self.damaged) for archived in self.archived)

    def __len__(self) -> int:
        return len(self.archived)

    def __repr__(self) -> str:
        return f"<test {self.name} ({self.kind}): {len(self)} trials>"
