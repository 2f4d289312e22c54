"""A guess as the text of a mapping: what is known stands, what is not stands behind `# ?`.

A unit is only written plainly where the file states it; any other is a comment that its reader
turns into a line, or corrects.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from campaign.channels import (
    DRIVE_TORQUE,
    JOINT_TORQUE,
    MOTOR_CURRENT,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    UNITS,
    VOCABULARY,
    AxisKind,
    Quantity,
)
from campaign.importing.defects.defect import counted
from campaign.importing.guess.columns import Basis, ColumnGuess, Guess
from campaign.importing.guess.evidence import stated_rate
from campaign.importing.guess.layouts import LayoutGuess, Placed, layouts
from campaign.importing.guess.quantities import INDEX, TIME, UNKNOWN
from campaign.unit_grammar import parse_unit

_WHAT = {
    Basis.STATED: "",
    Basis.LIKELY: "likely",
    Basis.UNKNOWN: "not stated",
}


_HEAD = """\
# A first mapping, made by looking at the files. Nothing in it is known that they do not state.
# What is left to be done by hand:
# 1. Save this beside the files, and a rig.toml with it. Name and axis are enough:
#        schema = 3
#        name = "..."
#        [axis]
#        name = "..."
#        kind = "{kind}"  # rotary: rad and N m; linear: m and N
# 2. Lines that begin with `# ?` are to be checked. Those of the form `key = ...`: put right what is
#    not, and remove the `# ?`. The others are remarks: think of them, and strike them out. Every
#    channel needs a unit (and `times`, where that is asked); one that is not wanted is struck out
#    with its whole block.
# 3. Columns that were taken for nothing have a block in comments: if one is a channel, write which
#    for CHANNEL (`campaign kinds channels` lists them), its unit, and remove the `#` of its lines.
# 4. `campaign plan mapping.toml --backend import` says what is still wrong, by line;
#    `campaign import mapping.toml --report` makes run and report of it.
# Never guessed: signs, the side of a gear, torque constants, rated torques, offsets,
# filters of the drive."""


def mapping_text(guess: Guess, base: Path | None = None) -> str:
    """A first MAPPING.toml for what was guessed; `base` is the folder it will lie in."""
    linear = any(_is_length(column) for table in guess.tables for column in table.columns)
    lines = [
        *_HEAD.format(kind="linear" if linear else "rotary").splitlines(),
        "schema = 2",
        f"title = {_quoted(_title(guess))}",
    ]
    found = layouts(guess.tables)
    for axis in dict.fromkeys(layout.axis for layout in found):
        lines += ["", *_test(axis)]
        if linear:
            lines.append(
                _doubt('lengths or speeds in m: is the axis linear? [axis] kind = "linear"')
            )
        for layout in found:
            if layout.axis == axis:
                lines += ["", *_recording(layout, base)]
    for layout in found:
        if not layout.known:
            lines += ["", *_columns(layout)]
    return "\n".join(lines) + "\n"


def _test(axis: str) -> Iterator[str]:
    """The test of an axis; each of several has a rig of its own, or they are one."""
    yield "[[test]]"
    yield f"name = {_quoted(_name(axis))}"
    if axis:
        yield f"title = {_quoted(f'Axis {axis}')}"
    yield 'kind = "motion"'
    yield _doubt("the rig: a file with at least its name and that of its axis (see above)")
    yield 'bench = "rig.toml"'


def _name(axis: str) -> str:
    bare = re.sub(r"[^a-z0-9]+", "_", axis.lower()).strip("_")
    return f"axis_{bare}" if bare else "recorded"


def _title(guess: Guess) -> str:
    files = sorted({table.file.name for table in guess.tables})
    return f"Recordings of {', '.join(files[:3])}" + (" and others" if len(files) > 3 else "")


def _recording(layout: LayoutGuess, base: Path | None) -> Iterator[str]:
    files = [_quoted(_from(base, file).as_posix()) for file in layout.paths]
    yield "[[test.recording]]"
    yield f"file = {files[0]}" if len(files) == 1 else f"file = [{', '.join(files)}]"
    if not layout.several and layout.tables[0].name:
        yield f"table = {_quoted(layout.tables[0].name)}"
    yield f"columns = {_quoted(layout.name)}"
    if anew := max(table.restarts for table in layout.tables):
        told = f"time begins anew {counted(anew, 'time')}: a trial for each stretch"
        yield _doubt(f"restarts = true  # {told}")
    for table in layout.tables:
        of = f"{table.name or table.file.name}: " if layout.several else ""
        rows = f"{'more than ' if table.more else ''}{table.rows} rows"
        rate = "" if table.step is None else f", {1 / table.step:.6g} samples per second"
        yield _comment(f"{of}read as {table.format}: {rows}{rate}")
        for doubt in table.doubts:
            yield _doubt(f"{of}{doubt}")
    for key, value in list(layout.tables[0].said.items())[:5]:
        yield _comment(f"it says {key}: {value}"[:100])


def _from(base: Path | None, file: Path) -> Path:
    """A file as a mapping in the folder `base` names it."""
    if base is not None and file.is_absolute() and file.is_relative_to(base.absolute()):
        return file.relative_to(base.absolute())
    return file


def _columns(layout: LayoutGuess) -> Iterator[str]:
    first = layout.tables[0]
    more = f" and {layout.files - 1} more with the same columns" if layout.files > 1 else ""
    table = f", {first.name}" if first.name and not layout.several else ""
    axis = f", axis {layout.axis}" if layout.axis else ""
    names = ", ".join(file.name for file in layout.paths)
    yield _comment(f"Columns of {names}{table}{axis}{more}")
    if first.clock:
        yield _comment(f"Time: the file states a step of {first.step:.9g} s.")
    called = Counter((p.file, p.table, p.column.name) for p in layout.columns)
    taken: set[str] = set()
    for placed in _in_order(layout.columns):
        column = placed.column
        if column.role == TIME and TIME in taken and layout.several:
            continue  # each table has it, under the same name
        yield ""
        if column.role in (UNKNOWN, INDEX):
            what = "an index, no channel" if column.role == INDEX else "not known what it is"
            why = f" ({column.why})" if column.why else ""
            yield _comment(f"column {_quoted(column.name)}: {what}{why}; {_seen(column)}")
            if column.role == UNKNOWN and column.low == column.low:
                twice = called[placed.file, placed.table, column.name] > 1
                unit = column.unit or "..."
                for line in _block(layout, placed, "CHANNEL", twice):
                    yield f"# {line}"
                yield f"# unit = {_quoted(unit)}"
            continue
        yield _comment(f"{_seen(column)}; taken for {column.role}: {column.why}")
        again = column.role in taken
        if again:
            # Of two columns one role is left to the first.
            yield _doubt(f"{column.role} as well: {column.name}; is it this one?")
        taken.add(column.role)
        twice = called[placed.file, placed.table, column.name] > 1
        for line in _section(layout, placed, twice):
            yield f"# {line}" if again and not line.startswith("#") else line
    yield from _lacking(layout, taken)
    if TIME not in taken and not first.clock:
        yield ""
        yield _doubt(f"[columns.{layout.name}.time]  # no column of times was found")
        rate = stated_rate(first.said)
        told = "..." if rate is None else f"{rate[1]:g}"
        why = "" if rate is None else f"  # the file says {rate[0]}"
        yield _doubt(f'sample_rate = "{told} Hz"{why}')


def _lacking(layout: LayoutGuess, taken: set[str]) -> Iterator[str]:
    """What `motion` needs and no column was taken for; of a current it can be made."""
    if taken.isdisjoint((RELATIVE_RATE, RELATIVE_ANGLE)):
        yield ""
        yield _doubt("no column was taken for the motion, which `motion` needs: relative_rate, or")
        yield _doubt("relative_angle, of which it is made; for what the motor does the rig needs")
        yield _doubt("a gear ([gear] ratio = ..., side of the motor over that of the load)")
    if not taken.isdisjoint((DRIVE_TORQUE, JOINT_TORQUE)):
        return
    yield ""
    yield _doubt("no column was taken for what drives it, which `motion` needs: drive_torque or")
    current = next((p for p in layout.columns if p.column.role == MOTOR_CURRENT), None)
    if current is None:
        yield _doubt("joint_torque; of a current or of percent it is made with `times`")
        return
    yield _doubt("joint_torque; if the current makes it, complete this:")
    twice = sum(each.column.name == current.column.name for each in layout.columns) > 1
    for line in _block(layout, current, DRIVE_TORQUE, twice):
        yield _doubt(line)
    yield _doubt(f"unit = {_quoted(current.column.unit or '...')}")
    unit = current.column.unit or "A"
    times = f'times = "... N m/{unit}" or "... N/{unit}"'
    yield _doubt(f"{times}  # at the load: torque constant times gear")


def _in_order(columns: Sequence[Placed]) -> list[Placed]:
    """Of two columns of one role the raw or the filtered one comes last: a role is the first's."""
    return sorted(columns, key=lambda placed: placed.column.spare)


def _block(layout: LayoutGuess, placed: Placed, role: str, twice: bool) -> Iterator[str]:
    """What every block begins with; `twice`: its name is that of another column, too."""
    yield f"[columns.{layout.name}.{role}]"
    yield f"column = {placed.place if twice else _quoted(placed.column.name)}"
    if layout.several and role != TIME:
        joined = len(layout.paths) > 1
        yield f"file = {placed.file}" if joined else f"table = {_quoted(placed.table)}"


def _section(layout: LayoutGuess, placed: Placed, twice: bool) -> Iterator[str]:
    """The lines of one channel."""
    column = placed.column
    yield from _block(layout, placed, column.role, twice)
    unit = f"unit = {_quoted(column.unit)}" if column.unit else 'unit = "..."'
    if column.basis is Basis.STATED:
        yield unit
    else:
        why = f": {column.unit_why}" if column.unit_why else ""
        choice = "" if column.unit else _choice(column.role)
        yield _doubt(f"{unit}  # {_WHAT[column.basis]}{why}{choice}")
    if factor := _factor(column):
        yield _doubt(factor)
    for doubt in column.doubts:
        yield _doubt(doubt)


_USUAL = {
    Quantity.ANGLE: "rad, deg, rev, m, mm, count",
    Quantity.RATE: "rad/s, deg/s, rpm, m/s, mm/s, count/s",
    Quantity.TORQUE: "N m, mN m, N; V, A or percent with times",
    Quantity.FORCE: "N, kN",
    Quantity.CURRENT: "A, mA",
    Quantity.TEMPERATURE: "degC",
}
"""What a channel's column is usually in."""


def _choice(role: str) -> str:
    """Units to choose from, for a comment."""
    if role == TIME:
        return ": s, ms, us, ns?"
    usual = _USUAL.get(VOCABULARY[role].quantity, "") if role in VOCABULARY else ""
    return f": {usual}?" if usual else ""


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
