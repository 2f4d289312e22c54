"""Garbage collection in the processes of this program."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

GC_THRESHOLD = 100_000, 50, 50
"""Arguments of `gc.set_threshold`. Imports and trials create a million objects, few are garbage."""


def raise_gc_threshold() -> None:
    """Collect garbage less often in this process: after 100 000 new objects."""
    gc.set_threshold(*GC_THRESHOLD)


@contextmanager
def paused_collection() -> Iterator[None]:
    """No collection in the block, which makes many objects that stay: a third of its time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.freeze()  # with `unfreeze`: moves all objects to the oldest generation, unvisited
            gc.unfreeze()
            gc.enable()
