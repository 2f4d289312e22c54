"""Figures as PDF for LaTeX.

Nobody who draws knows of it: within `also_as_pdf`, each sheet that becomes an SVG document is kept
as a PDF of one page until somebody takes it.
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
"""Nothing that changes from run to run."""

_kept: ContextVar[list[bytes] | None] = ContextVar("_kept", default=None)


@contextmanager
def also_as_pdf() -> Iterator[None]:
    """Within the block, `taken` has the sheet that was drawn last."""
    before = _kept.set([])
    try:
        yield
    finally:
        _kept.reset(before)


def keeps_pdf() -> bool:
    """Whether sheets are kept, by whoever draws them here."""
    return _kept.get() is not None


def keep_as_pdf(sheet: Canvas) -> None:
    """Called with every finished sheet; outside of `also_as_pdf` it does nothing."""
    kept = _kept.get()
    if kept is not None:
        out = io.BytesIO()
        sheet.savefig(out, format="pdf", metadata=METADATA)
        kept[:] = [out.getvalue()]


def taken() -> bytes | None:
    """The last sheet that was drawn, as PDF, once; None when there is none."""
    kept = _kept.get()
    return kept.pop() if kept else None
