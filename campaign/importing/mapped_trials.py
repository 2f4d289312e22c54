"""From an entry of a mapping to described trials of its files."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from campaign.importing.defects.clock import SHORTEST, EvenClock, even_clock
from campaign.importing.derived_channels import (
    PLAIN,
    RigFacts,
    following,
    made_of_channel,
    made_of_column,
)
from campaign.importing.description import (
    Cells,
    ChannelSource,
    ClockUsed,
    FileSnapshot,
    RecordingDescription,
    file_used,
    label,
)
from campaign.importing.mapping import ColumnPlace, Layout, MappingError, RecordingEntry, TimeColumn
from campaign.importing.open_files import OpenedFiles
from campaign.importing.reader import RecordingReader
from campaign.importing.trial_rows import NEEDED, Stretch, by_restart, by_trigger, by_value
from campaign.protocol.positions import Keys
from campaign.text import count
from campaign.unit_grammar import parse_unit

TIMELESS = (
    "the time of its rows is not stated; give the columns a 'time': its column and unit, or "
    'sample_rate = "1 kHz"'
)

DRIFTS = (
    "it is zero where the trial begins, and what that channel reads at rest makes it drift; "
    "'offset' of its column takes that out"
)
"""Remark on a channel that is the integral of another."""


def describe(
    entry: RecordingEntry,
    layout: Layout,
    paths: Sequence[Path],
    names: Sequence[str],
    rig: RigFacts,
    wanted: Collection[str],
) -> tuple[OpenedFiles, tuple[tuple[RecordingDescription, Stretch], ...]]:
    """The trials in the files of an entry; the files stay open.

    Args:
        paths, names: paths of the files, and their names in the mapping.
        wanted: channels to derive from others if no column provides them.

    Raises RecordingError for the files, MappingError for contradictions with the mapping.
    """
    opened = OpenedFiles(paths)
    used = tuple(file_used(*both) for both in zip(paths, names, strict=True))
    finding = _Finding(opened, entry, layout, rig, frozenset(wanted), used)
    try:
        return opened, tuple(finding.trials())
    except BaseException:
        opened.__exit__()
        raise


@contextmanager
def _collected(faults: list[MappingError]) -> Iterator[None]:
    """Collect a MappingError of the block in `faults`, to report all errors together."""
    try:
        yield
    except MappingError as error:
        faults.append(error)


@dataclass(frozen=True)
class _Finding:
    opened: OpenedFiles
    entry: RecordingEntry
    layout: Layout
    rig: RigFacts
    wanted: frozenset[str]
    used: tuple[FileSnapshot, ...]

    def trials(self) -> list[tuple[RecordingDescription, Stretch]]:
        """The described trials. Raises MappingError with all errors."""
        faults: list[MappingError] = []
        remarks: list[str] = []
        cells: dict[str, Cells] = {}
        clocks: dict[tuple[int, int], ClockUsed] = {}
        channels = self.layout.channels
        for name, channel in channels.items():
            if channel.column is not None:
                with _collected(faults), self._told(("columns", name, "column")):
                    cells[name] = self.opened.find(channel, self.entry.table)
        for table in sorted({each.rows_of for each in cells.values()}):
            with _collected(faults):
                clocks[table] = self._clock(*table)
        made: dict[str, ChannelSource] = {}
        for name in (*cells, *(name for name in channels if channels[name].derive)):
            with _collected(faults):
                self._make(name, cells, made, remarks)
        chosen = None
        if choosing := self.entry.choosing:
            key, column = choosing
            with _collected(faults), self._told(key):
                chosen = self.opened.find(ColumnPlace(column=column), self.entry.table)
        MappingError.together(faults)
        for one, remark in following(self.wanted - made.keys(), made, self.rig):
            made[one.name] = one
            remarks.append(remark)
        main = self._main(clocks)
        if chosen is not None and chosen.rows_of != main:
            raise MappingError(f"column {chosen.name!r} has another clock than the channels")
        described = []
        for stretch in self._stretches(main, clocks[main], chosen):
            with _collected(faults):
                described.append((self._described(main, stretch, made, clocks, remarks), stretch))
        MappingError.together(faults)
        return described

    def _make(
        self,
        name: str,
        cells: Mapping[str, Cells],
        made: dict[str, ChannelSource],
        remarks: list[str],
    ) -> None:
        """Add a channel to `made`; omit it if its source has an error."""
        channel = self.layout.channels[name]
        if at := cells.get(name):
            if channel.filter:
                remarks.append(f"{name} was filtered before it was recorded: {channel.filter}")
            unit = self.opened.column(at).unit
            with self._told(("columns", name)):
                made[name] = made_of_column(name, channel, at, unit, self.rig)
        elif source := made.get(channel.derive):
            with self._told(("columns", name, "derive")):
                made[name] = made_of_channel(name, channel, source, self.rig)
            if made[name].how == "integral":
                remarks.append(f"{name} is the integral of {source.name}: {DRIFTS}")
        elif self.layout.channels[channel.derive].derive:
            message = f"{channel.derive} is derived itself; derive {name} from a column"
            raise MappingError(message, ("columns", name, "derive"))

    def _wrong(self, what: object, keys: Keys = (), first: int = 0) -> MappingError:
        """The error for these files, from row `first` on."""
        return MappingError(f"{label(self.used, first)}: {what}", keys)

    @contextmanager
    def _told(self, keys: Keys, first: int = 0) -> Iterator[None]:
        """Convert a ValueError of the block to a MappingError at `keys`."""
        try:
            yield
        except MappingError:
            raise
        except ValueError as error:
            raise self._wrong(error, keys, first) from None

    # Clocks

    def _clock(self, file: int, table: int) -> ClockUsed:
        time, of = self.layout.time or TimeColumn(), self.opened.table(file, table)
        if time.column is None:
            if time.sample_rate is not None:
                return ClockUsed(step=1.0 / time.sample_rate)
            if of.clock is None:
                raise self._wrong(TIMELESS, ("columns",))
            return ClockUsed(step=of.clock.step, start=of.clock.start)
        within = {"file": time.file or file + 1, "table": time.table or of.name}
        with self._told(("columns", "time", "column")):
            cells = self.opened.find(time.model_copy(update=within), self.entry.table)
            if cells.rows_of != (file, table):
                raise ValueError(f"the times of column {cells.name!r} are those of other rows")
        unit = time.unit or self.opened.column(cells).unit
        if unit in PLAIN:
            message = f"the file states no unit of column {cells.name!r}; write unit = ..."
            raise self._wrong(message, ("columns", "time"))
        with self._told(("columns", "time", "unit")):
            one = parse_unit(unit)
            if one.dimensions != parse_unit("s").dimensions:
                raise ValueError(f"{unit!r} is no unit of time")
        return ClockUsed(cells=cells, factor=float(one.factor))

    def _main(self, clocks: dict[tuple[int, int], ClockUsed]) -> tuple[int, int]:
        """The table with the fastest clock, or the longest of these: the others are held."""
        if len(clocks) == 1:
            return next(iter(clocks))

        def slowness(table: tuple[int, int]) -> tuple[float, int]:
            count = self.opened.rows(*table)
            rows = min(count, 1000)
            times = self.opened.times(clocks[table], 0, rows)
            step = float(np.median(np.diff(times))) if rows > 1 else np.inf
            return float(f"{step:.3g}"), -count  # the last digits of a step are its rounding

        return min(clocks, key=slowness)

    # Rows

    def _stretches(
        self, main: tuple[int, int], clock: ClockUsed, chosen: Cells | None
    ) -> Sequence[Stretch]:
        total = self.opened.rows(*main)
        if total < SHORTEST:
            message = f"it has {count(total, 'row')}, and {NEEDED}"
            raise self._wrong(message, ("file",))
        first, stop = self._bounds(clock, total)
        entry = self.entry
        if entry.restarts:
            with self._told(("restarts",)):
                return by_restart(self.opened.times(clock, first, stop), first)
        if chosen is None:
            return [Stretch(first, stop - first, {})]
        name, values = chosen.name, self.opened.part(chosen, first, stop)
        if entry.trigger is not None:
            ends = partial(self._after, clock, entry.trigger.duration, stop)
            with self._told(("trigger",)):
                return by_trigger(values, first, name, entry.trigger.level, ends, stop)
        key, wanted = ("each", None) if entry.where is None else ("where", entry.where.equals)
        with self._told((key,)):
            return by_value(values, first, name, wanted)

    def _after(self, clock: ClockUsed, duration: float, stop: int, rises: np.ndarray) -> np.ndarray:
        times = self.opened.times(clock, 0, stop)
        # Half a sample early: times have finite digits.
        half = 0.5 * float(np.median(np.diff(times)))
        ends = np.searchsorted(times, times[rises] + duration - half, side="left")
        return np.where(times[rises] + duration - 2.0 * half > times[-1], stop + 1, ends)

    def _bounds(self, clock: ClockUsed, total: int) -> tuple[int, int]:
        entry = self.entry
        if entry.start is None and entry.stop is None:
            return 0, total
        times = self.opened.times(clock, 0, total)
        first = 0 if entry.start is None else int(np.searchsorted(times, entry.start))
        stop = total if entry.stop is None else int(np.searchsorted(times, entry.stop))
        if stop - first < SHORTEST:
            begin = "its beginning" if entry.start is None else f"{entry.start:g} s"
            end = "its end" if entry.stop is None else f"{entry.stop:g} s"
            message = (
                f"{count(max(stop - first, 0), 'row')} from {begin} to {end}, and {NEEDED}; its "
                f"times are {times[0]:g} to {times[-1]:g} s"
            )
            key = "stop" if entry.start is None else "start"
            raise self._wrong(message, (key,))
        return first, stop

    # Channels

    def _described(
        self,
        main: tuple[int, int],
        stretch: Stretch,
        columns: dict[str, ChannelSource],
        clocks: dict[tuple[int, int], ClockUsed],
        told: Sequence[str],
    ) -> RecordingDescription:
        clock = clocks[main]
        repairs = self.layout.time.repair if self.layout.time is not None else ()
        with self._told(("file",), stretch.first):
            times = partial(self.opened.times, clock)
            even = even_clock(times, stretch.first, stretch.rows, repairs)
        remarks = [*stretch.remarks, *even.remarks, *told]
        made = list(self._placed(columns, main, clocks, even, remarks))
        shifts = [each.shift for each in made if each.clock is None]
        skip, cut = max(0, -min(shifts, default=0)), max(0, *shifts, 0)
        if (left := even.samples - skip - cut) < SHORTEST:
            what = f"its delays and repairs leave {count(max(left, 0), 'sample')}, and {NEEDED}"
            raise self._wrong(what, ("file",))
        described = RecordingDescription(
            files=self.used,
            table=main,
            first=stretch.first,
            rows=stretch.rows,
            clock=clock,
            sample_rate=even.rate,
            samples=even.samples - skip - cut,
            skip=skip,
            repairs=repairs if even.positions is not None else (),
            channels=tuple(made),
            remarks=tuple(remarks),
        )
        return self._checked(described)

    def _checked(self, described: RecordingDescription) -> RecordingDescription:
        """The description with remarks on defects, and with the periods of channels to unwrap.

        Raises MappingError for defects that the mapping does not accept.
        """
        remarks = list(described.remarks)
        periods: dict[str, float] = {}
        faults: list[MappingError] = []
        for defect in RecordingReader(described, self.opened).defects(self.rig.ratio):
            name = defect.channels[0]
            entry = self.layout.channels[name]
            if defect.kind == "wraparound" and "unwrap" in entry.repair:
                periods[name] = defect.size
                remarks.append(f"{name} was made continuous: {defect.what}")
                continue
            if defect.noted or defect.kind in entry.accept:
                remarks.append(defect.what)
                continue
            what = f"{described.label}: {defect.what}; {defect.remedy}"
            faults.append(MappingError(what, ("columns", name), defect=defect.kind))
        MappingError.together(faults)
        channels = tuple(
            each.model_copy(update={"period": periods.get(each.name)})
            for each in described.channels
        )
        return described.model_copy(update={"channels": channels, "remarks": tuple(remarks)})

    def _placed(
        self,
        made: dict[str, ChannelSource],
        main: tuple[int, int],
        clocks: dict[tuple[int, int], ClockUsed],
        even: EvenClock,
        remarks: list[str],
    ) -> Iterator[ChannelSource]:
        """The channels on an even clock: delays removed, values of slower tables held."""
        for name, one in made.items():
            if one.cells is not None:
                delay = self.layout.channels[name].delay
                if shift := round(delay * even.rate):
                    amount = f"{shift} samples, {shift / even.rate:.6g} s"
                    remarks.append(f"{name} is put back by {amount}")
                of: dict[str, object] = {"shift": shift}
                if (table := one.cells.rows_of) != main:
                    of |= self._slower(clocks[table], table, even)
                one = one.model_copy(update=of)
            yield one

    def _slower(
        self, clock: ClockUsed, table: tuple[int, int], even: EvenClock
    ) -> dict[str, object]:
        rows = self.opened.rows(*table)
        times = self.opened.times(clock, 0, rows)
        step = float(times[-1] - times[0]) / max(rows - 1, 1)
        ends = even.start, even.start + (even.samples - 1) / even.rate
        if step <= 0 or times[0] > ends[0] + step or times[-1] + step < ends[1] - step:
            what = self.opened.table(*table).name or self.used[table[0]].name
            message = (
                f"{what} has times {times[0]:.6g} to {times[-1]:.6g} s, the trial {ends[0]:.6g} to "
                f"{ends[1]:.6g} s; cut it by start and stop, or correct a clock"
            )
            raise self._wrong(message, ("file",))
        return {"clock": clock, "own_rate": 1.0 / step}
