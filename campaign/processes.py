"""Worker and relay processes: start and end."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.context import BaseContext
from typing import Any, TypeVar

from campaign.gc_threshold import raise_gc_threshold

P = TypeVar("P")
R = TypeVar("R")
START_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
"""Not fork: this process has threads, and a fork would keep their locks locked."""


def process_context(preload: Iterable[str]) -> BaseContext:
    """Multiprocessing context of the workers. `preload`: modules imported once for all of them."""
    context = multiprocessing.get_context(START_METHOD)
    context.set_forkserver_preload(list(preload))
    return context


def start_preloading(preload: Iterable[str]) -> None:
    """Import `preload` in the background for later workers. Does nothing without a fork server."""
    process_context(preload)
    if START_METHOD != "forkserver":
        return
    from multiprocessing import forkserver, resource_tracker  # not on Windows

    before = os.environ.get("PYTHONWARNINGS")
    # A program that exits early leaves semaphores. The tracker removes them; suppress its warning.
    os.environ["PYTHONWARNINGS"] = "ignore:resource_tracker"
    try:
        resource_tracker.ensure_running()
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before
    forkserver.ensure_running()


def start_relay(module: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Process that runs a module of this program, with pipes for its input and output.

    In its own session: Ctrl-C in a terminal reaches only the host, which then stops in order. With
    -P a file in the user's folder cannot replace a module of this program.
    """
    return subprocess.Popen(  # noqa: S603 - this program, no shell
        [sys.executable, "-P", "-m", module, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )


def end_relay(process: subprocess.Popen[bytes], patience: float) -> None:
    """Wait for the end of a process (s), then kill it."""
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def new_pool(
    count: int, context: BaseContext, initializer: Callable[..., object], arguments: tuple[Any, ...]
) -> ProcessPoolExecutor:
    """Pool whose processes all start with the first call.

    A process start during the death of another breaks the pool: CPython 3.11 raises `OSError:
    handle is closed`, or a thread of the pool ends and its futures never complete.
    """
    pool = ProcessPoolExecutor(count, context, initializer, arguments)
    pool._safe_to_dynamically_spawn_children = False  # type: ignore[attr-defined]  # noqa: SLF001
    return pool


@contextmanager
def process_pool(
    count: int, preload: Iterable[str], begin: Callable[[Any], object], argument: object
) -> Iterator[ProcessPoolExecutor]:
    """Pool whose processes have called `begin(argument)`; an exception in the block ends them."""
    start_preloading(preload)
    others = set(multiprocessing.active_children())
    # Pickled once for all of them.
    handed = pickle.dumps((begin, argument), pickle.HIGHEST_PROTOCOL)
    pool = new_pool(count, process_context(preload), _begin, (handed,))
    try:
        yield pool
    except BaseException:  # e.g. Ctrl-C: do not wait for unneeded results
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def in_order(pool: ProcessPoolExecutor, work: Callable[[P], R], parts: Sequence[P]) -> Iterator[R]:
    """Results of `work` for each part, in order; a part whose process died is done in this one."""
    begun: list[Future[R]] = []
    with contextlib.suppress(BrokenProcessPool):  # earlier futures stay
        begun.extend(pool.submit(work, part) for part in parts)
    for place, part in enumerate(parts):
        try:
            result = begun[place].result()
        except (IndexError, BrokenProcessPool):
            result = work(part)
        yield result


def _begin(handed: bytes) -> None:
    initialize_worker()
    begin, argument = pickle.loads(handed)  # noqa: S301 (from the process that began this one)
    begin(argument)


def initialize_worker() -> None:
    """Set up a worker process: it ignores Ctrl-C and exits with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tune_memory()
    sys.stdout = sys.stderr  # prints of a plug-in
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def tune_memory() -> None:
    """Collect garbage seldom, and keep freed memory of arrays: the next trial needs as much.

    Otherwise the system zeroes each page again: a tenth of the processor time of a trial without
    samples. That part is only for the GNU C library.
    """
    raise_gc_threshold()
    with contextlib.suppress(AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_MMAP_THRESHOLD, 1 << 25)  # largest value allowed on all platforms
        mallopt(_TRIM_THRESHOLD, 1 << 30)


_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # malloc.h; bytes


def _exit_with_parent() -> None:
    """Exit with the parent; otherwise the worker would wait forever for its next task."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
