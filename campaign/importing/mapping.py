"""What a mapping says: which columns are which channels, and which files are which trials.

A mapping is a protocol whose tests were executed elsewhere: `[columns.NAME]` tells how columns
become channels, `[[test.recording]]` which files a test has in place of trials. What stands there
is as written here; `channel_plan` makes numbers of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field

from campaign.errors import Problem
from campaign.importing.defects import CHANNEL_KINDS
from campaign.options import Options, spelled
from campaign.protocol.files import Origin
from campaign.protocol.problems import allowed, nearest, shown, validate
from campaign.units import Frequency, Time

TIME = "time"
"""The key of `[columns.NAME]` that is no channel."""

ChannelName = Annotated[
    str,
    Field(max_length=60),
    spelled(r"[a-z][a-z0-9_]*", "a lower-case letter, then lower-case letters, digits and _"),
]
Repair = Literal["resample", "drop repeated", "mark gaps"]


class ColumnPlace(Options):
    """Which column of which table is meant."""

    column: str | int | None = None
    """Name of the column as the file has it, or its place from 1."""
    table: str = ""
    """The part of the file it is in, where several have a column of that name."""
    file: int | None = Field(default=None, ge=1)
    """Which of a recording's files it is in, from 1, where several have one of that name."""


class TimeColumn(ColumnPlace):
    """`[columns.NAME.time]`: when each row was sampled."""

    unit: str = ""
    """Of the column, as in `ms`; absent: as the file states it."""
    sample_rate: Frequency | None = Field(default=None, gt=0)
    """Where no column holds the time: how many rows there are in a second."""
    repair: tuple[Repair, ...] = ()
    """What may be done to times that are no even clock; it is archived that it was."""


class ChannelColumn(ColumnPlace):
    """`[columns.NAME.CHANNEL]`: value = sign * times * (column - offset), then later by `delay`."""

    unit: str = ""
    """Of the column; absent: as the file states it. `count` or `%` where that is what it counts."""
    times: str = ""
    """By what the column is multiplied, as in `35.15 N/V`, where it measures something else."""
    uncertainty: str = ""
    """Standard uncertainty (1 sigma) of `times`, in its unit; or a share of the value, as in `5 %`,
    which needs no `times`."""
    offset: float = 0.0
    """What the column reads at zero, in its own unit."""
    sign: Literal[1, -1] = 1
    """-1: the column counts the other way."""
    delay: Time = 0.0
    """By how long the column is late; it is put back by whole samples."""
    derive: str = ""
    """Make it from another channel in place of a column: the rate from the angle."""
    filter: str = Field(default="", max_length=200)
    """What the drive did to it before it was recorded, in words; it is kept with the channel."""
    label: str = Field(default="", max_length=120)
    """What people call it; needed where the channel is one of your own."""
    repair: tuple[Literal["unwrap"], ...] = ()
    """unwrap: make an angle continuous whose scale begins anew after each turn."""
    accept: tuple[str, ...] = ()
    """Kinds of what was found in it that are as they should be, such as `clipping` of a drive that
    was meant to be at its limit. A reader is told of them."""


class Where(Options):
    """Rows in which a column has a value."""

    column: str | int
    """Name or place of the column."""
    equals: float
    """What it reads there."""


class Trigger(Options):
    """Where a column rises through a level."""

    column: str | int
    """Name or place of the column."""
    level: float
    """What it rises through, as the column reads."""
    duration: Time = Field(gt=0)
    """How long a trial is from there."""


class RecordingEntry(Options):
    """One `[[test.recording]]`: a file, or several of one clock, that hold a trial or some."""

    file: str | tuple[str, ...]
    """Path relative to the mapping; `*` stands for anything there: one recording for each file. A
    list is one recording that lies in several files."""
    columns: str = ""
    """Which `[columns.NAME]` it is read by; absent where there is one."""
    table: str = ""
    """The part of the file that holds it, where there are several."""
    start: Time | None = None
    """Begin here, by the file's own time..."""
    stop: Time | None = None
    """... and end here."""
    where: Where | None = None
    """Only the rows in which a column has a value; each stretch of them is a trial."""
    each: str | int | None = None
    """A column that tells trials apart: a trial for each stretch in which it does not change."""
    restarts: bool = False
    """A trial for each stretch of the file in which its time goes on."""
    trigger: Trigger | None = None
    """A trial begins wherever a column rises through a level."""
    trial: int | None = Field(default=None, ge=1)
    """Which of the trials that the test plans this is, from 1; absent: it was planned by nobody."""
    conditions: dict[str, str | float | int | bool] = {}
    """What was set for it, as in `speed = "0.1 rad/s"`."""
    windows: dict[str, tuple[Time, Time]] = {}
    """Parts that an analysis is to use, from the trial's beginning; absent: they are looked for."""
    note: str = Field(default="", max_length=500)
    """Anything worth keeping with it."""


class Layout(Options):
    """One `[columns.NAME]`, validated.

    Attributes:
        time: when rows were sampled; None: the file has a clock.
        channels: by the name of the channel.
    """

    time: TimeColumn | None = None
    channels: dict[ChannelName, ChannelColumn]

    def tree(self) -> dict[str, Any]:
        """As a normalised tree (SI)."""
        return self.model_dump(mode="json", exclude_defaults=True)


def layouts(
    columns: Mapping[str, Mapping[str, Any]], origin: Origin, problems: list[Problem]
) -> dict[str, Layout]:
    """The layouts that are good; what is wrong with the others goes to `problems`."""
    found = {}
    for name, table in columns.items():
        before = len(problems)
        channels: dict[str, ChannelColumn] = {}
        time: TimeColumn | None = None
        for key, entry in table.items():
            at = _Below(origin, ("columns", name, key))
            if not isinstance(entry, Mapping):
                message = f"{shown(entry)} is not a table; write [columns.{name}.{key}]"
                problems.append(at.problem((), "value", message))
                continue
            model: type[TimeColumn | ChannelColumn] = TimeColumn if key == TIME else ChannelColumn
            valid = validate(model, entry, at)
            if isinstance(valid, list):
                problems += valid
            elif isinstance(valid, TimeColumn):
                time = valid
                problems += _time_faults(valid, at)
            else:
                channels[key] = valid
                problems += _channel_faults(key, valid, table, at)
        if not channels and len(problems) == before:
            at = _Below(origin, ("columns", name))
            problems.append(at.problem((), "key", "no column of it is a channel"))
        if len(problems) == before:
            tree = {"time": time, "channels": channels}
            layout = validate(Layout, tree, _Below(origin, ("columns", name)))
            if isinstance(layout, list):
                problems += layout
            else:
                found[name] = layout
    return found


def recordings_of(
    entries: Sequence[Mapping[str, Any]],
    origin: Origin,
    problems: list[Problem],
    windows: Sequence[str] = (),
) -> list[tuple[int, RecordingEntry]]:
    """The entries that are good, each with its place; what is wrong goes to `problems`.

    `windows`: those that the test's experiment looks for; any when empty.
    """
    found = []
    for index, tree in enumerate(entries):
        at = _Below(origin, ("recording", index))
        valid = validate(RecordingEntry, tree, at)
        if isinstance(valid, list):
            problems += valid
            continue
        faults = list(_entry_faults(valid, windows, at))
        problems += faults
        if not faults:
            found.append((index, valid))
    return found


def _entry_faults(entry: RecordingEntry, windows: Sequence[str], at: Origin) -> Iterator[Problem]:
    """What of a valid entry does not go together."""
    if fault := _file_fault(entry.file):
        yield at.problem(("file",), "value", fault)
    for unknown in (name for name in entry.windows if windows and name not in windows):
        message = f"no analysis of this test looks for a window {shown(unknown)}; "
        message += allowed(windows) + nearest(unknown, windows)
        yield at.problem(("windows", unknown), "key", message)
    several = [k for k in ("where", "each", "trigger") if getattr(entry, k) is not None]
    several += ["restarts"] * entry.restarts
    bounded = [key for key in ("start", "stop") if getattr(entry, key) is not None]
    if entry.restarts and bounded:
        message = f"{bounded[0]!r} is a time, and with 'restarts' there are several of it"
        yield at.problem((bounded[0],), "key", message)
    if len(several) > 1:
        message = f"'{several[0]}' and '{several[1]}' both tell trials apart; one may"
        yield at.problem((several[1],), "key", message)
    elif entry.trial is not None and several:
        message = f"'trial' says which trial it is, and '{several[0]}' that it may be several"
        yield at.problem((several[0],), "key", message)


def _file_fault(file: str | tuple[str, ...]) -> str:
    """Why that names no file; "" where it does."""
    names = [file] if isinstance(file, str) else file
    if not names or not all(name.strip() for name in names):
        return "it is empty; name the file that holds the recording"
    if any("\0" in name for name in names):
        return "no file has a name with a NUL character in it"
    return ""


class _Below:
    """The part of an origin that begins at `prefix`."""

    def __init__(self, base: Origin, prefix: tuple[str | int, ...]) -> None:
        self._base = base
        self._prefix = prefix

    def problem(self, keys: Any, aim: Any, message: str) -> Problem:
        return self._base.problem((*self._prefix, *keys), aim, message)


def _time_faults(time: TimeColumn, at: Origin) -> list[Problem]:
    if time.column is not None and time.sample_rate is not None:
        message = "'sample_rate' is for files without a column of times; remove one of the two"
        return [at.problem(("sample_rate",), "key", message)]
    if time.column is None and time.sample_rate is None and not time.repair:
        return [at.problem((), "key", "say which 'column' holds the time, or the 'sample_rate'")]
    return []


def _channel_faults(
    name: str, entry: ChannelColumn, table: Mapping[str, Any], at: Origin
) -> list[Problem]:
    found = []
    if entry.column is None and not entry.derive:
        message = "say which 'column' it is, or what to 'derive' it from"
        found.append(at.problem((), "key", message))
    if entry.column is not None and entry.derive:
        message = "it is a 'column' or it is derived; remove one of the two"
        found.append(at.problem(("derive",), "key", message))
    for kind in entry.accept:
        if kind not in CHANNEL_KINDS:
            message = f"{shown(kind)} is nothing that is looked for; {allowed(CHANNEL_KINDS)}"
            message += nearest(kind, CHANNEL_KINDS)
            found.append(at.problem(("accept",), "value", message))
    if entry.uncertainty and not entry.times and not entry.uncertainty.strip().endswith("%"):
        message = "write it as a share, as in '2 %': only beside 'times' it has a unit of its own"
        found.append(at.problem(("uncertainty",), "value", message))
    others = [key for key in table if key not in (TIME, name)]
    if entry.derive and entry.derive not in others:
        message = f"there is no channel {shown(entry.derive)} here; {allowed(others)}"
        message += nearest(entry.derive, others)
        found.append(at.problem(("derive",), "value", message))
    return found
