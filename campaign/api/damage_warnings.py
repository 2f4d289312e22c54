"""Damage of an archive as a Python warning, or as an error in strict mode."""

from __future__ import annotations

import functools
import inspect
import os
import warnings
from collections.abc import Sequence
from pathlib import Path

from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_one_line
from campaign.errors import ArchiveError, ArchiveWarning

_PACKAGE = str(Path(__file__).parents[1]) + os.sep


def report_damage(path: Path, damaged: Sequence[Damage], *, strict: bool) -> None:
    """Warn of damage of the run at `path`; if `strict`, raise ArchiveError instead."""
    if not damaged:
        return
    text = in_one_line(path, damaged)
    if strict:
        raise ArchiveError(text)
    warn(text)


def warn(text: str) -> None:
    """Issue an ArchiveWarning at the caller's line outside the program."""
    warnings.warn(text, ArchiveWarning, stacklevel=_of_the_caller())


def _of_the_caller() -> int:
    """`stacklevel` for `warn` of the first frame outside the program."""
    frame, level = inspect.currentframe(), 0
    while frame is not None and _is_ours(frame.f_code.co_filename):
        frame, level = frame.f_back, level + 1
    return level


def _is_ours(file: str) -> bool:
    return file.startswith(_PACKAGE) or file == functools.__file__  # of a cached property
