"""Drawings that are made once, for tests of what stands around them."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from typing import Any

import pytest

from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.drawing.pdf import keeps_pdf
from campaign.report.page.drawings import Drawing, Overview

KEPT: dict[str, DrawingFiles | None] = {}
"""By all that is drawn."""


def keep_drawings(patch: pytest.MonkeyPatch) -> None:
    """From now on what was drawn in this process is not drawn again."""
    for kind in (Drawing, Overview):
        patch.setattr(kind, "made", _kept(kind.made))


def _kept(make: Callable[[Any], DrawingFiles | None]) -> Callable[[object], DrawingFiles | None]:
    def made(drawable: object) -> DrawingFiles | None:
        if keeps_pdf():  # the sheet is wanted, too
            return make(drawable)
        shown = hashlib.sha256(pickle.dumps(drawable)).hexdigest()
        if shown not in KEPT:
            KEPT[shown] = make(drawable)
        return KEPT[shown]

    return made
