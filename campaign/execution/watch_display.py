"""`--watch` of `run` and `resume`: channels of the running trial, drawn in the terminal.

Whoever runs trials only leaves samples and progress here, and goes on at once. A thread of its own
draws them, through a descriptor of its own: a slow terminal sees fewer pictures, one that is gone
none, and no trial waits for either.
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

from campaign.execution.display import CLOSING, counts, current_test, news, time_left
from campaign.execution.progress import Progress
from campaign.plain_text import printable
from campaign.recording import Array, ChannelInfo
from campaign.trial import Trial
from campaign.units import convert

INTERVAL = 0.5
"""s between two pictures."""
MOST = 4000
"""Samples of a channel that are kept; of more, every second one."""
CHANNELS = 3
"""Most channels that are drawn: those that the trial needs first."""
STALE = 1.0
"""s without samples after which another trial is drawn in place of one that has not ended."""
PATIENCE = 1.0
"""s that a picture may take at the end of a run, or before a question."""
NARROW, LOW = 40, 12
"""Columns and rows below which the line of progress stands alone."""
AHEAD = 0.5
"""s of a trial that may come sooner than they pass: a live bench hands over blocks of 0.2 s."""
AFTERWARDS = "as delivered, not live"


class Trace:
    """What has come of one trial, thinned.

    Attributes:
        channels: those that are drawn, at most CHANNELS.
        afterwards: whether samples came sooner than they could be measured: the backend computes
            them, or delivers at the end.
    """

    def __init__(self, trial: Trial, channels: tuple[ChannelInfo, ...], now: float) -> None:
        """`now`: of a steady clock (s)."""
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
        """Take samples that came `now`: time (n,) in s, block (channels, n)."""
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
        """Whether nothing more is to come."""
        return self.end >= self.trial.task.duration - 2.0 / self.trial.task.sample_rate


class WatchDisplay:
    """A subscriber of recorders, and the display of a run; both return at once."""

    def __init__(
        self, terminal: int, size: Callable[[], os.terminal_size] = shutil.get_terminal_size
    ) -> None:
        """`terminal`: the descriptor that is drawn to."""
        self._terminal, self._size = terminal, size
        self._keeping = threading.Lock()  # of what is below, for as long as it takes to look
        self._trace: Trace | None = None
        self._heard = 0.0
        self._progress: Progress | None = None
        self._news: deque[str] = deque()
        self._changed = False
        self._drawing = threading.Lock()  # of the terminal
        self._lines = 0  # of the picture on the screen
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._draw_on, name="watch", daemon=True)
        self._thread.start()

    def seen(
        self, trial: Trial, channels: tuple[ChannelInfo, ...], time_: Array, block: Array
    ) -> None:
        """What recorders tell; see `supervision.Subscriber`."""
        if not len(time_):
            return
        with self._keeping:
            trace, now = self._trace, time.monotonic()
            is_other = trace is None or trace.trial.number != trial.number
            if trace is not None and is_other and not trace.is_over and now - self._heard < STALE:
                return
            if trace is None or is_other or time_[0] <= trace.end:  # the last: a further attempt
                trace = self._trace = Trace(trial, channels, now)
            trace.add(time_, block, now)
            self._heard, self._changed = now, True

    def __call__(self, progress: Progress) -> None:
        """Keep the state of the run, to be shown soon."""
        with self._keeping:
            self._progress, self._changed = progress, True
            self._news.extend(line.plain for line in news(progress))

    @contextmanager
    def hidden(self) -> Iterator[None]:
        """Nothing is drawn inside the block; the last picture stays above it."""
        free = self._drawing.acquire(timeout=PATIENCE)
        self._lines = 0
        try:
            yield
        finally:
            if free:
                self._drawing.release()

    def end(self) -> None:
        """A last picture, if the terminal takes it soon."""
        self._ended.set()
        self._thread.join(PATIENCE)

    def _draw_on(self) -> None:
        with suppress(OSError):  # the terminal is gone: the run is not to end by it
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
                told = [printable(line) for line in self._news]
                self._news.clear()
            columns, rows = self._size()
            picture = []
            if trace is not None and columns >= NARROW and rows >= LOW:
                picture = drawn(trace, samples, columns - 1, rows - 3)
            if progress is not None:
                picture.append(_line(progress)[: columns - 1])
            up = f"\x1b[{self._lines}F" if self._lines else ""
            text = "\n".join([*told, *picture, ""])
            self._lines = len(picture)
            self._write(f"{up}\x1b[J{text}".encode(errors="replace"))

    def _write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._terminal, data) :]


def drawn(trace: Trace, samples: Array, width: int, height: int) -> list[str]:
    """Lines of a picture: a heading, and each channel in its unit over time (s)."""
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
    parts = filter(None, (counts(progress), time_left(progress)))
    return f"{printable(current_test(progress))}: {', '.join(parts)}"
