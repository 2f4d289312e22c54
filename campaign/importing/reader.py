"""Samples of a described recording, read block by block."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from campaign.importing.defects import Defect, find
from campaign.importing.defects.clock import EvenClock, even_clock
from campaign.importing.defects.samples import continuous
from campaign.importing.description import (
    Cells,
    ChannelSource,
    ClockUsed,
    RecordingDescription,
    file_used,
)
from campaign.importing.interface import ROWS, Array, RecordingError
from campaign.importing.open_files import OpenedFiles
from campaign.recording import Channel, Recording

AT_ONCE = 2_000_000
"""Samples that are examined at once: memory does not grow with a recording."""


class RecordingReader:
    """Channels of a recording over the trial's own time.

    Raises RecordingError if its files have changed.
    """

    def __init__(self, described: RecordingDescription, opened: OpenedFiles) -> None:
        self.described = described
        self._opened = opened
        self._made = {each.name: each for each in described.channels}
        for each in described.channels:
            for clock in (described.clock, each.clock):
                if clock is not None and clock.cells is not None:
                    opened.want(clock.cells)
            if each.cells is not None:
                opened.want(each.cells)
        self._whole: dict[str, Array] = {}
        self._positions: Array | None = None
        if described.repairs:
            self._positions = self._even().positions

    def blocks(self, size: int = ROWS) -> Iterator[tuple[Array, Array, np.ndarray]]:
        """Time (n,), samples (channels, n) in the described order, and mask of lost rows (n,)."""
        names = [each.name for each in self.described.channels]
        for first in range(0, self.described.samples, size):
            stop = min(first + size, self.described.samples)
            time = np.arange(first, stop) / self.described.sample_rate
            yield time, self.samples(names, first, stop), self._lost(first, stop)

    def samples(self, names: Collection[str], first: int, stop: int) -> Array:
        """Samples [first, stop) of some channels, shape (channels, stop - first)."""
        return np.array([self._channel(self._made[name], first, stop) for name in names])

    def recording(self, names: Collection[str]) -> Recording:
        """All samples of some channels."""
        count = self.described.samples
        samples = zip(names, self.samples(names, 0, count), strict=True)
        channels: dict[str, Channel] = {
            name: self._made[name].info.with_samples(values) for name, values in samples
        }
        return Recording(np.arange(count) / self.described.sample_rate, channels)

    def defects(self, gear: float | None) -> Iterator[Defect]:
        """Defects of the channels from columns, on the trial's even clock; each kind once.

        A long recording is examined in parts; rows are those of the trial.
        """
        recording = self.described
        names = [each.name for each in recording.channels if each.how == "column"]
        reported = set()
        for first in range(0, recording.samples, AT_ONCE):
            stop = min(first + AT_ONCE, recording.samples)
            if stop - first < 2 and first:
                return
            samples = self.samples(names, first, stop)
            time = np.arange(first, stop) / recording.sample_rate
            for each in find(time, dict(zip(names, samples, strict=True)), gear=gear):
                if (each.kind, each.channels) not in reported:
                    reported.add((each.kind, each.channels))
                    yield replace(each, rows=(each.rows[0] + first, each.rows[1] + first))

    def _channel(self, made: ChannelSource, first: int, stop: int) -> Array:
        if made.period is not None or made.how == "integral":
            return self._all_of(made)[first:stop]
        if made.cells is not None:
            return made.factor * (self._column(made, made.cells, first, stop) - made.offset)
        source = self._made[made.source]
        if made.how == "copy":
            return made.factor * self._channel(source, first, stop)
        before, after = max(first - 1, 0), min(stop + 1, self.described.samples)
        values = self._channel(source, before, after)
        slope = np.gradient(values) if len(values) > 1 else np.zeros(len(values))
        cut: Array = slope[first - before : first - before + stop - first]
        return made.factor * self.described.sample_rate * cut

    def _all_of(self, made: ChannelSource) -> Array:
        """All samples of an unwrapped or integrated channel, cached: they need all samples before.

        The integral uses trapezoids; after a lost sample it is unknown.
        """
        if made.name not in self._whole:
            plain = made.model_copy(update={"period": None})
            of = self._made[made.source] if made.how == "integral" else plain
            values = self._channel(of, 0, self.described.samples)
            if made.how == "integral":
                steps = 0.5 * (values[1:] + values[:-1]) / self.described.sample_rate
                values = made.factor * np.concatenate([[0.0], np.cumsum(steps)])
            if made.period is not None:
                values = continuous(values, made.period)
            self._whole[made.name] = values
        return self._whole[made.name]

    def _column(self, made: ChannelSource, cells: Cells, first: int, stop: int) -> Array:
        if made.clock is not None:
            return self._held(made, cells, made.clock, first, stop)
        places = np.arange(first, stop) + self.described.skip + made.shift
        begin = self.described.first
        if self._positions is None:
            low = begin + int(places[0])
            return self._opened.part(cells, low, low + stop - first)
        at = self._positions[places]
        known = np.isfinite(at)
        values = np.full(len(at), np.nan)
        if known.any():
            low, high = int(np.floor(at[known].min())), int(np.ceil(at[known].max()))
            rows = self._opened.part(cells, begin + low, begin + high + 1)
            values[known] = np.interp(at[known] - low, np.arange(len(rows)), rows)
        return values

    def _held(
        self, made: ChannelSource, cells: Cells, clock: ClockUsed, first: int, stop: int
    ) -> Array:
        """Samples of a channel on another clock: the last known value at each time."""
        count = self._opened.rows(*cells.rows_of)
        times = self._opened.times(clock, 0, count)
        values = self._opened.part(cells, 0, count)
        row = self.described.first
        start = float(self._opened.times(self.described.clock, row, row + 1)[0])
        wanted = np.arange(first, stop) + self.described.skip + made.shift
        at = start + wanted / self.described.sample_rate
        # Half a millionth of a sample: both clocks are written with finite digits.
        slack = 5e-7 / self.described.sample_rate
        index = np.searchsorted(times, at + slack, side="right") - 1
        # Unknown before the first value and later than a step after the last one.
        step = (times[-1] - times[0]) / max(count - 1, 1)
        known = (index >= 0) & (at <= times[-1] + step + slack)
        return np.where(known, values[np.maximum(index, 0)], np.nan)

    def _lost(self, first: int, stop: int) -> np.ndarray:
        if self._positions is None:
            return np.zeros(stop - first, dtype=bool)
        skip = self.described.skip
        lost: np.ndarray = ~np.isfinite(self._positions[first + skip : stop + skip])
        return lost

    def _even(self) -> EvenClock:
        recording = self.described
        try:
            times = partial(self._opened.times, recording.clock)
            return even_clock(times, recording.first, recording.rows, recording.repairs)
        except ValueError as error:  # the file changed: the plan had an even clock
            path = self._opened.paths[recording.table[0]]
            raise RecordingError.of(path, str(error)) from None


def paths_unchanged(described: RecordingDescription) -> Sequence[Path]:
    """The files of a recording. Raises RecordingError if one has changed."""
    paths = []
    for used in described.files:
        path = Path(used.path)
        if file_used(path, used.name).sha256 != used.sha256:
            message = "it has changed since it was mapped (its SHA-256 is another)"
            raise RecordingError.of(path, message)
        paths.append(path)
    return paths
