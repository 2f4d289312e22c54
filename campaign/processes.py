"""Processes that work for this one: how they are begun, and how they end with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterable
from multiprocessing.context import BaseContext

from campaign import garbage

METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
"""How processes are begun here. Not by fork: this process has threads, and whatever they hold would
stay locked."""


def context(preloaded: Iterable[str]) -> BaseContext:
    """What begins processes. `preloaded`: modules that are imported once for all of them."""
    found = multiprocessing.get_context(METHOD)
    found.set_forkserver_preload(list(preloaded))
    return found


def begin_early(preloaded: Iterable[str]) -> None:
    """Have what processes need imported meanwhile; where nothing can be done early, do nothing."""
    context(preloaded)
    if METHOD != "forkserver":
        return
    from multiprocessing import forkserver, resource_tracker  # which are not everywhere

    before = os.environ.get("PYTHONWARNINGS")
    # Who leaves at once leaves semaphores, which the tracker removes: nobody need be told.
    os.environ["PYTHONWARNINGS"] = "ignore:resource_tracker"
    try:
        resource_tracker.ensure_running()
    finally:
        del os.environ["PYTHONWARNINGS"]
        if before is not None:
            os.environ["PYTHONWARNINGS"] = before
    forkserver.ensure_running()


def begin_here() -> None:
    """To be called first in a process: Ctrl-C is for the one that began it, with which it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    garbage.seldom()
    sys.stdout = sys.stderr  # what a plug-in prints
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A process of a pool would wait for its next task for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
