"""A draft as mapping text: known entries, and `# ?` for open ones.

Only units that the file states are active lines; others are comments that the user activates or
corrects.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from campaign import channels
from campaign.channels import UNITS, VOCABULARY, AxisKind
from campaign.importing.guess.columns import INDEX, TIME, Basis, ColumnGuess, TableGuess
from campaign.importing.guess.layouts import Layout, PlacedColumn, layouts, slug
from campaign.importing.guess.relations import ANGLES, RATES, TORQUES
from campaign.text import count
from campaign.unit_grammar import parse_unit

_HEAD = Path(__file__).with_name("mapping_head.toml").read_text(encoding="utf-8").rstrip()
_LACKING = {
    (*ANGLES, *RATES): "no column was taken for the motion, which `motion` needs: angle or rate",
    TORQUES: "no column was taken for what drives it, which `motion` needs: drive_torque or "
    "joint_torque; of a current it is made with `times`:",
}
"""Groups of roles: an experiment needs one of each group. Values: comment if it is missing."""


def mapping_text(tables: Sequence[TableGuess], base: Path | None = None) -> str:
    """A draft MAPPING.toml for guessed tables; `base` is the folder of it and of the files."""
    columns = [column for table in tables for column in table.columns]
    linear = any(_same(column.unit, each) for column in columns for each in _due(column)[1:])
    asked = "; some are in m: is the axis linear?" if linear else ""
    files = sorted({table.file.name for table in tables})
    title = _quoted(f"Recordings of {', '.join(files[:3])}" + " and others" * (len(files) > 3))
    lines = [_HEAD.format(kind="linear" if linear else "rotary", asked=asked, title=title)]
    drafts = layouts(tables)
    for axis in dict.fromkeys(layout.axis for layout in drafts):
        lines += ["", "[[test]]", f"name = {_quoted(slug(f'axis {axis}') if axis else 'recorded')}"]
        lines += ['kind = "motion"', _doubt("the rig: see above"), 'bench = "rig.toml"']
        for layout in (each for each in drafts if each.axis == axis):
            own = _recording(layout, base)
            # Files with the same format share one comment.
            lines += ["", *(x for x in own if x not in lines or not x.startswith("# read as"))]
    alike = Counter(layout.name for layout in drafts)
    for name, layout in {each.name: each for each in reversed(drafts)}.items():
        lines += ["", *_columns(layout, alike[name])]
    return "\n".join(lines) + "\n"


def _recording(layout: Layout, base: Path | None) -> Iterator[str]:
    files = [t.file if base is None else t.file.relative_to(base) for t in layout.tables]
    names = ", ".join(_quoted(file.as_posix()) for file in dict.fromkeys(files))
    yield "[[test.recording]]"
    yield f"file = [{names}]" if layout.joins_files else f"file = {names}"
    if len(layout.tables) == 1 and layout.tables[0].name:
        yield f"table = {_quoted(layout.tables[0].name)}"
    yield f"columns = {_quoted(layout.name)}"
    if starts := max(table.restarts for table in layout.tables):
        note = f"time begins anew {count(starts, 'time')}: a trial for each stretch"
        yield _doubt(f"restarts = true  # {note}")
    for table in layout.tables:
        of = f"{table.file.name if layout.joins_files else table.name}: ".lstrip(": ")
        rate = "" if table.step is None else f", {1 / table.step:.6g} samples per second"
        yield _comment(f"{of}read as {table.format}: {table.rows} rows were looked at{rate}")
        yield from (_doubt(f"{of}{doubt}") for doubt in table.doubts)


def _columns(layout: Layout, alike: int) -> Iterator[str]:
    """The `[columns.NAME]` of `alike` recordings; ranges are those of the first."""
    first = layout.tables[0]
    others = f" and of {alike - 1} more that are alike" if alike > 1 else ""
    yield _comment(f"Columns of {first.file.name} {first.name} {layout.axis}".rstrip() + others)
    if first.clock:
        yield _comment(f"Time: the file states a step of {first.step:.9g} s.")
    unsaid = [p.column.role for p in layout.columns if not p.column.sided]
    if unsaid:
        yield _doubt(f"side of the gear not said (4 above): {', '.join(dict.fromkeys(unsaid))}")
    taken: set[str] = set()
    for placed in layout.columns:
        role = placed.column.role
        if role != TIME or placed.table == 1:  # each table has it, under the same name
            yield ""
            yield from _block(layout, placed, role in taken)
            taken.add(role)
    yield from _lacking(layout, taken)
    if TIME not in taken and not first.clock:
        yield ""
        yield _doubt(f"[columns.{layout.name}.time]  # no column of times was found")
        yield _doubt('sample_rate = "... Hz"')


def _block(layout: Layout, placed: PlacedColumn, again: bool) -> Iterator[str]:
    """The lines of one column; comments if it is no channel, or `again` the same channel."""
    column = placed.column
    numeric = column.low == column.low  # not NaN
    seen = f"from {column.low:.6g} to {column.high:.6g}" if numeric else "without numbers"
    if not column.is_channel and column.role != TIME:
        what = "an index, no channel" if column.role == INDEX else "not known what it is"
        why = f" ({column.why})" if column.why else ""
        yield _comment(f"column {_quoted(column.name)}: {what}{why}; {column.place}, {seen}")
        if column.role != INDEX and numeric:
            yield from (f"# {line}" for line in _which(layout, placed, "CHANNEL"))
            yield f"# unit = {_quoted(column.unit or '...')}"
        return
    yield _comment(f"{column.place}, {seen}; taken for {column.role}: {column.why}")
    if again:
        # The first of two columns with the same role keeps it.
        yield _doubt(f"{column.role} as well: {column.name}; is it this one?")
    for line in (*_which(layout, placed, column.role), *_unit(column)):
        yield f"# {line}" if again and not line.startswith("#") else line
    yield from map(_doubt, column.doubts)


def _which(layout: Layout, placed: PlacedColumn, role: str) -> Iterator[str]:
    """The first lines of a block; a column with an ambiguous name is given by its place."""
    name = placed.column.name
    twice = sum((p.table, p.column.name) == (placed.table, name) for p in layout.columns) > 1
    yield f"[columns.{layout.name}.{role}]"
    yield f"column = {placed.place if twice else _quoted(name)}"
    if len(layout.tables) > 1 and role != TIME:  # the time is that of each
        table = _quoted(layout.tables[placed.table - 1].name)
        yield f"file = {placed.table}" if layout.joins_files else f"table = {table}"


def _unit(column: ColumnGuess) -> Iterator[str]:
    """The line of the unit, and a `times` to complete if the unit has another dimension."""
    unit, due = f"unit = {_quoted(column.unit or '...')}", _due(column)
    if column.basis is Basis.STATED:
        yield unit
    else:
        why = column.unit_why or f"such as {' or '.join(due) or 's'}"
        yield _doubt(f"{unit}  # {column.basis}: {why}")
    if column.unit and due and not any(_same(column.unit, each) for each in due):
        kinds = "  # or ".join(f'"... {each}/{column.unit}"' for each in due)
        yield _doubt(f'times = {kinds}  # of the rig, such as "0.3 N m/A", "1/4096 rev/count"')


def _due(column: ColumnGuess) -> list[str]:
    """Units of a channel on a rotary and on a linear axis; none if it is no channel."""
    if column.role not in VOCABULARY:
        return []
    quantity = VOCABULARY[column.role].quantity
    units = [UNITS[kind][quantity][0] for kind in (AxisKind.ROTARY, AxisKind.LINEAR)]
    return list(filter(None, dict.fromkeys(units)))


def _same(one: str, other: str) -> bool:
    return bool(one) and parse_unit(one).dimensions == parse_unit(other).dimensions


def _lacking(layout: Layout, taken: set[str]) -> Iterator[str]:
    """Lines for channels that `motion` needs and no column provides; torque from a current."""
    for roles, note in _LACKING.items():
        if taken.isdisjoint(roles):
            yield ""
            yield _doubt(note)
    current = next((p for p in layout.columns if p.column.role == channels.MOTOR_CURRENT), None)
    if current is not None and taken.isdisjoint(TORQUES):
        unit = current.column.unit
        yield from map(_doubt, _which(layout, current, channels.DRIVE_TORQUE))
        yield _doubt(f"unit = {_quoted(unit or '...')}")
        times = f'"... N m/{unit or "A"}"  # or "... N/{unit or "A"}"'
        yield _doubt(f"times = {times}  # at the load: torque constant times gear")


def _quoted(text: str) -> str:
    """A TOML string: a JSON string, except for DEL and surrogates."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")


def _comment(text: str) -> str:
    """A comment line without unprintable characters."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return "# " + "".join(c if c.isprintable() else "?" for c in whole)


def _doubt(text: str) -> str:
    return _comment(f"? {text}")
