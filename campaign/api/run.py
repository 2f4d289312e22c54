"""An archived run: tables of its tests and trials; access to each by name or number."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.api.results import Results, results_view
from campaign.api.tables import metrics_by_trial, trials_table
from campaign.api.test import TestView
from campaign.api.trial import TrialView
from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words, lost_trials, of_test
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError, UsageError
from campaign.recording import Outcome
from campaign.trial import trial_number

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as Drawing


@dataclass(frozen=True, repr=False)
class RunView:
    """A run; iterating over it gives its executed trials, failed ones included, in plan order.

    Attributes:
        strict: whether a damaged trial that an analysis leaves out is an error.
        measure_anew: whether an analysis ignores the archived metrics.
    """

    archive: RunReader
    strict: bool = False
    measure_anew: bool = False

    @property
    def name(self) -> str:
        return self.archive.name

    @property
    def path(self) -> Path:
        """The sealed file, or the folder of a run in progress."""
        return self.archive.path

    @property
    def status(self) -> RunStatus:
        """Status of the run."""
        return self.archive.status

    @property
    def header(self) -> RunHeader:
        """Facts from before the first trial: protocol, versions, host, operator, tags ..."""
        return self.archive.header

    @property
    def damaged(self) -> tuple[Damage, ...]:
        """Damaged, missing or changed contents that were detected at opening."""
        return self.archive.damaged

    @property
    def tests(self) -> pd.DataFrame:
        """One row per test of the protocol, its name as index; attrs as those of `trials`."""
        import pandas as pd

        views = self._tests()
        planned = Counter(trial.test for trial in self.archive.plan)
        outlines = self.archive.outlines
        done = Counter(each.test for each in outlines if each.outcome is Outcome.COMPLETED)
        rows = [
            (view.kind, view.title, planned[view.name], len(view), done[view.name])
            for view in views
        ]
        table = pd.DataFrame(
            rows,
            columns=["kind", "title", "planned", "executed", "completed"],
            index=pd.Index([view.name for view in views], name="test", dtype="object"),
        )
        table.attrs["damaged"] = [in_words(damage) for damage in self.damaged]
        return table

    @property
    def trials(self) -> pd.DataFrame:
        """One row per executed trial, its number as index.

        An unreadable trial has no row; `attrs["damaged"]` names it.
        """
        return trials_table(self.archive.trials, self.damaged)

    def metrics(self) -> pd.DataFrame:
        """One row per executed trial: columns of `trials`, then the metrics of its recording (SI).

        `attrs["units"]` has the units. A test's `metrics` add reasons, methods and origins.
        """
        return metrics_by_trial(self.archive.trials, self.damaged)

    @cached_property
    def results(self) -> Results:
        """Results of all tests: from `RUN-results.nxs`, or from an analysis now.

        The file is not used if it is damaged or of another run or version of the program; an
        ArchiveWarning reports why. `origin` states the source. If the run was opened with `strict`,
        raises ArchiveError for a file that is damaged or of another run, and for trials that the
        analysis leaves out.
        """
        return results_view(self.archive, strict=self.strict, measure_anew=self.measure_anew)

    def plot(self, figure: str = "") -> Drawing:
        """A figure of the report as a matplotlib figure: see `Results.plot`."""
        return self.results.plot(figure)

    def test(self, name: str) -> TestView:
        """The test of that name.

        Raises UsageError without such a test, ArchiveError if the list of tests is damaged.
        """
        views = {view.name: view for view in self._tests()}
        if name in views:
            return views[name]
        if lost := [damage for damage in self.damaged if "provenance/tests" in damage.place]:
            raise ArchiveError(f"{self.path}: no test {name!r} can be found: {in_words(lost[0])}")
        close = difflib.get_close_matches(name, views, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"there are {', '.join(views) or 'none'}"
        raise UsageError(f"{self.name}: there is no test {name!r}; {hint}")

    def __getitem__(self, name: str) -> TestView:
        """Same as `test`: `run["map"].findings`."""
        return self.test(name)

    def trial(self, number: int | str) -> TrialView:
        """The trial of that number or name (`trial-00017`).

        Raises UsageError if it was not executed, ArchiveError if it is unreadable.
        """
        number = trial_number(number) if isinstance(number, str) else number
        if archived := self.archive.executed(number):
            return TrialView(archived, damaged=self.damaged)
        if lost := lost_trials(self.archive).get(number):
            raise ArchiveError(f"{self.path}: trial {number} cannot be read: {in_words(lost)}")
        planned = any(trial.number == number for trial in self.archive.plan)
        why = (
            "was not executed" if planned else f"is not among the {len(self.archive.plan)} planned"
        )
        raise UsageError(f"{self.name}: trial {number} {why}")

    def __iter__(self) -> Iterator[TrialView]:
        return (TrialView(archived, damaged=self.damaged) for archived in self.archive.trials)

    def __len__(self) -> int:
        return len(self.archive.trials)

    def __repr__(self) -> str:
        tests = self._tests()
        count = f"{len(self)} of {len(self.archive.plan)} trials executed"
        count += f", damaged in {len(self.damaged)} places" if self.damaged else ""
        lines = [f"<run {self.name}: {self.status.value}, {count}>"]
        return "\n".join([*lines, *(f"  {view.name} ({view.kind}): {len(view)}" for view in tests)])

    def _repr_html_(self) -> str:
        """HTML for a notebook: the first line of `repr`, and the table of tests."""
        first = escape(repr(self).splitlines()[0])
        return f"<p><code>{first}</code></p>{self.tests.to_html()}"

    def _tests(self) -> list[TestView]:
        """Tests of the protocol, then other tests that have trials."""
        entries = {str(test.get("name", "")): test for test in self.archive.tests}
        kinds = {each.test: each.kind for each in self.archive.outlines}
        views = []
        for name in dict.fromkeys((*entries, *kinds)):
            test = entries.get(name, {})
            options = test.get("options")
            views.append(
                TestView(
                    name=name,
                    kind=str(test.get("kind") or kinds.get(name, "")),
                    title=str(test.get("title") or name),
                    options=options if isinstance(options, dict) else {},
                    archived=self.archive.trials_of(name),
                    run=self.path,
                    damaged=of_test(self.archive, name),
                    strict=self.strict,
                    measure_anew=self.measure_anew,
                )
            )
        return views
