"""Cache of run summaries of a folder, so that listing opens no archive.

A hidden file in the results folder that may be deleted at any time. A run that it lacks, or whose
size or time of change differs, is read itself. Only listings use it.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import replace
from pathlib import Path
from typing import Self

from pydantic import BaseModel

from campaign.archive.layout.names import HEADER, JOURNAL
from campaign.archive.reading.summary import RunSummary

INDEX = ".campaign-index.json"
_VERSION = 4
_LARGEST = 1 << 26  # bytes; an index of ten thousand runs has a tenth of this size


class _Entry(BaseModel):
    """A summary, with sizes and times of the run's files when it was read."""

    stamp: list[int]
    summary: RunSummary


class _Content(BaseModel):
    """Content of the file: versions, and entries by file name."""

    index: tuple[int, str]
    runs: dict[str, _Entry]


class Index:
    """Entries by file name: those of the file, and those of the listed runs."""

    def __init__(self, results: Path, known: dict[str, _Entry]) -> None:
        self._results = results
        self._known = known
        self._used: dict[str, _Entry] = {}

    @classmethod
    def load(cls, results: Path) -> Self:
        """The index of `results`; empty if there is none or it is unusable."""
        path = results / INDEX
        try:
            if path.stat().st_size > _LARGEST:
                return cls(results, {})
            content = _Content.model_validate_json(path.read_bytes(), strict=True)
        except (OSError, ValueError):
            return cls(results, {})
        return cls(results, content.runs if content.index == _version() else {})

    def summary(self, path: Path) -> RunSummary:
        """Summary of the run at `path`, from the index if the run is unchanged."""
        try:
            stamp = _stamp(path)
        except OSError:
            return _read(path)
        known = self._known.get(path.name)
        if known is not None and known.stamp == stamp and known.summary.name == path.stem:
            summary = replace(known.summary, path=path)
        else:
            summary = _read(path)
        if not summary.problem:  # what could not be read may be readable by now
            kept = replace(summary, path=Path(path.name))  # the folder may be moved
            self._used[path.name] = _Entry(stamp=stamp, summary=kept)
        if path.is_dir():  # the files of trials that are being written grow
            with contextlib.suppress(OSError):
                size = sum(file.stat().st_size for file in path.iterdir())
                summary = replace(summary, bytes=size)
        return summary

    def save(self) -> None:
        """Write the index if it changed; errors are ignored and make the next listing slower."""
        if self._used == self._known:
            return
        path = self._results / INDEX
        part = path.with_name(f"{INDEX}.{os.getpid()}.part")
        content = _Content(index=_version(), runs=self._used)
        try:
            part.write_text(content.model_dump_json(), encoding="utf-8")
            part.replace(path)
        except (OSError, ValueError):  # ValueError: a file name that is not UTF-8
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def _read(path: Path) -> RunSummary:
    from campaign.archive.reading.summarise import summarise  # late: reading a run imports numpy

    return summarise(path)


def _version() -> tuple[int, str]:
    """Version of the index and of the program: each program version has its own index."""
    from campaign import __version__

    return _VERSION, __version__


def _stamp(path: Path) -> list[int]:
    """Sizes and times that change with the run; for a folder, also of journal and header."""
    files = [path, path / JOURNAL, path / HEADER] if path.is_dir() else [path]
    stats = [file.stat() for file in files if file.exists()]
    return [number for stat in stats for number in (stat.st_size, stat.st_mtime_ns)]
