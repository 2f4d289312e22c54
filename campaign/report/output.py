"""The report's folder: there whole or not at all, and never in place of somebody's other files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from campaign.errors import UsageError

MARKER = ".campaign-report"
"""A file that says the folder is a report and may be replaced by a newer one."""


@contextmanager
def replaced_folder(output: Path) -> Iterator[Path]:
    """An empty folder beside `output` that takes its place when the block ends without an error.

    An older report at `output` stays until then, and stays for good when the block fails. Raises
    UsageError when `output` is something other than a report, or cannot be written.
    """
    _refuse_foreign(output)
    new = output.with_name(f".{output.name}.new-{os.getpid()}")
    old = output.with_name(f".{output.name}.old-{os.getpid()}")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir()
        told = "This folder is written by campaign and replaced as a whole.\n"
        (new / MARKER).write_text(told, encoding="utf-8")
        yield new
        _swap(new, output, old)
    except OSError as error:
        raise UsageError(f"{output}: the report cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(new, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def _refuse_foreign(output: Path) -> None:
    try:
        foreign = (output.exists() and not output.is_dir()) or (
            output.is_dir() and any(output.iterdir()) and not (output / MARKER).is_file()
        )
    except OSError as error:
        raise UsageError(f"{output}: cannot be read: {error.strerror}") from None
    if foreign:
        raise UsageError(
            f"{output} is there already and is no report of campaign; "
            "name another folder with --output, or move it away"
        )


def _swap(new: Path, output: Path, old: Path) -> None:
    had_old = output.exists()
    if had_old:
        output.rename(old)
    try:
        new.rename(output)
    except OSError:
        if had_old:
            old.rename(output)
        raise
