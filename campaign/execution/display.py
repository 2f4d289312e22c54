"""Progress display: a live line on a terminal, plain lines elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from typing import IO, Any, Protocol, cast

from rich.console import Console
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as Live
from rich.text import Text

from campaign.execution.progress import Progress
from campaign.plain_text import printable
from campaign.text import clock

PLAIN_INTERVAL = 10.0  # s between plain lines, so that a log stays readable
PATIENCE = 2.0  # s that the archive may take to close before a message is shown
CLOSING = "closing the archive"


class Shown(Protocol):
    """A display that can be hidden during a prompt."""

    def __call__(self, progress: Progress) -> None: ...

    def hidden(self) -> AbstractContextManager[None]:
        """Leave the terminal free inside the block."""


@contextmanager
def progress_display(console: Console) -> Iterator[Shown]:
    """The display for the type of `console`, during the block.

    After the terminal closes, output is dropped: this must not end the run.
    """
    console.file = cast(IO[str], _Droppable(console.file))
    if console.is_terminal and not console.is_dumb_terminal:
        with live_display(console) as display:
            yield display
    else:
        plain = PlainDisplay(console)
        try:
            yield plain
        finally:
            plain.end()


class _Droppable:
    """A stream whose failed writes are dropped."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            self._stream.flush()


@contextmanager
def live_display(console: Console) -> Iterator[LiveDisplay]:
    """One line that is redrawn in place, during the block."""
    live = Live(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[counts]}", markup=False),
        TextColumn("{task.fields[time_left]}", markup=False),
        console=console,
        transient=True,
        expand=True,
    )
    with live:
        yield LiveDisplay(live)


class LiveDisplay:
    """Redraws one line; failed trials and decisions of the run stay above it."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._task: TaskID | None = None

    def __call__(self, progress: Progress) -> None:
        """Show the state of the run."""
        if self._task is None:
            self._task = self._live.add_task("", total=progress.total, counts="", time_left="")
        for line in news(progress):
            self._live.console.print(line)
        self._live.update(
            self._task,
            description=CLOSING if progress.closing else current_test(progress),
            total=progress.total,
            completed=progress.total - progress.left + progress.under_way,
            counts=counts(progress),
            time_left=time_left(progress),
        )

    @contextmanager
    def hidden(self) -> Iterator[None]:
        """Draw nothing inside the block."""
        self._live.stop()
        try:
            yield
        finally:
            self._live.start()


class PlainDisplay:
    """Prints a line when a test begins, when a trial fails, and every `PLAIN_INTERVAL`."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._begun: set[str] = set()
        self._printed = time.monotonic()
        self._patience: threading.Timer | None = None

    def __call__(self, progress: Progress) -> None:
        """Print new lines, if any are due."""
        for line in news(progress):
            self._print(line)
        if progress.closing:
            self._patience = threading.Timer(PATIENCE, self._print, [Text(f"{CLOSING} ...")])
            self._patience.daemon = True
            self._patience.start()
            return
        test = current_test(progress)
        due = time.monotonic() - self._printed >= PLAIN_INTERVAL
        if test and (test not in self._begun or due or not progress.left):
            self._begun.add(test)
            self._print(Text(f"{test}: {standing(progress)}"))

    def hidden(self) -> AbstractContextManager[None]:
        """Nothing to hide: plain lines do not disturb a prompt."""
        return nullcontext()

    def end(self) -> None:
        """Cancel the pending message of a slow archive."""
        if self._patience is not None:
            self._patience.cancel()
            self._patience.join()

    def _print(self, text: Text) -> None:
        self._console.print(text, soft_wrap=True)
        self._printed = time.monotonic()


def news(progress: Progress) -> Iterator[Text]:
    """Lines that stay: a failed trial, a decision of the run."""
    # The end of the run reports interrupted trials and the source of the stop once.
    if progress.ended is not None and progress.ended[1].outcome.failed:
        trial, ending = progress.ended
        reason = f": {ending.reason}" if ending.reason else ""
        line = f"{trial.name} {trial.label} {ending.outcome.value}{reason}"
        yield Text(printable(line), style="yellow")
    if progress.remark:
        yield Text(printable(progress.remark), style="yellow")


def current_test(progress: Progress) -> str:
    """Test of the first running trial, else of the trial that has just ended."""
    if progress.running:
        return progress.running[0].test
    return progress.ended[0].test if progress.ended else ""


def counts(progress: Progress) -> str:
    """`37 done, 1 failed, 2 interrupted, 122 left`."""
    others = {"failed": progress.failed, "interrupted": progress.interrupted}
    other_counts = "".join(f", {number} {name}" for name, number in others.items() if number)
    return f"{progress.done} done{other_counts}, {progress.left} left"


def time_left(progress: Progress) -> str:
    """`about 1:05 left`; empty without a forecast."""
    if progress.time_left is None or not progress.left:
        return ""
    return f"about {clock(progress.time_left)} left"


def standing(progress: Progress) -> str:
    """Counts and remaining time, in one line."""
    return ", ".join(filter(None, (counts(progress), time_left(progress))))
