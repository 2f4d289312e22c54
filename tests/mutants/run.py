"""Put one small bug after another into the files of attacked.toml: do their tests notice?

Each worker has a copy of the project of its own, so that nobody's files are touched and child
processes are attacked as well. Exit code 1 when more than 5 % survive of those that are not named
in equivalents.toml, or when that names what there is not.
"""

from __future__ import annotations

import argparse
import os
import queue
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.mutants.mutations import Mutant, drawn, mutants

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
MAY_SURVIVE = 0.05
PATIENCE = 1800.0
"""s for the tests of a room with a bug that was drawn."""
SEED = 30
"""Of the bugs drawn by `--draw`."""
SAID = "said-by-pytest.txt"
MEMORY = 6 * 2**30
"""bytes; a bug may ask for any amount."""
LEFT_OUT = shutil.ignore_patterns(".*", "build", "dist", "__pycache__", "*.egg-info")
PYTEST = ("-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed=0", "--tb=no")


@dataclass
class Copy:
    """A copy of the project in which one test run at a time goes on."""

    root: Path
    patience: dict[tuple[str, ...], float] = field(default_factory=dict)

    def tests_pass(self, tests: tuple[str, ...], patience: float | None) -> bool:
        """Whether they all do, in time. Whatever they have started is gone afterwards."""
        new = {"PYTHONPATH": str(self.root)}
        if patience is not None:
            new["PYTHONDONTWRITEBYTECODE"] = "1"  # a mutant's would be taken for the next one's
        run = subprocess.Popen(
            [sys.executable, "-m", "pytest", *PYTEST, *tests],
            cwd=self.root,
            env=os.environ | new,
            stdin=subprocess.DEVNULL,
            stdout=(self.root / SAID).open("wb"),
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            return run.wait(patience) == 0
        except subprocess.TimeoutExpired:
            return False
        finally:
            self._end_all()
            run.wait()

    def _end_all(self) -> None:
        """End every process that works in this copy, also one with a session of its own."""
        for process in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                if (process / "cwd").readlink().is_relative_to(self.root):
                    os.kill(int(process.name), signal.SIGKILL)

    def baseline(self, tests: tuple[str, ...]) -> None:
        """The tests pass without a bug; how long they took says how long to wait for a mutant."""
        self.tests_pass(tests, None)  # compiles what is compiled only once
        begun = time.monotonic()
        if not self.tests_pass(tests, None):
            said = (self.root / SAID).read_text(encoding="utf-8", errors="replace")
            raise SystemExit(f"without any bug these fail: {' '.join(tests)}\n{said}")
        self.patience[tests] = 10.0 + 5.0 * (time.monotonic() - begun)

    def noticed(self, mutant: Mutant, tests: tuple[str, ...]) -> str:
        """Which test fails with this bug in place, as pytest names it; nothing: it survives."""
        if tests not in self.patience:
            self.baseline(tests)
        file = self.root / mutant.file
        for stale in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
            stale.unlink()
        before = file.read_bytes()
        file.write_text(mutant.source, encoding="utf-8")
        try:
            return "" if self.tests_pass(tests, self.patience[tests]) else self._failed()
        finally:
            file.write_bytes(before)

    def _failed(self) -> str:
        said = (self.root / SAID).read_text(encoding="utf-8", errors="replace").splitlines()
        return next((line for line in said if line.startswith(("FAILED", "ERROR"))), "no answer")


def main() -> int:
    """Attack, and say what survived."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", help="only these of attacked.toml")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--draw", type=int, metavar="N", help="N bugs, from all rooms in turn")
    arguments = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    table = tomllib.loads((HERE / "attacked.toml").read_text(encoding="utf-8"))
    elsewhere = table.pop("rooms")
    if arguments.draw:
        return _attack_drawn(arguments.draw, elsewhere, arguments.workers)
    attacked = {file: tuple(table[file]) for file in arguments.files or table}
    listed = {
        (one["file"], one["function"], one["was"], one["now"])
        for one in tomllib.loads((HERE / "equivalents.toml").read_text(encoding="utf-8"))["mutant"]
        if one["file"] in attacked
    }
    every = [m for f in attacked for m in mutants(f, (ROOT / f).read_text(encoding="utf-8"))]
    todo = [mutant for mutant in every if mutant.key not in listed]
    noticed = _attack(todo, attacked, arguments.workers, {})
    survivors = [mutant for mutant, test in noticed.items() if not test]
    _tell(every, survivors, listed)
    gone = listed - {mutant.key for mutant in every}
    for key in sorted(gone):
        print("equivalents.toml names what there is not:", *key, sep="\n    ")
    share = len(survivors) / max(1, len(todo))
    print(f"{len(survivors)} of {len(todo)} survive ({share:.1%}); {MAY_SURVIVE:.0%} may")
    return int(share > MAY_SURVIVE or bool(gone))


def _attack_drawn(count: int, elsewhere: dict[str, list[str]], workers: int) -> int:
    """Attack every room in turn, each bug in any of its files; its tests are those of the room."""
    chosen = Random(SEED)
    rooms: dict[str, list[Path]] = {}
    for path in sorted((ROOT / "campaign").rglob("*.py")):
        if len(parts := path.relative_to(ROOT / "campaign").parts) > 1:
            rooms.setdefault(parts[0], []).append(path)
    todo, attacked = [], {}
    while len(todo) < count:
        room = sorted(rooms)[len(todo) % len(rooms)]
        path = chosen.choice(rooms[room])
        file = path.relative_to(ROOT).as_posix()
        if bug := drawn(file, path.read_text(encoding="utf-8"), chosen):
            todo.append(bug)
            attacked[file] = tuple(elsewhere.get(room, [f"tests/{room}"]))
    # `make test` says that all rooms pass without a bug.
    noticed = _attack(todo, attacked, workers, dict.fromkeys(attacked.values(), PATIENCE))
    print(*(f"{mutant.place}: {test}" for mutant, test in noticed.items() if test), sep="\n")
    survivors = [mutant for mutant, test in noticed.items() if not test]
    _tell(todo, survivors, set())
    return int(bool(survivors))


def _attack(
    todo: list[Mutant],
    attacked: dict[str, tuple[str, ...]],
    workers: int,
    patience: dict[tuple[str, ...], float],
) -> dict[Mutant, str]:
    """Which test noticed each bug; survivors are told at once.

    `patience`: s, of tests that are known to pass without one.
    """
    waiting: queue.SimpleQueue[Mutant] = queue.SimpleQueue()
    noticed: dict[Mutant, str] = {}
    failed: list[BaseException] = []
    for mutant in todo:
        waiting.put(mutant)

    def work(copy: Copy) -> None:
        try:
            while not failed:
                mutant = waiting.get_nowait()
                noticed[mutant] = copy.noticed(mutant, attacked[mutant.file])
                if not noticed[mutant]:
                    print(f"{mutant.place}\n    - {mutant.was}\n    + {mutant.now}", flush=True)
                if not waiting.qsize() % 100:
                    print(f"{waiting.qsize()} to go", flush=True)
        except queue.Empty:
            pass
        except BaseException as error:  # noqa: BLE001 - raised again below
            failed.append(error)

    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        threads = []
        for number in range(workers):
            root = Path(folder).resolve() / str(number)
            shutil.copytree(ROOT, root, ignore=_left_out)
            threads.append(threading.Thread(target=work, args=(Copy(root, dict(patience)),)))
            threads[-1].start()
        for thread in threads:
            thread.join()
    if failed:
        raise failed[0]
    return noticed


def _left_out(folder: str, names: list[str]) -> set[str]:
    results = {"results"} if Path(folder) == ROOT else set()  # not `campaign/experiments/results`
    return LEFT_OUT(folder, names) | results


def _tell(every: list[Mutant], survivors: list[Mutant], listed: set[tuple[str, ...]]) -> None:
    made, left = (Counter(mutant.file for mutant in some) for some in (every, survivors))
    equal = Counter(mutant.file for mutant in every if mutant.key in listed)
    print("\n| file | mutants | killed | equivalent | survivors |\n|---|--:|--:|--:|--:|")
    for file, count in (*made.items(), ("all", made.total())):
        same, alive = (c.total() if file == "all" else c[file] for c in (equal, left))
        print(f"| {file} | {count} | {count - same - alive} | {same} | {alive} |")


if __name__ == "__main__":
    sys.exit(main())
