"""Garbage collection threshold of the processes of this program."""

from __future__ import annotations

import gc

GC_THRESHOLD = 100_000, 50, 50
"""As `gc.set_threshold` takes it. Imports and trials make a million objects, few are garbage."""


def raise_gc_threshold() -> None:
    """Collect garbage less often in this process; cycles are still freed, 100 000 objects later."""
    gc.set_threshold(*GC_THRESHOLD)
