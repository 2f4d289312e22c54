"""Checks of the trials of a run, in several processes for large runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

from campaign import processes
from campaign.archive.reading.global_heap_check import add_known_heaps, known_heaps

T = TypeVar("T")
R = TypeVar("R")
WORTHWHILE = 400
"""Number of trials from which several processes save more time than their start takes."""
TOGETHER = 50
"""Number of trials of one part."""


def in_parts(
    work: Callable[[Path, Sequence[T]], R], path: Path, trials: Sequence[T]
) -> Iterator[R]:
    """Results of `work(path, part)` for parts of `trials`, in their order.

    `work` is a function of a module. A part whose process died is done in this process.
    """
    parts = [trials[start : start + TOGETHER] for start in range(0, len(trials), TOGETHER)]
    count = (os.cpu_count() or 1) if len(trials) >= WORTHWHILE else 1
    if count == 1:
        yield from (work(path, part) for part in parts)
        return
    preload = (work.__module__,)
    with processes.process_pool(count, preload, add_known_heaps, known_heaps(path)) as pool:
        yield from processes.in_order(pool, partial(work, path), parts)
