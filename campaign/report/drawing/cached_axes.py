"""Axes with cached ticks.

During layout and drawing, matplotlib computes the ticks of an axis eight times (for labels, spines
and title), and measures their labels four times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ASKED = ("_update_ticks", "_get_ticklabel_bboxes")
"""Methods of an axis with a constant result until something moves; matplotlib may lack some."""


@contextmanager
def settled(axes: Iterable[Axes]) -> Iterator[None]:
    """Cache the ticks within the block; limits and positions of the axes must not change."""
    every = [axis for ax in axes for axis in (ax.xaxis, ax.yaxis)]
    kept = [(axis, name) for axis in every for name in ASKED if hasattr(axis, name)]
    for axis, name in kept:
        setattr(axis, name, partial(_once, getattr(axis, name), []))
    try:
        yield
    finally:
        for axis, name in kept:
            delattr(axis, name)


def _once(work: Callable[..., Any], found: list[Any], *arguments: Any) -> Any:
    """Result of the first call of `work`."""
    if not found:
        found.append(work(*arguments))
    return found[0]
