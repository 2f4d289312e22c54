"""Figures as PDF for LaTeX.

Drawing functions need no change: within `also_as_pdf`, each sheet that becomes an SVG document is
kept as a PDF of one page until the caller takes it (`taken`).
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

METADATA = {"CreationDate": None, "ModDate": None, "Creator": None, "Producer": None}
"""Omits metadata that changes from run to run."""

_kept: ContextVar[list[bytes] | None] = ContextVar("_kept", default=None)


@contextmanager
def also_as_pdf() -> Iterator[None]:
    """Keep the last drawn sheet for `taken` within the block."""
    before = _kept.set([])
    try:
        yield
    finally:
        _kept.reset(before)


def keeps_pdf() -> bool:
    """Whether sheets are kept in this context."""
    return _kept.get() is not None


def keep_as_pdf(sheet: Canvas) -> None:
    """Keep a finished sheet as PDF; outside of `also_as_pdf` do nothing."""
    kept = _kept.get()
    if kept is not None:
        out = io.BytesIO()
        sheet.savefig(out, format="pdf", metadata=METADATA)
        kept[:] = [out.getvalue()]


def taken() -> bytes | None:
    """Take the last drawn sheet as PDF, only once; None without any."""
    kept = _kept.get()
    return kept.pop() if kept else None
