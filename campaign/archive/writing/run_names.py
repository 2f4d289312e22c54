"""Unique names of new runs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from itertools import count
from pathlib import Path

from campaign.archive.writing.run_lock import RunLock
from campaign.errors import UsageError


def new_run_name(results: Path, protocol_stem: str, now: datetime) -> str:
    """A sortable name that no run in `results` has, e.g. `2026-11-21T09-36-58-quickstart`."""
    return next(_free_names(results, protocol_stem, now))


@contextmanager
def reserved_name(results: Path, protocol_stem: str, now: datetime) -> Iterator[RunLock]:
    """Lock of a run with a new name, until the block ends or the run is closed.

    Runs that begin in the same second get different names. Creates `results` if it is missing.
    Raises UsageError if it cannot be written.
    """
    new = not results.exists()
    with writable(results):
        lock = _first_lock(results, protocol_stem, now)
    try:
        yield lock
    finally:
        lock.release()
        if new:
            with suppress(OSError):  # it is not empty after the start of a run
                results.rmdir()


@contextmanager
def writable(results: Path) -> Iterator[None]:
    """Create the folder `results` if it is missing, for a block that writes in it.

    Raises UsageError if it cannot be written.
    """
    try:
        results.mkdir(parents=True, exist_ok=True)
        yield
    except (FileExistsError, NotADirectoryError):
        raise UsageError(f"{results}: is not a folder; choose another --results") from None
    except OSError as error:
        raise UsageError(
            f"{results}: cannot keep results there: {error.strerror}; choose another --results"
        ) from None


def _first_lock(results: Path, stem: str, now: datetime) -> RunLock:
    for name in _free_names(results, stem, now):
        try:
            lock = RunLock.acquire(results, name)
        except UsageError:
            continue  # another process begins this run
        if not _taken(results, name):
            return lock
        lock.release()
    raise AssertionError("names do not end")


def _free_names(results: Path, protocol_stem: str, now: datetime) -> Iterator[str]:
    stem = re.sub(r"[^A-Za-z0-9._+-]+", "-", protocol_stem).strip("-.")[:120] or "run"
    base = f"{now:%Y-%m-%dT%H-%M-%S}-{stem}"
    names = (base if number == 1 else f"{base}-{number}" for number in count(1))
    return (name for name in names if not _taken(results, name))


def _taken(results: Path, name: str) -> bool:
    return results.is_dir() and any(path.stem == name for path in results.glob(f"{name}.*"))
