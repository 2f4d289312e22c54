"""Spelling of a run in suggested commands."""

from __future__ import annotations

import shlex
from pathlib import Path

RESULTS = Path("results")
"""Default folder of runs."""


def reference(run: Path) -> str:
    """Argument RUN of a command: the bare name of a run in `RESULTS`, else its path."""
    return shlex.quote(run.stem if run.parent == RESULTS else str(run.with_suffix("")))


def finished_trials(run: Path) -> str:
    """Place of an unfinished run, and suggested commands, each on its own line."""
    name = reference(run)
    commands = f"{typed('report', name)}\n{typed('resume', name)}"
    return f"the finished trials are in {run}; to see them, and to continue:\n{commands}"


def typed(command: str, *words: str) -> str:
    """A message line with a command to type or copy; it is never wrapped."""
    return " ".join(("  campaign", command, *words))
