"""How a run is written in suggested commands."""

from __future__ import annotations

import shlex
from pathlib import Path

RESULTS = Path("results")
"""Where commands look for runs when they are not told."""


def reference(run: Path) -> str:
    """What to type for RUN: its bare name where commands find that, else its path."""
    return shlex.quote(run.stem if run.parent == RESULTS else str(run.with_suffix("")))


def how_to_go_on(run: Path) -> str:
    """What can be done with a run that did not come to its end; each command has its own line."""
    name = reference(run)
    return (
        f"to see them, and to go on from there:\n{typed('report', name)}\n{typed('resume', name)}"
    )


def typed(command: str, *words: str) -> str:
    """A line of a message that is to be typed or copied as it is; no terminal's width breaks it."""
    return " ".join(("  campaign", command, *words))
