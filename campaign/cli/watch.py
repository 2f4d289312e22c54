"""`--watch` of `run` and `resume`: whether it can be drawn here, and where."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console

from campaign.cli.output import print_note
from campaign.errors import UsageError
from campaign.execution.display import Shown, progress_display
from campaign.execution.watch_display import WatchDisplay


def require_watch(executor: str) -> None:
    """Raises UsageError, before anything moves, when nothing could be drawn."""
    if importlib.util.find_spec("plotext") is None:
        raise UsageError("--watch needs plotext: pip install 'campaign[watch]'")
    if executor:
        raise UsageError("--watch shows trials of this process; leave --executor out")


@contextmanager
def watching(console: Console) -> Iterator[Shown]:
    """Channels of the running trial, for as long as the block lasts; else the usual display."""
    if not console.is_terminal or console.is_dumb_terminal:
        print_note("--watch: this terminal cannot show pictures; progress is printed in lines")
        with progress_display(console) as usual:
            yield usual
        return
    display = WatchDisplay(os.dup(console.file.fileno()))
    try:
        yield display
    finally:
        display.end()
