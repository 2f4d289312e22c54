"""Garbage collection threshold of the processes of this program."""

from __future__ import annotations

import gc

GC_THRESHOLD = 100_000, 50, 50
"""Arguments of `gc.set_threshold`. Imports and trials create a million objects, few are garbage."""


def raise_gc_threshold() -> None:
    """Collect garbage less often in this process: after 100 000 new objects."""
    gc.set_threshold(*GC_THRESHOLD)
