"""Compiling the engine once per installation, while there is something else to do.

In one process numba compiles one function at a time, so each further width has a process of its
own, which fills the cache: `python -m campaign.execution.first_start WIDTH`.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict

from campaign.physics.complete import CompleteBench, complete
from campaign.physics.machine_code import (
    WIDTHS,
    Made,
    all_made,
    folder,
    make,
    note_all_made,
    parts,
)
from campaign.protocol.bench_file import load_bench
from campaign.resources import shipped_benches

Told = Callable[[Made], None]


def make_all(told: Told, helpers: Helpers | None = None) -> None:
    """Make all that the shipped benches need: what is kept is loaded, the rest is compiled.

    `told` of each part once it is there, with what it took wherever it was compiled.
    """
    benches = _benches()
    first, *others = WIDTHS
    for part in parts(first, benches):
        told(make(part))
    elsewhere = helpers.wait() if helpers is not None else {}
    for width in others:
        for part in parts(width, benches):
            loaded = make(part)
            told(elsewhere.get(loaded.name, loaded))
    note_all_made()


class Helpers:
    """Processes that compile while this one does; a context manager that leaves none behind.

    None are started where they could keep nothing for us, or would only wait for our processor.
    """

    def __init__(self, widths: Sequence[int] = WIDTHS[1:]) -> None:
        useful = folder() is not None and (os.cpu_count() or 1) > 1
        self._processes = [self._start(width) for width in widths] if useful else []

    def __enter__(self) -> Helpers:
        return self

    def __exit__(self, *exception: object) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
            for stream in filter(None, (process.stdin, process.stdout)):
                stream.close()

    def wait(self) -> dict[str, Made]:
        """What they have made, by name, when they have ended; one that failed made less."""
        lines = [line for each in self._processes for line in each.stdout or ()]
        made = [Made(**json.loads(line)) for line in lines]
        return {each.name: each for each in made}

    @staticmethod
    def _start(width: int) -> subprocess.Popen[str]:
        # -P: nothing in the user's folder can stand in for a module of ours.
        return subprocess.Popen(  # noqa: S603 - our own program, no shell
            [sys.executable, "-P", "-m", __name__, str(width)],
            stdin=subprocess.PIPE,  # which closes, however we end
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
        )


LONGEST = 600.0
"""s; longer nothing compiles, even on a machine that has much else to do."""


class FirstStart:
    """Makes the machine code in the background where it is not there; a context manager.

    Who simulates needs the same code, and so should `wait` first. What goes wrong here costs time
    only: what is missing is compiled where it is used, and there it is said what is wrong.

    Attributes:
        processor: what it took in this process, once it is over (s).
    """

    def __init__(self) -> None:
        self.processor = 0.0
        self._helpers: Helpers | None = None
        self._thread: threading.Thread | None = None

    def __enter__(self) -> FirstStart:
        if not all_made():
            with suppress(OSError):  # no more processes: this one compiles all
                self._helpers = Helpers()
            # As a daemon it keeps no program that ends.
            self._thread = threading.Thread(target=self._make, name="compile", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._helpers is not None:
            self._helpers.__exit__()

    @property
    def is_busy(self) -> bool:
        """Whether there would be something to wait for."""
        return self._thread is not None and self._thread.is_alive()

    def wait(self) -> None:
        """Until everything is there, or something hangs."""
        if self._thread is not None:
            self._thread.join(LONGEST)

    def _make(self) -> None:
        with suppress(Exception):  # see the class
            make_all(lambda made: None, self._helpers)
        self.processor = time.thread_time()


def _benches() -> list[CompleteBench]:
    return [complete(load_bench(name)) for name in shipped_benches()]


def _lines(width: int) -> Iterator[str]:
    for part in parts(width, _benches()):
        yield json.dumps(asdict(make(part)))


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a word
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for line in _lines(int(sys.argv[1])):
        print(line, flush=True)  # noqa: T201
