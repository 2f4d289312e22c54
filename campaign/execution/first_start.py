"""Compiling the engine once per installation.

In one process numba compiles one function at a time. Parallel compilation uses further processes
that fill the cache: `python -m campaign.execution.first_start WIDTH [engine]`.
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
from contextlib import ExitStack, suppress
from dataclasses import asdict

from campaign.gc_threshold import raise_gc_threshold
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.machine_code import (
    WIDTHS,
    CompiledPart,
    engine,
    folder,
    is_made,
    make,
    note_made,
    parts,
)
from campaign.protocol.bench_file import load_bench
from campaign.resources import shipped_benches

OnPart = Callable[[CompiledPart], None]
LONGEST = 600.0
"""s; time limit of the compilation, also for a busy machine."""


def make_all(on_part: OnPart, helpers: Helpers | None = None) -> None:
    """Load or compile all machine code that the shipped benches need.

    Call `on_part` for each part when it is ready, with its times in the process that compiled it.
    """
    benches = _benches()
    first, *others = WIDTHS
    for part in parts(first, benches):
        on_part(make(part))
    note_made(first)
    elsewhere = helpers.wait() if helpers is not None else {}
    for width in others:
        for part in parts(width, benches):
            loaded = make(part)
            on_part(elsewhere.get(loaded.name, loaded))
        note_made(width)


class Helpers:
    """Processes that compile in parallel; a context manager that ends all of them.

    None are started without a cache folder or with a single processor.
    """

    def __init__(self, widths: Sequence[int] = WIDTHS[1:], *only: str) -> None:
        useful = folder() is not None and (os.cpu_count() or 1) > 1
        self._processes = [self._start(width, *only) for width in widths] if useful else []

    def __enter__(self) -> Helpers:
        return self

    def __exit__(self, *exception: object) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
            for stream in filter(None, (process.stdin, process.stdout)):
                stream.close()

    def wait(self) -> dict[str, CompiledPart]:
        """Wait for their end; compiled parts by name. A failed process returns fewer parts."""
        for process in self._processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(LONGEST)
            process.kill()  # if it hangs
        lines = [line for each in self._processes for line in each.stdout or ()]
        made = [CompiledPart(**json.loads(line)) for line in lines]
        return {each.name: each for each in made}

    @staticmethod
    def _start(width: int, *only: str) -> subprocess.Popen[str]:
        # -P: a file in the user's folder cannot replace a module of the program.
        return subprocess.Popen(  # noqa: S603 - our own program, no shell
            [sys.executable, "-P", "-m", __name__, str(width), *only],
            stdin=subprocess.PIPE,  # closes with the end of this process
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
        )


class FirstStart:
    """Compiles a missing engine in another process; a context manager.

    Simulations need the same code: call `wait` first. An error here costs only time: missing code
    is compiled at its use, where errors are reported.

    Attributes:
        processor: processor time of `wait` in this process (s), after its end.
    """

    def __init__(self) -> None:
        self.processor = 0.0
        self._widths: list[int] = []
        self._helpers: list[Helpers] = []
        self._leaving = ExitStack()

    def __enter__(self) -> FirstStart:
        self.need(1)
        return self

    def __exit__(self, *exception: object) -> None:
        self._leaving.close()

    def need(self, width: int) -> None:
        """Begin to compile the engine for `width` lanes, unless it exists."""
        if not is_made(width):
            self._widths.append(width)
            with suppress(OSError):  # no process available: this one compiles it
                self._helpers.append(self._leaving.enter_context(Helpers([width], "engine")))

    @property
    def is_busy(self) -> bool:
        """Whether `wait` has work to wait for."""
        return bool(self._widths)

    def wait(self, meanwhile: Callable[[], None]) -> None:
        """Call `meanwhile`, then wait until all is compiled or a time limit is reached."""
        began = time.thread_time()
        with suppress(Exception):  # see the class
            meanwhile()
            for helper in self._helpers:
                helper.wait()
            for width in self._widths:
                make(engine(width, _bench()))
                note_made(width)
        self._widths.clear()
        self.processor = time.thread_time() - began


def _benches() -> list[CompleteBench]:
    return [complete(load_bench(name)) for name in shipped_benches()]


def _bench() -> CompleteBench:
    """Any shipped bench: the engine is the same for all."""
    return complete(load_bench(shipped_benches()[0]))


def _lines(width: int, *only: str) -> Iterator[str]:
    for part in [engine(width, _bench())] if only else parts(width, _benches()):
        yield json.dumps(asdict(make(part)))


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    raise_gc_threshold()  # a tenth of the time
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends it without a message
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for line in _lines(int(sys.argv[1]), *sys.argv[2:]):
        print(line, flush=True)  # noqa: T201
