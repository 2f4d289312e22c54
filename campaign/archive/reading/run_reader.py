"""An opened run: its header, plan, trials and damage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from campaign.archive.layout.files import read_errors, sha256_of
from campaign.archive.layout.full_plan import FullPlan
from campaign.archive.layout.header import PlannedTrial, RunHeader
from campaign.archive.layout.journal import TrialsFollowed
from campaign.archive.layout.journal_summary import Lines
from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.lazy_trials import LazyTrials, Outline
from campaign.recording import SafeState
from campaign.trial import Tree, Trial


@dataclass(frozen=True)
class Glance:
    """Facts of a run for `campaign list`; counts of trials include follow-up trials.

    Attributes:
        failed: excludes `interrupted` trials, which an operator stopped.
        untold: see `RunSummary`.
    """

    header: RunHeader
    planned: int
    status: RunStatus
    ended: str
    finished: int
    failed: int
    interrupted: int
    untold: int = 0


@dataclass(frozen=True)
class RunReader:
    """An archived run. Samples are read only through the `recording()` of a trial.

    Attributes:
        path: the sealed file, or the folder of a run in progress.
        header: facts known before the first trial.
        status, reason, safe_state: how the run ended. The archive of an `incomplete` run does not
            contain its end; the safe state of its bench is not confirmed.
        ended: ISO 8601; empty if incomplete.
        plan: every planned trial, executed or not; follow-up trials come last.
        trials: the executed trials, in plan order, failed ones included. Trials of a sealed run are
            parsed on access; `outlines` lists all of them without parsing.
        story: lines of the journal; for a sealed run without parsed metrics.
        full_plan: full description of every planned trial.
        damaged: items that are unreadable or not as sealed. They are missing elsewhere: a trial
            from `trials`, a line from `plan`; a field of the header has its default. Samples are
            checked only when read, and by `problems`.
        earlier_attempts: by trial number, the attempts that a later one replaced; no analysis uses
            them.
        stages: follow-up trials that depend on earlier results, from the journal; empty in archives
            older than stages. The header counts the trials of the plan without them.
        root: digest of the seal, which covers the whole run: see `checksums`. Empty while the run
            is in progress.
    """

    path: Path
    header: RunHeader
    status: RunStatus
    reason: str
    safe_state: SafeState
    ended: str
    plan: tuple[PlannedTrial, ...]
    trials: Sequence[ArchivedTrial]
    story: Lines = field(repr=False)
    full_plan: FullPlan = field(repr=False)
    damaged: tuple[Damage, ...] = ()
    earlier_attempts: Mapping[int, tuple[ArchivedTrial, ...]] = field(default_factory=dict)
    root: str = ""
    stages: tuple[TrialsFollowed, ...] = ()

    @property
    def name(self) -> str:
        return self.header.name

    @property
    def first_stage(self) -> tuple[PlannedTrial, ...]:
        """The trials that were planned before the run began."""
        return self.plan[: len(self.plan) - sum(len(stage.trials) for stage in self.stages)]

    @property
    def tests(self) -> tuple[Tree, ...]:
        """The protocol's tests: name, kind, title, normalised options ..."""
        return self.header.tests

    def trials_of(self, test: str) -> Sequence[ArchivedTrial]:
        """The executed trials of one test, in plan order."""
        if isinstance(self.trials, LazyTrials):
            return self.trials.of(test)
        return tuple(trial for trial in self.trials if trial.trial.test == test)

    @property
    def outlines(self) -> Iterable[Outline]:
        """Identity and ending of each of `trials`, without parsing records."""
        if isinstance(self.trials, LazyTrials):
            return self.trials.outlines
        return map(Outline.of, self.trials)

    def executed(self, number: int) -> ArchivedTrial | None:
        """The executed trial of that number, or None."""
        places = (place for place, each in enumerate(self.outlines) if each.number == number)
        return next((self.trials[place] for place in places), None)

    @property
    def sealed(self) -> bool:
        return self.path.is_file()

    @property
    def journal(self) -> str:
        """The journal, verbatim."""
        return self.story.text

    @cached_property
    def sha256(self) -> str:
        """Hash of the sealed file as `sha256sum` prints it; of the journal while in progress.

        Raises ArchiveError.
        """
        path = self.path if self.sealed else self.path / JOURNAL
        with read_errors(path):
            return sha256_of(path)

    @property
    def identity(self) -> str:
        """The digest that identifies the content of the run: `root`, or `sha256` without a seal."""
        return self.root or self.sha256

    @contextmanager
    def held_open(self) -> Iterator[None]:
        """Keep the sealed file open in the block, for this thread's reading of samples."""
        if not self.sealed:
            yield
            return
        from campaign.archive.reading import safe_hdf5

        with safe_hdf5.held_open(self.path):
            yield

    def planned(self, number: int) -> Trial:
        """The trial `number` of the plan, executed or not, ready for execution.

        Raises ArchiveError if there is none.
        """
        return self.full_plan.trial(number)

    def problems(self) -> list[str]:
        """Damage of the run, samples included (reads all of them, in constant memory)."""
        known = [f"{self.path}: {damage}" for damage in self.damaged]
        return known + [problem for trial in self.trials for problem in trial.problems()]
