"""How long `campaign report`, or `identify`, takes beside another checkout's, for the same run.

    python -m benchmarks.report_time RUN.nxs OTHER [--identify] [--python PYTHON] [--repeats 5]

RUN must be one that both can read; OTHER is a folder with another checkout of campaign, and PYTHON
an interpreter that has what it needs (this one where none is named). Each works on a copy of its
own, in turn, so that a machine that becomes slower does so for both; the first run of each is not
counted. The ratio is taken pair by pair. Whole commands are timed, from start to end.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.document import machine, table

HERE = Path(__file__).parents[1]


@dataclass
class Checkout:
    """One of the two, and how many seconds each of its reports, or identifications, took."""

    name: str
    source: Path
    python: str
    run: Path
    command: str = "report"
    seconds: list[float] = field(default_factory=list)

    def make(self) -> None:
        """Make the page, and take the time of it."""
        output = "--output" if self.command == "report" else "--page"
        command = [self.python, "-m", "campaign", self.command, str(self.run)]
        command += [output, str(self.run.parent / "page")]
        began = time.perf_counter()
        # Begun in its folder, as what lies there is imported before what is installed.
        subprocess.run(
            command,
            cwd=self.source,
            env={**os.environ, "PYTHONPATH": str(self.source)},
            stdout=subprocess.DEVNULL,
            check=True,
        )
        self.seconds.append(time.perf_counter() - began)


def copied(run: Path, folder: Path) -> Path:
    """A copy of the run, as results are written beside it."""
    folder.mkdir()
    return Path(shutil.copy2(run, folder))


def rows(pair: tuple[Checkout, Checkout]) -> list[list[str]]:
    """Median, fastest and slowest of each (s), and of the ratios of this one's to the other's."""
    times = [(each.name, each.seconds) for each in pair]
    ratios = [own / other for own, other in zip(*(each.seconds for each in pair), strict=True)]
    return [
        [name, *(f"{value:.3g}" for value in (statistics.median(found), min(found), max(found)))]
        for name, found in (*times, ("ratio", ratios))
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("other", type=Path)
    parser.add_argument("--identify", action="store_true", help="and not a report")
    parser.add_argument("--python", default=sys.executable, help="of the other checkout")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run, other = arguments.run.resolve(), arguments.other.resolve()
        command = "identify" if arguments.identify else "report"
        pair = (
            Checkout("this", HERE, sys.executable, copied(run, Path(folder, "this")), command),
            Checkout("other", other, arguments.python, copied(run, Path(folder, "other")), command),
        )
        for turn in range(arguments.repeats + 1):
            for each in pair:
                each.make()
                if turn == 0:
                    each.seconds.clear()
    print(f"{machine()}, {os.cpu_count()} cores. `campaign {command}` of {run.name}.\n")
    print(table(["", "median", "fastest", "slowest"], rows(pair)))


if __name__ == "__main__":
    main()
