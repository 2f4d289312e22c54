"""The file with the signature of a sealed run, beside it: `RUN.nxs.sig`."""

from __future__ import annotations

import contextlib
import os
import stat
from itertools import count
from pathlib import Path

from campaign.archive.layout.files import PART, sync_folder, why, write_atomically
from campaign.errors import ArchiveError, UsageError

LARGEST = 1 << 14
"""Largest size of a signature (bytes); one by an RSA key of 16384 bits has a third of it."""


def signature_path(sealed: Path) -> Path:
    """Path of the signature of a sealed run."""
    return sealed.with_name(f"{sealed.name}.sig")


def has_signature(sealed: Path) -> bool:
    """Whether the signature path exists, even as a broken link."""
    return os.path.lexists(signature_path(sealed))


def read_signature(sealed: Path) -> str:
    """The signature's text. Raises ArchiveError if it is missing, not a file, or too large."""
    path = signature_path(sealed)
    try:
        # Non-blocking: opening a pipe of that name would wait.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(descriptor, "rb") as file:
            regular = stat.S_ISREG(os.fstat(descriptor).st_mode)
            content = file.read(LARGEST + 1) if regular else b""
    except FileNotFoundError:
        raise ArchiveError(f"{sealed}: is not signed: there is no {path.name} beside it") from None
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {why(error)}") from None
    if not regular or len(content) > LARGEST:
        what = f"has more than {LARGEST} bytes" if regular else "is not a file"
        raise ArchiveError(f"{path}: {what}, so it is not a signature")
    return content.decode("ascii", "replace")


def write_signature(sealed: Path, text: str) -> Path:
    """Write the signature beside its run, completely or not at all; return its path.

    The caller holds the run's lock. Raises UsageError if a signature exists, ArchiveError if the
    write fails.
    """
    path = signature_path(sealed)
    if has_signature(sealed):
        raise UsageError(f"{path}: is there already; --replace sets it aside")
    try:
        write_atomically(path, text)
    except OSError as error:
        with contextlib.suppress(OSError):
            path.with_name(path.name + PART).unlink(missing_ok=True)
        raise ArchiveError(f"{path}: cannot be written: {why(error)}") from None
    return path


def set_aside_signature(sealed: Path, label: str = "before-resume") -> Path | None:
    """Rename the old signature of `sealed` to a free name such as `RUN.nxs.sig.before-resume-1`.

    Does nothing without a signature. The caller holds the run's lock. A resume calls this after the
    sealed file is gone: until then the signature belongs beside it. A crash in between leaves a
    signature without a run, which the next resume renames. Raises OSError.
    """
    if not has_signature(sealed):
        return None
    path = signature_path(sealed)
    names = (path.with_name(f"{path.name}.{label}-{number}") for number in count(1))
    free = next(name for name in names if not os.path.lexists(name))
    path.rename(free)
    sync_folder(path.parent)
    return free
