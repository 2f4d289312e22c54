"""Names of the files and groups of a run.

NeXus allows no hyphen in a name, so the group of trial `trial-00017` is `trial_00017`. In a sealed
run, this is the group of the last attempt; a replaced attempt has `trial_00017_attempt_1`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from campaign.archive.layout.journal import TrialFinished

SEALED = ".nxs"
"""Suffix of a sealed run."""
PARTIAL = ".partial"
"""Suffix of the folder of a run in progress; the files below lie in it."""

RESULTS = f"-results{SEALED}"
"""Ending of the name of a results file."""

HEADER = "run.json"
JOURNAL = "journal.jsonl"
PLAN = "plan.jsonl"
PLAN_TRIALS = "plan-trials.jsonl"
PLAN_TREES = "plan-trees.jsonl"
SEALING = "sealed.nxs.part"
"""The sealed file while it is written."""

TRIAL = ".trial"
"""Suffix of the file of one trial, while its run is in progress."""

TRIAL_FILE = re.compile(r"trial-([0-9]{5,10})(?:-([0-9]{1,6}))?\.(?:trial|nxs)")
"""Name of the file of a trial; older programs wrote `.nxs`."""
ENTRY = re.compile(r"trial_([0-9]{5,10})(?:_attempt_([0-9]{1,6}))?")


def entry_name(trial_number: int) -> str:
    """Name of a trial's group."""
    return f"trial_{trial_number:05d}"


def earlier_entry_name(trial_number: int, attempt: int) -> str:
    """Name of the group of a replaced attempt, in a sealed run."""
    return f"{entry_name(trial_number)}_attempt_{attempt}"


def file_name(trial_number: int, attempt: int) -> str:
    """Name of a trial's file: `trial-00017.trial`; of a second attempt `trial-00017-2.trial`."""
    return f"trial-{trial_number:05d}{f'-{attempt}' if attempt > 1 else ''}{TRIAL}"


def entry_names(attempts: Iterable[TrialFinished]) -> dict[str, TrialFinished]:
    """Every finished attempt by the name of its group in a sealed run, in the order of trials."""
    known = sorted(attempts, key=lambda finished: (finished.trial, finished.attempt))
    last = {finished.trial: finished.attempt for finished in known}
    return {
        entry_name(each.trial)
        if each.attempt == last[each.trial]
        else earlier_entry_name(each.trial, each.attempt): each
        for each in known
    }


def results_path(run: Path) -> Path:
    """Path of the results of the run at `run`, a file or a folder."""
    name = run.name.removesuffix(SEALED).removesuffix(PARTIAL)
    return run.with_name(f"{name}{RESULTS}")
