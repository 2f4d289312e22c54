"""`python tests/rooms.py ROOM`: folders of tests of a room and of the rooms that import it.

Those that import it through others only are left out: nearly everything imports physics so.
"""

from __future__ import annotations

import sys
from pathlib import Path

import grimp

TESTS = Path(__file__).parent


def rooms_of(room: str) -> list[str]:
    """A room, and those of `campaign` that import it directly."""
    graph = grimp.build_graph("campaign")
    name = f"campaign.{room}"
    own = {name, *graph.find_descendants(name)} if name in graph.modules else set()
    importing = {m for each in own for m in graph.find_modules_that_directly_import(each)}
    return [room, *sorted({m.split(".")[1] for m in importing if "." in m} - {room})]


def main(room: str) -> int:
    """Print the folders, or which rooms there are; the exit code."""
    if not (TESTS / room).is_dir():
        there = sorted(path.name for path in TESTS.iterdir() if path.is_dir())
        sys.stderr.write(f"no tests of {room!r}; rooms are {', '.join(there)}\n")
        return 2
    found = [f"tests/{each}" for each in rooms_of(room) if (TESTS / each).is_dir()]
    sys.stdout.write(" ".join(found) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
