"""Columns as people called them, with what each is: listed, and written as a file of such columns.

Names come from public code that writes or reads recordings of drives, robots and tribometers, and
from the exports of well-known programs. A list says, source by source, how its table is separated;
then each heading, its role (several, apart by `|`, where people would not agree) and its unit (`-`
where nobody could tell it from the file); last what stands in a second line of headings, if any.
What is in the columns is the motion of `rig`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaign.unit_grammar import parse_unit
from tests.importing import rig
from tests.importing.wild import text

HERE = Path(__file__).parent
SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";", "blank": " "}


@dataclass(frozen=True)
class Listed:
    """A column: what stands above it, which roles it may be given, in what it is."""

    heading: str
    roles: tuple[str, ...]
    unit: str
    second: str = ""


@dataclass(frozen=True)
class Source:
    """Columns of one file."""

    label: str
    separator: str
    decimal: str
    columns: tuple[Listed, ...]

    def write(self, path: Path, seed: int) -> None:
        """A file with such columns; those of one role differ in size."""
        motion = rig.sines(seed, rate=250.0)
        used: dict[str, int] = {}
        columns = []
        for k, each in enumerate(self.columns):
            role = each.roles[0]
            used[role] = used.get(role, 0) + 1
            values = _values(role, motion, np.random.default_rng(100 * seed + k))
            size = 1.0 if role in ("time", "index") else 0.8 ** (used[role] - 1)
            columns.append(size * values / _worth(each.unit))
        head = self.separator.join(each.heading for each in self.columns) + "\n"
        if any(each.second for each in self.columns):
            head += self.separator.join(each.second for each in self.columns) + "\n"
        text(np.column_stack(columns).tolist(), head, self.separator, self.decimal)(path)


def _worth(unit: str) -> float:
    """SI units of one; of what nobody can tell, and of what no factor leads from, some number."""
    if unit in ("-", "count", "%", "degC"):
        return {"-": 0.37, "count": 1e-3, "%": 0.4, "degC": 1.0}[unit]
    return float(parse_unit(unit).factor)


def _values(role: str, m: rig.Motion, chance: np.random.Generator) -> np.ndarray:
    steady = np.zeros_like(m.t)
    return {
        "time": m.t, "index": np.arange(len(m.t)) + 0.0,
        "unknown": chance.normal(3.0, 1.0, len(m.t)), "relative_angle": m.q,
        "motor_angle": 50 * m.q, "relative_rate": m.v, "gyro_rate": m.v, "base_rate": 0.1 * m.v,
        "motor_rate": 50 * m.v, "reference": m.target, "command": m.v + 0.01, "motor_current": m.i,
        "drive_torque": m.tau, "joint_torque": 0.9 * m.tau,
        "normal_load": steady + 20 + chance.normal(0, 0.05, len(m.t)), "temperature": 25 + m.t / 10,
        "pointing_error": 1e-3 * m.q,
    }[role]  # fmt: skip


def listed(name: str) -> list[Source]:
    """The sources of `names_NAME.txt`."""
    found: list[Source] = []
    for line in (HERE / f"names_{name}.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            label, how = line[3:].split(" | ")
            separator, *rest = how.split()
            found.append(Source(label, SEPARATORS[separator], "," if rest else ".", ()))
            continue
        heading, roles, unit, *second = line.split("\t")
        column = Listed(heading, tuple(roles.split("|")), unit, *second)
        last = found.pop()
        found.append(Source(last.label, last.separator, last.decimal, (*last.columns, column)))
    return found
