"""The mapping file: columns to channels, files to trials.

A mapping is a protocol whose tests were executed elsewhere: `[columns.NAME]` maps columns to
channels, `[[test.recording]]` gives a test files in place of trials. Values here are as written;
`derived_channels` converts them to numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from campaign.errors import Problem
from campaign.importing.defects import CHANNEL_KINDS
from campaign.options import Options, spelled
from campaign.protocol.files import Origin, Within
from campaign.protocol.positions import Keys
from campaign.protocol.problems import Fault, allowed, shown, validate
from campaign.text import nearest
from campaign.units import Frequency, Time

TIME = "time"
"""The only key of `[columns.NAME]` that is no channel."""

ChannelName = Annotated[
    str,
    Field(max_length=60),
    spelled(r"[a-z][a-z0-9_]*", "a lower-case letter, then lower-case letters, digits and _"),
]
Repair = Literal["resample", "drop repeated", "mark gaps"]


class MappingError(ValueError):
    """A contradiction between a mapping and its files.

    Attributes:
        keys: place of the error in `[[test.recording]]`; after "columns", in `[columns.NAME]`.
        defect: kind of a defect of the samples that is not accepted, such as `clipping`.
        others: further errors to report together with this one.
    """

    def __init__(self, message: str, keys: Keys = (), *, defect: str = "") -> None:
        self.keys = keys
        self.defect = defect
        self.others: tuple[MappingError, ...] = ()
        super().__init__(message)

    @property
    def of_columns(self) -> bool:
        """Whether its place is in `[columns.NAME]`."""
        return self.keys[:1] == ("columns",)

    @classmethod
    def together(cls, faults: Sequence[MappingError]) -> None:
        """Raise the first error with the others; return if there are none."""
        if faults:
            later = (each for one in faults[1:] for each in (one, *one.others))
            faults[0].others = (*faults[0].others, *later)
            raise faults[0]


class ColumnPlace(Options):
    """Selects a column of a table."""

    column: str | int | None = None
    """Name of the column in the file, or its place from 1."""
    table: str = ""
    """Part of the file with the column, if several have one of that name."""
    file: int | None = Field(default=None, ge=1)
    """Number of the recording's file, from 1, if several have a column of that name."""


class TimeColumn(ColumnPlace):
    """`[columns.NAME.time]`: when each row was sampled."""

    unit: str = ""
    """Unit of the column, such as `ms`; absent: as the file states it."""
    sample_rate: Frequency | None = Field(default=None, gt=0)
    """Rows per second, if no column holds the time."""
    repair: tuple[Repair, ...] = ()
    """Permitted repairs of uneven times; the archive records them."""


class ChannelColumn(ColumnPlace):
    """`[columns.NAME.CHANNEL]`: value = sign * times * (column - offset), then later by `delay`."""

    unit: str = ""
    """Unit of the column; absent: as the file states it. `count` or `%` if it holds these."""
    times: str = ""
    """Scale of the column, such as `35.15 N/V`, if it measures another quantity."""
    uncertainty: str = ""
    """Standard uncertainty (1 sigma) of `times`, in its unit or as a share such as `5 %`. Without
    `times`, a share is the uncertainty of the instrument's scale."""
    offset: float = 0.0
    """Reading of the column at zero, in its own unit."""
    sign: Literal[1, -1] = 1
    """-1: the column counts in the opposite direction."""
    delay: Time = 0.0
    """Delay of the column; corrected by whole samples."""
    derive: str = ""
    """Source channel in place of a column: the rate from the angle."""
    filter: str = Field(default="", max_length=200)
    """Processing by the drive before the recording, in words; kept with the channel."""
    label: str = Field(default="", max_length=120)
    """Name to display; necessary for a channel of your own."""
    repair: tuple[Literal["unwrap"], ...] = ()
    """unwrap: make a wrapped angle continuous."""
    accept: tuple[str, ...] = ()
    """Kinds of expected defects, such as `clipping` of a drive that was meant to be at its limit.
    The report states them."""


class RowCondition(Options):
    """Rows in which a column has a value."""

    column: str | int
    """Name or place of the column."""
    equals: float
    """The value."""


class Trigger(Options):
    """Row in which a column rises through a level."""

    column: str | int
    """Name or place of the column."""
    level: float
    """The level, as the column reads."""
    duration: Time = Field(gt=0)
    """Duration of a trial from there."""


class RecordingEntry(Options):
    """One `[[test.recording]]`: a file, or several of one clock, with one or more trials."""

    file: str | tuple[str, ...]
    """Path relative to the mapping; `*` matches any text: one recording for each file. A list is
    one recording in several files."""
    columns: str = ""
    """NAME of its `[columns.NAME]`; absent if there is one only."""
    table: str = ""
    """Part of the file that holds it, if there are several."""
    start: Time | None = None
    """First time, by the file's clock."""
    stop: Time | None = None
    """Last time, by the file's clock."""
    where: RowCondition | None = None
    """Only the rows in which a column has a value; each stretch of them is a trial."""
    each: str | int | None = None
    """Column that separates trials: one for each stretch in which it is constant."""
    restarts: bool = False
    """A trial for each stretch of the file in which its time increases."""
    trigger: Trigger | None = None
    """A trial starts wherever a column rises through a level."""
    trial: int | None = Field(default=None, ge=1)
    """Number of the trial in the test's plan, from 1; absent: it was not planned."""
    conditions: dict[str, str | float | int | bool] = {}
    """Conditions of the trial, such as `speed = "0.1 rad/s"`."""
    windows: dict[str, tuple[Time, Time]] = {}
    """Parts for the analysis, from the trial's start; absent: the analysis selects them."""
    note: str = Field(default="", max_length=500)
    """Notes on the recording."""

    @property
    def choosing(self) -> tuple[Keys, str | int] | None:
        """The keys and the column that separates trials; None if the entry has none."""
        if self.each is not None:
            return ("each",), self.each
        for key, one in (("where", self.where), ("trigger", self.trigger)):
            if one is not None:
                return (key, "column"), one.column
        return None


class Layout(Options):
    """One `[columns.NAME]`, validated.

    Attributes:
        time: when rows were sampled; None: the file has a clock.
        channels: by the name of the channel.
    """

    time: TimeColumn | None = None
    channels: dict[ChannelName, ChannelColumn]


def layouts(
    columns: Mapping[str, Mapping[str, Any]], origin: Origin, problems: list[Problem]
) -> dict[str, Layout]:
    """The valid layouts by name; problems of the others are appended to `problems`."""
    valid_layouts = {}
    for name, table in columns.items():
        valid: dict[str, TimeColumn | ChannelColumn] = {}
        wrong: list[Problem] = []
        for key, entry in table.items():
            at = Within(origin, ("columns", name, key))
            if not isinstance(entry, Mapping):
                message = f"{shown(entry)} is not a table; write [columns.{name}.{key}]"
                wrong.append(at.problem((), "value", message))
                continue
            model: type[TimeColumn | ChannelColumn] = TimeColumn if key == TIME else ChannelColumn
            one = validate(model, entry, at)
            if isinstance(one, list):
                wrong += one
                continue
            valid[key] = one
            others = [each for each in table if each not in (TIME, key)]
            wrong += (at.problem(*fault) for fault in _column_faults(one, others))
        time = valid.pop(TIME, None)
        at = Within(origin, ("columns", name))
        if not valid and not wrong:
            wrong.append(at.problem((), "key", "no column of it is a channel"))
        layout = validate(Layout, {"time": time, "channels": valid}, at)
        if isinstance(layout, list):
            wrong += layout
        elif not wrong:
            valid_layouts[name] = layout
        problems += wrong
    return valid_layouts


def recordings_of(
    entries: Sequence[Mapping[str, Any]],
    origin: Origin,
    problems: list[Problem],
    windows: Sequence[str] = (),
) -> list[tuple[int, RecordingEntry]]:
    """The valid entries, each with its index; problems are appended to `problems`.

    `windows`: window names that the experiment uses; if empty, any name is valid.
    """
    valid_entries = []
    for index, tree in enumerate(entries):
        at = Within(origin, ("recording", index))
        valid = validate(RecordingEntry, tree, at)
        wrong = (
            valid
            if isinstance(valid, list)
            else [at.problem(*fault) for fault in _recording_faults(valid, windows)]
        )
        problems += wrong
        if not wrong and not isinstance(valid, list):
            valid_entries.append((index, valid))
    return valid_entries


def _recording_faults(entry: RecordingEntry, windows: Sequence[str]) -> Iterator[Fault]:
    names = [entry.file] if isinstance(entry.file, str) else entry.file
    if not names or not all(name.strip() for name in names):
        yield ("file",), "value", "it is empty; name the file that holds the recording"
    if any("\0" in name for name in names):
        yield ("file",), "value", "no file has a name with a NUL character in it"
    for unknown in (name for name in entry.windows if windows and name not in windows):
        message = f"no analysis of this test looks for a window {shown(unknown)}; "
        yield ("windows", unknown), "key", message + allowed(windows) + nearest(unknown, windows)
    for key in ("start", "stop"):
        if entry.restarts and getattr(entry, key) is not None:
            message = f"{key!r} is a time, and with 'restarts' there are several of it"
            yield (key,), "key", message
    several = [k for k in ("where", "each", "trigger") if getattr(entry, k) is not None]
    several += ["restarts"] * entry.restarts
    if len(several) > 1:
        message = f"'{several[0]}' and '{several[1]}' both separate trials; use one of them"
        yield (several[1],), "key", message
    if entry.trial is not None and several:
        message = f"'trial' says which trial it is, and '{several[0]}' that it may be several"
        yield (several[0],), "key", message


def _column_faults(entry: TimeColumn | ChannelColumn, others: Sequence[str]) -> Iterator[Fault]:
    """Contradictions within an entry; `others`: the other channels."""
    if isinstance(entry, TimeColumn):
        if entry.column is not None and entry.sample_rate is not None:
            message = "'sample_rate' is for files without a column of times; remove one of the two"
            yield ("sample_rate",), "key", message
        if entry.column is None and entry.sample_rate is None and not entry.repair:
            yield (), "key", "say which 'column' holds the time, or the 'sample_rate'"
        return
    if entry.column is None and not entry.derive:
        yield (), "key", "say which 'column' it is, or what to 'derive' it from"
    if entry.column is not None and entry.derive:
        yield ("derive",), "key", "it is a 'column' or it is derived; remove one of the two"
    elif entry.derive and entry.derive not in others:
        message = f"there is no channel {shown(entry.derive)} here; {allowed(others)}"
        yield ("derive",), "value", message + nearest(entry.derive, others)
    for unknown in (kind for kind in entry.accept if kind not in CHANNEL_KINDS):
        message = f"{shown(unknown)} is nothing that is looked for; {allowed(CHANNEL_KINDS)}"
        yield ("accept",), "value", message + nearest(unknown, CHANNEL_KINDS)
