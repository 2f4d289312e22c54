"""A guess as the text of a mapping: what is known stands, what is not stands behind `# ?`.

A unit is only written plainly where the file states it; any other is a comment that its reader
turns into a line, or corrects.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from campaign.channels import UNITS, VOCABULARY, AxisKind
from campaign.importing.guess.guessing import Basis, ColumnGuess, Guess
from campaign.importing.guess.layouts import LayoutGuess, Placed, layouts
from campaign.importing.guess.names import INDEX, TIME, UNKNOWN
from campaign.unit_grammar import parse_unit

_WHAT = {
    Basis.STATED: "",
    Basis.LIKELY: "likely",
    Basis.UNKNOWN: "not stated",
}


def mapping_text(guess: Guess, base: Path | None = None) -> str:
    """A first MAPPING.toml for what was guessed; `base` is the folder it will lie in."""
    lines = [
        "# A first mapping, made by looking at the files. Nothing in it is known that they do not",
        "# state: lines that begin with `# ?` are to be checked, and written or struck out.",
        "# Never guessed: signs, the side of a gear, torque constants, rated torques, offsets,",
        "# filters of the drive.",
        "schema = 2",
        f"title = {_quoted(_title(guess))}",
        "",
        "[[test]]",
        'name = "recorded"',
        'kind = "motion"',
        "# ? the rig: a file with at least its name and that of its axis",
        'bench = "rig.toml"',
    ]
    if any(_is_length(column) for table in guess.tables for column in table.columns):
        lines.append(_doubt('lengths or speeds in m: is the axis linear? [axis] kind = "linear"'))
    found = layouts(guess.tables)
    for layout in found:
        lines += ["", *_recording(layout, base)]
    for layout in found:
        lines += ["", *_columns(layout)]
    return "\n".join(lines) + "\n"


def _title(guess: Guess) -> str:
    files = sorted({table.file.name for table in guess.tables})
    return f"Recordings of {', '.join(files[:3])}" + (" and others" if len(files) > 3 else "")


def _recording(layout: LayoutGuess, base: Path | None) -> Iterator[str]:
    file = layout.tables[0].file
    if base is not None and file.is_absolute() and file.is_relative_to(base.absolute()):
        file = file.relative_to(base.absolute())
    yield "[[test.recording]]"
    yield f"file = {_quoted(file.as_posix())}"
    if not layout.several and layout.tables[0].name:
        yield f"table = {_quoted(layout.tables[0].name)}"
    yield f"columns = {_quoted(layout.name)}"
    for table in layout.tables:
        of = f"{table.name}: " if layout.several else ""
        rows = f"{'more than ' if table.more else ''}{table.rows} rows"
        rate = "" if table.step is None else f", {1 / table.step:.6g} samples per second"
        yield _comment(f"{of}read as {table.format}: {rows}{rate}")
        for doubt in table.doubts:
            yield _doubt(f"{of}{doubt}")
    for key, value in list(layout.tables[0].said.items())[:5]:
        yield _comment(f"it says {key}: {value}"[:100])


def _columns(layout: LayoutGuess) -> Iterator[str]:
    first = layout.tables[0]
    yield _comment(f"Columns of {first.file.name}{f', {first.name}' if first.name else ''}")
    if first.clock:
        yield _comment(f"Time: the file states a step of {first.step:.9g} s.")
    called = Counter((placed.table, placed.column.name) for placed in layout.columns)
    taken: set[str] = set()
    for placed in layout.columns:
        column = placed.column
        if column.role == TIME and TIME in taken and layout.several:
            continue  # each table has it, under the same name
        yield ""
        if column.role in (UNKNOWN, INDEX):
            what = "an index, no channel" if column.role == INDEX else "not known what it is"
            why = f" ({column.why})" if column.why else ""
            yield _comment(f"column {_quoted(column.name)}: {what}{why}; {_seen(column)}")
            continue
        yield _comment(f"{_seen(column)}; taken for {column.role}: {column.why}")
        again = column.role in taken
        if again:
            # Of two columns one role is left to the first.
            yield _doubt(f"{column.role} as well: {column.name}; is it this one?")
        taken.add(column.role)
        twice = called[placed.table, column.name] > 1
        for line in _section(layout, placed, twice):
            yield f"# {line}" if again and not line.startswith("#") else line
    if TIME not in taken and not first.clock:
        yield ""
        yield _doubt(f"[columns.{layout.name}.time]  # no column of times was found")
        yield _doubt('sample_rate = "... Hz"')


def _section(layout: LayoutGuess, placed: Placed, twice: bool) -> Iterator[str]:
    """The lines of one channel; `twice`: its name is that of another column, too."""
    column = placed.column
    yield f"[columns.{layout.name}.{column.role}]"
    yield f"column = {placed.place if twice else _quoted(column.name)}"
    if layout.several and column.role != TIME:
        yield f"table = {_quoted(placed.table)}"
    unit = f"unit = {_quoted(column.unit)}" if column.unit else 'unit = "..."'
    if column.basis is Basis.STATED:
        yield unit
    else:
        why = f": {column.unit_why}" if column.unit_why else ""
        yield _doubt(f"{unit}  # {_WHAT[column.basis]}{why}")
    if factor := _factor(column):
        yield _doubt(factor)
    for doubt in column.doubts:
        yield _doubt(doubt)


def _is_length(column: ColumnGuess) -> bool:
    """Whether a unit says that the channel moves along a line."""
    if column.role not in VOCABULARY or not column.unit:
        return False
    quantity = VOCABULARY[column.role].quantity
    rotary, linear = (UNITS[kind][quantity][0] for kind in (AxisKind.ROTARY, AxisKind.LINEAR))
    own = parse_unit(column.unit).dimensions
    return own == parse_unit(linear).dimensions != parse_unit(rotary).dimensions


def _factor(column: ColumnGuess) -> str:
    """The line that is missing where a file's unit measures something else than the channel."""
    if column.role not in VOCABULARY or not column.unit:
        return ""
    quantity = VOCABULARY[column.role].quantity
    units = [UNITS[kind][quantity][0] for kind in AxisKind]
    own = parse_unit(column.unit)
    if "" in units or any(parse_unit(unit).dimensions == own.dimensions for unit in units):
        return ""
    kinds = " or ".join(f'"... {unit}/{column.unit}"' for unit in dict.fromkeys(units))
    return f"times = {kinds}  # nobody knows it but you"


def _seen(column: ColumnGuess) -> str:
    if column.low != column.low:  # NaN
        return f"{column.place}, without numbers"
    return f"{column.place}, from {column.low:.6g} to {column.high:.6g}"


def _quoted(text: str) -> str:
    """As a string of TOML; JSON's is one, but for DEL and for halves of characters."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")


def _plain(text: str) -> str:
    """Without what may not stand in a comment."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c.isprintable() else "?" for c in whole)


def _comment(text: str) -> str:
    return f"# {_plain(text)}"


def _doubt(text: str) -> str:
    return f"# ? {_plain(text)}"
