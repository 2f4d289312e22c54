"""A measured hull motion as a signal, from CSV text to acceleration.

The signal reproduces every measured sample exactly. A rate is linear between samples, so its
acceleration is a staircase. An angle is a natural cubic spline, whose second derivative is a
polyline. An acceleration is a polyline itself. Before the series, a lead-in brings the hull from
rest to its initial rate.
"""

from __future__ import annotations

import csv
import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Literal, Self

import numpy as np
from pydantic import ValidationInfo, model_validator

from campaign.axis_kind import in_axis_terms
from campaign.options import Options, TextFile, is_archived
from campaign.signals import Array, Polyline
from campaign.units import ANGLE, ANGULAR_ACCELERATION, ANGULAR_RATE, TIME, Quantity

MOST_ROWS = 100_000
"""of a series; a trial carries all of them."""
KINDS = {"angle": ANGLE, "rate": ANGULAR_RATE, "acceleration": ANGULAR_ACCELERATION}
Kind = Literal["angle", "rate", "acceleration"]


def kind_of(unit: str) -> Kind:
    """The kind of a column in `unit`, in terms of the axis; an angle may be a position.

    Raises ValueError with the allowed units.
    """
    return name_of(unit, KINDS, "a motion")  # type: ignore[return-value]


def name_of(unit: str, quantities: Mapping[str, Quantity], what: str) -> str:
    """Name of the quantity that has a unit. Raises ValueError, about a unit of `what`, for none."""
    for name, quantity in quantities.items():
        try:
            quantity.parse(f"1 {unit}")
        except ValueError:
            continue
        return name
    known = "; ".join(
        f"{in_axis_terms(name)}: {', '.join(q.here.accepts)}" for name, q in quantities.items()
    )
    raise ValueError(f"{unit!r} is no unit of {what}; allowed are {known}")


class SeriesFile(Options):
    """Numbers over time, from a CSV file with a header line."""

    file: TextFile
    """Path of the CSV file, relative to the protocol."""
    value: str
    """Unit of the value column."""
    time: str = "s"
    """Unit of the time column."""
    time_column: str = "time"
    """Header of the time column."""
    value_column: str = "value"
    """Header of the value column."""

    @property
    @abstractmethod
    def quantity(self) -> Quantity:
        """Quantity of the values. Raises ValueError with the allowed units."""

    @model_validator(mode="after")
    def _readable(self, info: ValidationInfo) -> Self:
        if is_archived(info):
            return self  # already read; here the kind of the axis is not known
        TIME.parse(f"1 {self.time}")
        _ = self.quantity
        if self.file.text is not None:
            self.check(*self.samples())
        return self

    def check(self, time: Array, value: Array) -> None:
        """Raise ValueError if the series is not valid."""

    def samples(self) -> tuple[Array, Array]:
        """Times (s, from 0) and values (SI), each shape (n,).

        The separator is a comma, or a semicolon if the header has one. Empty lines and lines that
        begin with # are skipped. Raises ValueError with file and line for any error.
        """
        text, name = self.file.text, self.file.name
        if text is None:
            raise ValueError(f"the text of {name} is not at hand")
        time_factor = TIME.parse(f"1 {self.time}")
        value_factor = self.quantity.parse(f"1 {self.value}")
        rows = _rows(text, name)
        line, header = next(rows, (1, []))
        columns = [cell.strip() for cell in header]
        places = []
        for column in (self.time_column, self.value_column):
            if columns.count(column) != 1:
                how = "no column" if column not in columns else "more than one column"
                headers = ", ".join(columns) or "none"
                raise ValueError(f"{name}:{line}: {how} '{column}'; the columns are {headers}")
            places.append(columns.index(column))
        times: list[float] = []
        values: list[float] = []
        for line, row in rows:
            at = f"{name}:{line}"
            if len(row) != len(columns):
                raise ValueError(f"{at}: {len(row)} values under {len(columns)} columns")
            if len(times) == MOST_ROWS:
                raise ValueError(f"{at}: more than {MOST_ROWS} rows; resample the series")
            time, number = (_number(row[place], at) for place in places)
            if times and time <= times[-1]:
                raise ValueError(f"{at}: the time {time:g} does not come after {times[-1]:g}")
            times.append(time)
            values.append(number)
        if len(times) < 2:
            raise ValueError(f"{name}: a series needs at least two rows under its header")
        return (np.array(times) - times[0]) * time_factor, np.array(values) * value_factor


def motion_signal(time: Array, value: Array, kind: Kind, lead_in: float) -> Polyline:
    """Acceleration of the hull (rad/s^2) that produces the series from `lead_in` (s) on.

    An acceleration does not determine the initial rate: its value makes the mean rate of the series
    zero, as for a swinging hull.
    """
    if kind == "rate":
        slope = np.diff(value) / np.diff(time)
        knots, levels = np.repeat(time, 2)[1:-1], np.repeat(slope, 2)
        first = float(value[0])
    elif kind == "angle":
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(time, value, bc_type="natural")
        knots, levels, first = time, spline(time, 2), float(spline(0.0, 1))
    else:
        steps = np.diff(time)
        rate = np.concatenate([[0.0], np.cumsum(0.5 * steps * (value[1:] + value[:-1]))])
        # Mean within each step, of a rate that is a parabola between samples.
        parabola = rate[:-1] + steps * (2 * value[:-1] + value[1:]) / 6
        knots, levels, first = time, value, -float(np.sum(steps * parabola) / time[-1])
    ramp = first / lead_in if lead_in > 0 else 0.0
    return Polyline(
        times=(0.0, lead_in, *(lead_in + knots).tolist()),
        values=(ramp, ramp, *levels.tolist()),
    )


def _rows(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    lines = text.splitlines()
    head = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    separator = ";" if ";" in head else ","
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            yield number, next(csv.reader([line], delimiter=separator, strict=True))
        except (csv.Error, StopIteration) as error:
            raise ValueError(f"{name}:{number}: not readable as CSV: {error}") from None


def _number(text: str, at: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f"{at}: {text.strip()[:40]!r} is not a number") from None
    if not math.isfinite(number):
        raise ValueError(f"{at}: {text.strip()[:40]!r} is not a finite number")
    return number
