"""`python -m tests.coverage run FILE`, then `python -m tests.coverage show FILE...`.

`run` executes tests and adds a JSON line for each estimate that has a truth; `show` prints
the tables of `docs/trust.md` by direction, and draws its picture.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from pathlib import Path

from tests.coverage.benches import BENCHES, make_case
from tests.coverage.judging import Entry, as_tree, entries
from tests.coverage.laboratory import KINDS, run
from tests.coverage.page import draw_picture, tables


def main() -> None:
    """Parse and do."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    running = commands.add_parser("run")
    running.add_argument("file", type=Path)
    running.add_argument("--kind", action="append", choices=KINDS)
    running.add_argument("--benches", type=int, nargs=2, default=(0, BENCHES))
    running.add_argument("--draws", type=int, nargs=2, default=(0, 1))
    showing = commands.add_parser("show")
    showing.add_argument("files", type=Path, nargs="+")
    given = parser.parse_args()
    if given.command == "show":
        found = read(given.files)
        sys.stdout.write(tables(found))
        draw_picture(found)
        return
    with given.file.open("a", encoding="utf-8") as out:
        for number in range(*given.benches):
            for kind in given.kind or KINDS:
                for draw in range(*given.draws):
                    _one(number, kind, draw, out)


def _one(number: int, kind: str, draw: int, out) -> None:  # type: ignore[no-untyped-def]
    began = time.monotonic()
    case = make_case(number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = entries(run(case, kind, draw), draw)
    for entry in found:
        out.write(json.dumps(as_tree(entry)) + "\n")
    out.flush()
    taken = time.monotonic() - began
    sys.stderr.write(f"{case.name} {kind} {draw}: {len(found)} estimates, {taken:.1f} s\n")


def read(files: list[Path]) -> list[Entry]:
    """The estimates in files that `run` wrote; of the same one the last counts."""
    found = {}
    for file in files:
        for line in file.read_text(encoding="utf-8").splitlines():
            entry = Entry(**json.loads(line))
            found[entry.bench, entry.draw, entry.kind, entry.parameter] = entry
    return list(found.values())


if __name__ == "__main__":
    main()
