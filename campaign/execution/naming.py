"""How a run is named in the commands that a user is told to type."""

from __future__ import annotations

import shlex
from pathlib import Path

RESULTS = Path("results")
"""Where commands look for runs when they are not told."""


def reference(run: Path) -> str:
    """What to type for RUN: its bare name where commands find that, else its path."""
    return shlex.quote(run.stem if run.parent == RESULTS else str(run.with_suffix("")))


def how_to_go_on(run: Path) -> str:
    """What can be done with a run that did not come to its end."""
    name = reference(run)
    return f"`campaign report {name}` shows them, `campaign resume {name}` goes on from there"
