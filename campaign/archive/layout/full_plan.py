"""Full description of every planned trial, sufficient to repeat an execution exactly.

Many trials of a plan share benches and options. Each is stored once (`plan-trees.jsonl`) under the
SHA-256 of its canonical JSON; the trials (`plan-trials.jsonl`) refer to it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from campaign.archive.layout.files import write_lines_atomically
from campaign.archive.layout.followup_trials import trials_in
from campaign.archive.layout.journal import TrialsFollowed
from campaign.archive.layout.names import JOURNAL, PLAN_TREES, PLAN_TRIALS
from campaign.archive.layout.record import parse_trees, restored_trial, shared_trees, trees_text
from campaign.archive.layout.run_folder import first_line
from campaign.errors import ArchiveError
from campaign.trial import Tree, Trial, canonical_json


def write_full_plan(folder: Path, trials: Sequence[Trial]) -> None:
    """Write both files into a run's folder, line by line."""
    trees: dict[str, Tree] = {}

    def lines() -> Iterator[str]:
        for trial in trials:
            described, own = shared_trees(trial)
            trees.update(own)
            yield canonical_json(described) + "\n"

    write_lines_atomically(folder / PLAN_TRIALS, lines())
    write_lines_atomically(folder / PLAN_TREES, [trees_text(trees)])


@dataclass(frozen=True)
class FullPlan:
    """The planned trials of a run, read on access.

    Attributes:
        path: path of the run, for messages.
        texts: reads the two files. Raises ArchiveError.
        stages: stages in the journal; their trials follow those of the two files.
    """

    path: Path
    texts: Callable[[], tuple[str, str]] = field(repr=False)
    stages: tuple[TrialsFollowed, ...] = field(default=(), repr=False)

    @cached_property
    def _both(self) -> tuple[str, str]:
        return self.texts()

    @cached_property
    def _lines(self) -> list[str]:
        return self._both[0].splitlines()

    @cached_property
    def _trees(self) -> dict[str, Tree]:
        try:
            return parse_trees(self._both[1])
        except ValueError as error:
            raise ArchiveError(f"{self.path}: {PLAN_TREES}: {error}") from None

    @cached_property
    def _followed(self) -> dict[int, Trial]:
        try:
            return {trial.number: trial for trial in trials_in(self.stages)}
        except (ValueError, TypeError) as error:
            raise ArchiveError(f"{self.path}: {JOURNAL}: {first_line(error)}") from None

    def __len__(self) -> int:
        return len(self._lines) + sum(len(stage.trials) for stage in self.stages)

    def trial(self, number: int) -> Trial:
        """The planned trial `number`, from 1. Raises ArchiveError if it is missing or damaged."""
        if self.stages and number > len(self._lines) and number in self._followed:
            return self._followed[number]
        if not 1 <= number <= len(self._lines):
            raise ArchiveError(f"{self.path}: the plan has no trial {number}")
        try:
            trial = restored_trial(json.loads(self._lines[number - 1]), self._trees)
        except (ValueError, LookupError, TypeError, RecursionError) as error:
            raise self._damaged(PLAN_TRIALS, number, first_line(error)) from None
        if trial.number != number:
            raise self._damaged(PLAN_TRIALS, number, f"holds trial number {trial.number}")
        return trial

    def _damaged(self, name: str, line: int, what: str) -> ArchiveError:
        return ArchiveError(f"{self.path}: {name}, line {line}: {what}")
