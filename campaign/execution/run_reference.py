"""Spelling of a run in suggested commands."""

from __future__ import annotations

import shlex
from pathlib import Path

RESULTS = Path("results")
"""Default folder of runs."""


def reference(run: Path) -> str:
    """Argument RUN of a command: the bare name of a run in `RESULTS`, else its path."""
    return shlex.quote(run.stem if run.parent == RESULTS else str(run.with_suffix("")))


def how_to_go_on(run: Path) -> str:
    """Suggested commands for an unfinished run, each on its own line."""
    name = reference(run)
    return f"to see them, and to continue:\n{typed('report', name)}\n{typed('resume', name)}"


def typed(command: str, *words: str) -> str:
    """A message line with a command to type or copy; it is never wrapped."""
    return " ".join(("  campaign", command, *words))
