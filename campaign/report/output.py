"""Atomic replacement of a report's folder; other files stay untouched."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from campaign.errors import UsageError
from campaign.plain_text import on_a_page

MARKER = ".campaign-report"
"""File that marks the folder as a report, which a newer one may replace.

Its first line is for users; each further line has SHA-256 and name of a written file. All other or
changed files in the folder belong to the user.
"""
EDITED = ".edited"
"""Suffix of a file that the user changed, if there is a new one of the same name."""


def write_files(folder: Path, files: Iterable[tuple[str, str]]) -> None:
    """Write texts by file name, which may include a subfolder."""
    for name, text in files:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(on_a_page(text), encoding="utf-8", newline="\n")


def replace_file(path: Path, data: bytes) -> None:
    """Replace a file atomically, also in case of an interrupt."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def refuse_other(output: Path, page: str) -> None:
    """Raise UsageError when `output` exists and is no folder with `page`."""
    _refuse_foreign(output)
    if (output / MARKER).is_file() and not (output / page).is_file():
        raise UsageError(
            f"{output} has no {page}, and is another page of campaign; name another folder"
        )


@contextmanager
def replaced_folder(output: Path) -> Iterator[Path]:
    """Empty folder beside `output` that replaces it when the block ends without an error.

    An older report at `output` stays until then, and remains when the block fails. Files that the
    user added or changed are copied. Raises UsageError when `output` is no report, or cannot be
    written.
    """
    _refuse_foreign(output)
    new = output.with_name(f".{output.name}.new-{os.getpid()}")
    old = output.with_name(f".{output.name}.old-{os.getpid()}")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir()
        (new / MARKER).touch()
        yield new
        written = _digests(new)
        _carry_over(output, new)
        head = "This folder is written by campaign; what you put here yourself stays.\n"
        lines = (f"{digest}  {name}\n" for name, digest in written.items())
        (new / MARKER).write_text(head + "".join(lines), encoding="utf-8")
        _swap(new, output, old)
    except OSError as error:
        raise UsageError(f"{output}: the report cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(new, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)


def _digests(folder: Path) -> dict[str, str]:
    """SHA-256 of each file except the marker, by path in the folder, sorted."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != MARKER)
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }


def _carry_over(output: Path, new: Path) -> None:
    """Copy files of the older report that the user added or changed; none without digests."""
    marker = output / MARKER
    lines = marker.read_text(encoding="utf-8").splitlines()[1:] if marker.is_file() else []
    if not lines:
        return
    written = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    for name, digest in _digests(output).items():
        if written.get(name) == digest:
            continue
        place = new / name
        if place.exists() and place.read_bytes() != (output / name).read_bytes():
            place = place.with_name(place.name + EDITED)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(output / name, place)


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
            "name another folder, or move it away"
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
