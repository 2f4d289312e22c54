"""CSV of Rigol oscilloscopes: counted samples, with start and step in the heading.

X,CH1,CH2,Start,Increment,
Sequence,Volt,Volt,-1.000e-03,2.000e-06
0,1.02,0.98,
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from campaign.importing.cells import is_number, value_of
from campaign.importing.dialect import Dialect, split
from campaign.importing.interface import Clock, RecordingError, RecordingFormat, Table
from campaign.importing.rows import beginning, blocks, columns_of

_INDEX = "X,"
_CLOCK = ("Start", "Increment")


def _tables(path: Path) -> Sequence[Table]:
    lines = beginning(path, 3)
    names, units, first = (split(line, ",") for line in [*lines, "", ""][:3])
    count = names.index(_CLOCK[0])
    clock = _clock(path, names, units)
    if len(first) < count or not all(is_number(cell, ".") for cell in first[:count]):
        raise RecordingError.of(path, "no row of numbers follows the heading", 3)
    dialect = Dialect.of_numbers(",", ".", 3, names[:count])
    dialect = replace(dialect, units=("", *units[1:count]))
    return [Table("", columns_of(dialect), partial(blocks, path, dialect), clock)]


def _clock(path: Path, names: Sequence[str], units: Sequence[str]) -> Clock:
    try:
        start, step = (value_of(units[names.index(key)], ".") for key in _CLOCK)
    except (ValueError, IndexError):
        start = step = float("nan")
    if not step > 0:
        message = f"below {' and '.join(_CLOCK)} there is no time of the first sample, and no step"
        raise RecordingError.of(path, message, 2)
    return Clock(step, start)


def _recognises(head: bytes) -> bool:
    first = head.lstrip(b"\xef\xbb\xbf").split(b"\n", 1)[0].decode("ascii", "replace")
    cells = [cell.strip() for cell in first.split(",")]
    return first.startswith(_INDEX) and all(key in cells for key in _CLOCK)


FORMAT = RecordingFormat("rigol", "CSV of a Rigol oscilloscope", (".csv",), _recognises, _tables)
