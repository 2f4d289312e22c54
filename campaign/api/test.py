"""One test of an archived run: its trials, and what its analysis finds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.api.damage_warnings import tell
from campaign.api.estimates import findings_table, metrics_table
from campaign.api.tables import result_table, trials_table
from campaign.api.trial import TrialView
from campaign.archive import ArchivedTrial
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
        options: normalised (SI), before the sweep.
        archived: its executed trials, in plan order.
        run: where the run lies.
        damaged: what was found damaged, in opening the run, of this test, or of no trial.
        strict: whether an analysis that has to leave a trial out is an error.
        measure_anew: whether recordings are measured by this program, whatever is archived of them.
    """

    __test__ = False  # it is not one of pytest's

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
        """What the experiment's analysis finds in these trials, by this program; computed once.

        Trials that are damaged are left out, and an ArchiveWarning names them.

        Raises UsageError when no experiment of that kind is installed, ArchiveError when a trial
        would be left out and the run was opened with `strict`.
        """
        return self._analysed[0]

    @cached_property
    def _analysed(self) -> tuple[Result, tuple[Damage, ...]]:
        """The result, and what is damaged of that which it should be made of."""
        experiment = experiments().get(self.kind)
        if experiment is None:
            raise UsageError(f"no experiment is called {self.kind!r}; install what provides it")

        def analyse(trials: Trials) -> Result:
            return result_of(experiment, TestData(self.name, self.kind, self.options, trials))

        trials = tuple(self.archived)
        if self.measure_anew:
            trials = tuple(trial.unmeasured() for trial in trials)
        result, _, found = without_damaged(self.run, trials, analyse)
        damaged = tuple(dict.fromkeys((*self.damaged, *found)))
        left_out = [damage for damage in damaged if damage.trial]
        tell(self.run, left_out, strict=self.strict)
        return result, damaged

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of the analysis by their key, unrounded, SI; units in `attrs`.

        `attrs["damaged"]` says what is damaged of the trials that they should be made of.
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
        """What was measured in each recording when it was executed (SI), one row per number.

        After the number of the trial, the columns are those of `findings`; the last one says which
        code measured it. Empty where nothing was.
        """
        return metrics_table(self.archived, self.damaged)

    def __iter__(self) -> Iterator[TrialView]:
        return (TrialView(archived, damaged=self.damaged) for archived in self.archived)

    def __len__(self) -> int:
        return len(self.archived)

    def __repr__(self) -> str:
        return f"<test {self.name} ({self.kind}): {len(self)} trials>"
