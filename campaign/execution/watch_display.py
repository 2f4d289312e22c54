"""`--watch` of `run` and `resume`: channels of the running trial, drawn in the terminal.

Trials store samples and progress here without waiting. A separate thread draws them through its own
descriptor: a slow terminal receives fewer pictures, a closed terminal none, and no trial waits.
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from campaign.execution.display import CLOSING, current_test, news, standing
from campaign.execution.progress import Progress
from campaign.plain_text import printable
from campaign.recording import Array, ChannelInfo
from campaign.trial import Trial
from campaign.units import convert

INTERVAL = 0.5
"""s between two pictures."""
MOST = 4000
"""Maximum number of samples kept per channel; beyond it, every second sample is dropped."""
CHANNELS = 3
"""Maximum number of drawn channels; those that the trial requires come first."""
STALE = 1.0
"""s without samples after which another trial replaces an unfinished one."""
PATIENCE = 1.0
"""s; maximum wait for a picture at the end of a run, or before a prompt."""
NARROW, LOW = 40, 12
"""Columns and rows below which only the progress line is drawn."""
AHEAD = 0.5
"""s by which samples may precede the wall clock: a live bench delivers blocks of 0.2 s."""
AFTERWARDS = "as delivered, not live"


class Trace:
    """Thinned samples of one trial.

    Attributes:
        channels: the drawn channels, at most CHANNELS.
        afterwards: whether samples came faster than real time: computed, or delivered at the end.
    """

    def __init__(self, trial: Trial, channels: tuple[ChannelInfo, ...], now: float) -> None:
        """`now`: time of a monotonic clock (s)."""
        wanted = sorted(enumerate(channels), key=lambda each: each[1].name not in trial.requires)
        chosen = wanted[:CHANNELS]
        self.trial = trial
        self.channels = tuple(info for _, info in chosen)
        self.afterwards = False
        self.end = -np.inf  # time of the last sample (s)
        self._began = now
        self._rows = [row for row, _ in chosen]
        self._parts: list[Array] = []
        self._stride = 1

    def add(self, time: Array, block: Array, now: float) -> None:
        """Add samples received at `now`: time (n,) in s, block (channels, n)."""
        self._stride = max(self._stride, len(time) // MOST)
        self.end = float(time[-1])
        self.afterwards = self.afterwards or self.end > now - self._began + AHEAD
        self._parts.append(np.vstack((time, block[self._rows]))[:, :: self._stride])
        if sum(part.shape[1] for part in self._parts) > MOST:
            self._parts = [np.hstack(self._parts)[:, ::2]]
            self._stride *= 2

    def samples(self) -> Array:
        """Time (s) and channels (SI), shape (1 + channels, n)."""
        return np.hstack(self._parts)

    @property
    def is_over(self) -> bool:
        """Whether the trial has no more samples."""
        return self.end >= self.trial.task.duration - 2.0 / self.trial.task.sample_rate


class WatchDisplay:
    """A subscriber of recorders, and the display of a run; both return at once."""

    def __init__(
        self, terminal: int, size: Callable[[], os.terminal_size] = shutil.get_terminal_size
    ) -> None:
        """`terminal`: descriptor of the output."""
        self._terminal, self._size = terminal, size
        self._keeping = threading.Lock()  # guards the fields below; held briefly
        self._trace: Trace | None = None
        self._heard = 0.0
        self._progress: Progress | None = None
        self._news: deque[str] = deque()
        self._changed = False
        self._drawing = threading.Lock()  # guards the terminal
        self._lines = 0  # lines of the picture on the screen
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._draw_on, name="watch", daemon=True)
        self._thread.start()

    def seen(
        self, trial: Trial, channels: tuple[ChannelInfo, ...], time_: Array, block: Array
    ) -> None:
        """Store new samples; see `supervision.Subscriber`."""
        if not len(time_):
            return
        with self._keeping:
            trace, now = self._trace, time.monotonic()
            is_other = trace is None or trace.trial.number != trial.number
            if trace is not None and is_other and not trace.is_over and now - self._heard < STALE:
                return
            if trace is None or is_other or time_[0] <= trace.end:  # the last: another attempt
                trace = self._trace = Trace(trial, channels, now)
            trace.add(time_, block, now)
            self._heard, self._changed = now, True

    def __call__(self, progress: Progress) -> None:
        """Store the state of the run for the next picture."""
        with self._keeping:
            self._progress, self._changed = progress, True
            self._news.extend(line.plain for line in news(progress))

    @contextmanager
    def hidden(self) -> Iterator[None]:
        """Draw nothing inside the block; the last picture stays above it."""
        free = self._drawing.acquire(timeout=PATIENCE)
        self._lines = 0
        try:
            yield
        finally:
            if free:
                self._drawing.release()

    def end(self) -> None:
        """Draw a last picture, within PATIENCE."""
        self._ended.set()
        self._thread.join(PATIENCE)

    def _draw_on(self) -> None:
        with suppress(OSError):  # a closed terminal must not end the run
            while not self._ended.wait(INTERVAL):
                self._draw()
            self._draw()

    def _draw(self) -> None:
        with self._drawing:
            with self._keeping:
                if not self._changed:
                    return
                self._changed = False
                progress, trace = self._progress, self._trace
                samples = trace.samples() if trace else np.empty((1, 0))
                lines = [printable(line) for line in self._news]
                self._news.clear()
            columns, rows = self._size()
            picture = []
            if trace is not None and columns >= NARROW and rows >= LOW:
                picture = drawn(trace, samples, columns - 1, rows - 3)
            if progress is not None:
                picture.append(_line(progress)[: columns - 1])
            up = f"\x1b[{self._lines}F" if self._lines else ""
            text = "\n".join([*lines, *picture, ""])
            self._lines = len(picture)
            self._write(f"{up}\x1b[J{text}".encode(errors="replace"))

    def _write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._terminal, data) :]


def drawn(trace: Trace, samples: Array, width: int, height: int) -> list[str]:
    """Lines of a picture: a heading, and each channel in its display unit over time (s)."""
    import plotext

    about = trace.trial
    how = f" ({AFTERWARDS})" if trace.afterwards else ""
    lines = [printable(f"{about.test}: {about.name} {about.label}{how}")[:width]]
    each = max(6, (height - 1) // max(len(trace.channels), 1))
    for info, values in zip(trace.channels, samples[1:], strict=False):
        if len(lines) + each > height:
            break
        shown = np.asarray(convert(values, info.unit, info.display_unit), dtype=float)
        good = np.isfinite(shown)
        lines += _plot(plotext, info, samples[0][good], shown[good], (width, each), about)
    return lines


def _plot(
    plotext: Any, info: ChannelInfo, x: Array, y: Array, size: tuple[int, int], trial: Trial
) -> list[str]:
    stride = max(1, len(x) // (2 * size[0]))
    plotext.clear_figure()
    plotext.theme("clear")
    plotext.limit_size(False, False)
    plotext.plot_size(*size)
    plotext.xlim(0.0, trial.task.duration)
    plotext.title(printable(f"{info.label} ({info.display_unit})"))
    plotext.plot(x[::stride].tolist(), y[::stride].tolist(), marker="braille")
    text: str = plotext.build()
    return text.replace("\x1b[0m", "").splitlines()


def _line(progress: Progress) -> str:
    if progress.closing:
        return CLOSING
    return f"{printable(current_test(progress))}: {standing(progress)}"
