"""Axes with cached ticks.

matplotlib asks for the ticks of an axis eight times while it is measured and drawn (for its labels,
its spines, its title), works them out anew each time, and measures their labels four times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ASKED = ("_update_ticks", "_get_ticklabel_bboxes")
"""Methods of an axis that say the same until something is moved; one that a matplotlib does not
have is not missed."""


@contextmanager
def settled(axes: Iterable[Axes]) -> Iterator[None]:
    """Inside the block neither the limits nor the places of the axes may change."""
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
    """What `work` said when it was asked first."""
    if not found:
        found.append(work(*arguments))
    return found[0]
