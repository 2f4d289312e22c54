"""Names that mean something else beside others: `x`, `y`, `z`, letters of an inertial unit."""

from __future__ import annotations

from dataclasses import replace

from campaign.channels import GYRO_RATE, RELATIVE_ANGLE
from campaign.importing.guess.columns import ColumnGuess
from campaign.importing.guess.pieces import pieces
from campaign.importing.guess.quantities import UNKNOWN

_PLACE = ("x", "y", "z")
_TURNING = (("gx", "gy", "gz"), ("wx", "wy", "wz"))
_FALLING = ("ax", "ay", "az")


def beside(columns: list[ColumnGuess]) -> list[ColumnGuess]:
    """The columns, with what only shows when they are seen together."""
    columns = list(columns)
    bare = [_bare(each.name) for each in columns]
    if set(_PLACE) <= set(bare):
        for place, each in enumerate(columns):
            if bare[place] in _PLACE and each.role in (RELATIVE_ANGLE, UNKNOWN):
                columns[place] = replace(each, role=UNKNOWN, why="a place in space")
    for letters in _TURNING:
        if {*letters, *_FALLING} <= set(bare):
            for place, each in enumerate(columns):
                if bare[place] in letters and each.role == UNKNOWN:
                    columns[place] = replace(
                        each, role=GYRO_RATE, why="beside accelerations, a rate in space"
                    )
    return columns


def _bare(name: str) -> str:
    """The last part of a name, without its unit, in one word."""
    found = pieces(name)
    return "".join(found.parts[-1]) if found.parts else ""
