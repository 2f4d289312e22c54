"""The rows above a table of text that belong to its columns: names, and units, wherever they are.

Instruments have habits of their own: names in the row of units, channels by number, a key and its
value for each column.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

from campaign.importing.cells import is_number, is_unit, name_and_unit, without_brackets

MOST = 3
"""Rows of a heading that belong to columns: names, units, and one more."""
Heading = tuple[tuple[str, ...], tuple[str, ...], int]
"""Names, units, and how many rows above the table they take."""


def heading(above: Sequence[list[str]], columns: int) -> Heading:
    """What the rows above a table say of its columns; no names where they say none."""
    near = takewhile(lambda cells: len(cells) in (columns, columns + 1), reversed(above[-MOST:]))
    rows = [cells for cells in reversed(list(near)) if any(cells)]
    paired = _pairs(rows, columns)
    if paired is not None:
        return paired
    # Of comments only the last can be a heading, and the one above it if that is of units; those
    # above are sentences.
    commented = [k for k, cells in enumerate(rows) if cells[0][:1] in ("#", "%")]
    if commented:
        last = commented[-1]
        bare = _unmarked(rows[last])
        named = last - 1 in commented and any(bare) and _all_units(bare)
        rows = rows[last - named :]
    rows = [_unmarked(cells) for cells in rows]
    # A mark of a comment may be a cell of its own. An index without a name is a column, and so is
    # one without a unit; what is one cell too long then ends with a separator.
    marked = [not cells[0] and len(cells) > columns and cells[-1] != "" for cells in rows]
    rows = [cells[m : columns + m] for cells, m in zip(rows, map(int, marked), strict=True)]
    while rows and any(map(_is_any_number, rows[0])) and not _are_channels(rows):
        rows.pop(0)  # a key and its value
    if len(rows) > 1 and _is_key_of_units(rows[0]) and not _all_units(rows[1]):
        names, own, used = _named(rows[1:], columns)
        keyed = ("", *(without_brackets(cell) for cell in rows[0][1:]))
        return names, tuple(a or b for a, b in zip(own, keyed, strict=True)), used
    return _named(rows, columns)


def _unmarked(cells: Sequence[str]) -> list[str]:
    """Without the mark of a comment, which hides the quotes of the cell behind it."""
    bare = cells[0].lstrip("#% ")
    quoted = bare != cells[0] and len(bare) > 1 and bare[0] == bare[-1] == '"'
    return [bare[1:-1] if quoted else bare, *cells[1:]]


def _named(rows: Sequence[list[str]], columns: int) -> Heading:
    named = next((k for k, cells in enumerate(rows) if not _all_units(cells)), None)
    if named is None:
        # A single row of what may all be units is a row of names: t, A, V.
        return (tuple(rows[-1]), ("",) * columns, 1) if len(rows) == 1 else ((), ("",) * columns, 0)
    split_up = [name_and_unit(cell) for cell in rows[named]]
    names, units = (tuple(each) for each in zip(*split_up, strict=True))
    for cells in rows[named + 1 :]:
        if _all_units(cells):
            below = (without_brackets(cell) for cell in cells)
            units = tuple(own or other for own, other in zip(units, below, strict=True))
        elif cells[0] and is_unit(cells[0]) and all(cells):
            # A unit of time, and the names of what was recorded in place of the other units.
            names = (names[0], *cells[1:])
            units = (units[0] or without_brackets(cells[0]), *units[1:])
    return names, units, len(rows) - named


def _all_units(cells: Sequence[str]) -> bool:
    return all(map(is_unit, cells))


def _is_key_of_units(cells: Sequence[str]) -> bool:
    """`Vertical Units,V,V`: a key, and the units of all columns but the first."""
    return "unit" in cells[0].lower() and _all_units(cells[1:])


def _are_channels(rows: Sequence[list[str]]) -> bool:
    """`x-axis,1,2` above `second,Volt,Volt`: channels by their number."""
    first, *others = rows[0]
    numbers = all(cell.isdigit() and int(cell) < 100 for cell in others)
    return numbers and not _is_any_number(first) and len(rows) > 1 and _all_units(rows[1])


def _pairs(rows: Sequence[list[str]], columns: int) -> Heading | None:
    """`Channel name,"Force",Channel name,"RMV"`: a column of times before each channel."""
    keyed = {
        cells[0].lower(): cells[1:columns:2]
        for cells in rows
        if columns >= 4
        and columns % 2 == 0
        and len(set(cells[0:columns:2])) == 1
        and not _is_any_number(cells[0])
    }
    called = next((cells for key, cells in keyed.items() if "name" in key), None)
    if called is None:
        return None
    units = next((cells for key, cells in keyed.items() if "unit" in key), [""] * len(called))
    usable = [without_brackets(cell) if is_unit(cell) else "" for cell in units]
    return (
        tuple(cell for name in called for cell in ("time", name)),
        tuple(cell for unit in usable for cell in ("", unit)),
        len(keyed),
    )


def _is_any_number(cell: str) -> bool:
    return is_number(cell, ".") or is_number(cell, ",")
