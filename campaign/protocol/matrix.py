"""The matrix of a test: swept paths, values, product."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field

from campaign.options import Options, TextFile
from campaign.protocol.files import Origin, Within
from campaign.protocol.positions import Keys
from campaign.units import split_quantity

LARGEST_PLAN = 100_000
"""Maximum number of trials without explicit permission."""
LARGEST_AXIS = 10_000_000
"""Maximum number of values of one range; more is an error of the user."""

RANGE_KEYS = frozenset({"start", "stop", "num", "step", "spacing"})


class RangeEntry(Options):
    """`{ start, stop, num, spacing }` or `{ start, stop, step }`."""

    start: str | float
    """First value; text with its unit where the swept field has one."""
    stop: str | float
    """Last value, in the same unit."""
    num: int | None = Field(default=None, ge=1, le=LARGEST_AXIS)
    """Number of values, both ends included."""
    spacing: Literal["linear", "log"] = "linear"
    """Equal steps, or equal ratios."""
    step: str | float | None = None
    """Distance of the values, in the same unit; the last one does not exceed `stop`."""


@dataclass(frozen=True)
class Range:
    """Numbers from `start` on with their unit ("" for bare numbers).

    `spacing` applies only without `step`.
    """

    start: float
    stop: float
    num: int
    unit: str = ""
    step: float | None = None
    spacing: Literal["linear", "log"] = "linear"

    def __len__(self) -> int:
        return self.num

    def value(self, index: int) -> Any:
        """The value as it would be written in TOML."""
        number = self._number(index)
        return f"{number!r} {self.unit}" if self.unit else number

    def _number(self, index: int) -> float:
        if self.step is None and index == self.num - 1 and self.num > 1:
            return self.stop
        if index == 0:
            return self.start
        if self.step is not None:
            number = self.start + index * self.step
        else:
            share = index / (self.num - 1)
            number = (
                self.start * (self.stop / self.start) ** share
                if self.spacing == "log"
                else self.start + share * (self.stop - self.start)
            )
        # 0.1 + 2 * 0.1 must be 0.3 in the plan, in file names and on the page.
        return float(f"{number:.12g}")


@dataclass(frozen=True)
class Axis:
    """One swept path.

    Attributes:
        path: as written, e.g. "bench.axis.inertia".
        keys: the path in the options or, without "bench", in the bench.
        of_bench: whether `keys` is a path in the bench.
        values: a list as written, or a range.
        origin: of the axis.
        listed: whether each value has its own place in the file.
    """

    path: str
    keys: Keys
    of_bench: bool
    values: Sequence[Any] | Range
    origin: Origin
    listed: bool

    def __len__(self) -> int:
        return len(self.values)

    def value(self, index: int) -> Any:
        """The value as written."""
        return self.values.value(index) if isinstance(self.values, Range) else self.values[index]

    def describe(self) -> Any:
        """The values as plain data, a range unexpanded, to compare protocols."""
        if isinstance(self.values, Range):
            return {key: getattr(self.values, key) for key in Range.__dataclass_fields__}
        return [str(v) if isinstance(v, TextFile) else v for v in self.values]

    def value_origin(self, index: int) -> Origin:
        """The place of a value in the file; for a range, the place of the range."""
        return Within(self.origin, (index,)) if self.listed else self.origin


def points(axes: Sequence[Axis]) -> Iterator[tuple[int, ...]]:
    """Indices of the values of every point, first axis slowest."""
    return itertools.product(*(range(len(axis)) for axis in axes))


def count_points(axes: Sequence[Axis]) -> int:
    """Number of points, without expansion."""
    return math.prod(len(axis) for axis in axes)


def flatten(matrix: Mapping[str, Any], prefix: Keys = ()) -> Iterator[tuple[str, Keys, Any]]:
    """Dotted path, keys in the file and value of each axis.

    `"bench.axis.inertia" = [...]` and `bench.axis.inertia = [...]` mean the same, though TOML makes
    one key of the first and three tables of the second.
    """
    for key, value in matrix.items():
        keys = (*prefix, key)
        if isinstance(value, Mapping) and not RANGE_KEYS & value.keys() and value:
            yield from flatten(value, keys)
        else:
            yield ".".join(str(part) for part in keys), keys, value


def make_range(entry: RangeEntry) -> Range:
    """The unexpanded range. Raises ValueError with a message for the user."""
    start, unit = _number(entry.start, "start")
    stop, stop_unit = _number(entry.stop, "stop")
    if unit != stop_unit:
        raise ValueError(f"'start' and 'stop' are in different units: '{unit}' and '{stop_unit}'")
    if entry.step is not None and entry.num is None:
        return _stepped(entry, entry.step, start, stop, unit)
    if entry.num is None or entry.step is not None:
        raise ValueError("a range has either 'num' or 'step' besides 'start' and 'stop'")
    if entry.spacing == "log" and not (start * stop > 0):
        raise ValueError("a log range needs 'start' and 'stop' of one sign, neither zero")
    return Range(start, stop, entry.num, unit, spacing=entry.spacing)


def _stepped(
    entry: RangeEntry, written: str | float, start: float, stop: float, unit: str
) -> Range:
    if entry.spacing == "log":
        raise ValueError("a log range needs 'num', not 'step'")
    step, step_unit = _number(written, "step")
    if step_unit != unit:
        raise ValueError(f"'start' and 'step' are in different units: '{unit}' and '{step_unit}'")
    if step == 0 or (stop - start) * step < 0:
        raise ValueError("'step' never reaches 'stop' from 'start'")
    steps = (stop - start) / step
    if not steps < LARGEST_AXIS:
        raise ValueError(f"over {LARGEST_AXIS} steps from 'start' to 'stop'")
    # Tolerance: the stop belongs to the range although 0.1 is no binary fraction.
    return Range(start, stop, math.floor(steps * (1 + 1e-9) + 1e-9) + 1, unit, step)


def _number(value: str | float, name: str) -> tuple[float, str]:
    if isinstance(value, str):
        number, unit = split_quantity(value)
    else:
        number, unit = float(value), ""
    if not math.isfinite(number):
        raise ValueError(f"'{name}' is not a finite number")
    return number, unit
