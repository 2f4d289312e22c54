"""Cache of run summaries of a folder, so that listing opens no archive.

A hidden file in the results folder that may be deleted at any time. A run that it lacks, or whose
size or time of change differs, is read itself. Only listings use it.
"""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Self

from campaign.archive.layout.header import RunStatus
from campaign.archive.layout.journal import JOURNAL
from campaign.archive.layout.run_folder import HEADER
from campaign.archive.reading.summary import RunSummary, summarise

INDEX = ".campaign-index.json"
_VERSION = 3
_LARGEST = 1 << 26  # bytes; an index of ten thousand runs has a tenth of this size

_TEXTS = ("name", "created", "ended", "title", "protocol", "backend", "operator", "problem")
_COUNTS = ("bytes", "planned", "trials", "failed", "interrupted", "untold")
_LISTS = ("tests", "benches", "tags")


class Index:
    """Summaries by file name, each with sizes and times of its files when read."""

    def __init__(self, results: Path, known: dict[str, Any]) -> None:
        self._results = results
        self._known = known
        self._used: dict[str, Any] = {}

    @classmethod
    def load(cls, results: Path) -> Self:
        """The index of `results`; empty if there is none or it is unusable."""
        path = results / INDEX
        try:
            if path.stat().st_size > _LARGEST:
                return cls(results, {})
            tree = json.loads(path.read_bytes())
            known = tree["runs"] if tree["index"] == _version() else {}
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            known = {}
        return cls(results, known if isinstance(known, dict) else {})

    def summary(self, path: Path) -> RunSummary:
        """Summary of the run at `path`, from the index if the run is unchanged."""
        try:
            stamp = _stamp(path)
        except OSError:
            return summarise(path)
        summary = _restored(path, stamp, self._known.get(path.name))
        if summary is None:
            summary = summarise(path)
        if not summary.problem:  # what could not be read may be readable by now
            self._used[path.name] = {"stamp": stamp, "summary": _described(summary)}
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
        text = json.dumps({"index": _version(), "runs": self._used}, separators=(",", ":"))
        try:
            part.write_text(text, encoding="utf-8")
            part.replace(path)
        except OSError:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def _version() -> list[Any]:
    """Version of the index and of the program: each program version has its own index."""
    from campaign import __version__

    return [_VERSION, __version__]


def _stamp(path: Path) -> list[int]:
    """Sizes and times that change with the run; for a folder, also of journal and header."""
    files = [path, path / JOURNAL, path / HEADER] if path.is_dir() else [path]
    stats = [file.stat() for file in files if file.exists()]
    return [number for stat in stats for number in (stat.st_size, stat.st_mtime_ns)]


def _described(summary: RunSummary) -> dict[str, Any]:
    tree = asdict(summary)
    del tree["path"]
    return tree | {name: list(tree[name]) for name in _LISTS}


def _restored(path: Path, stamp: list[int], entry: object) -> RunSummary | None:
    """A summary from the index; None if it is outdated or damaged."""
    if not isinstance(entry, dict) or entry.get("stamp") != stamp:
        return None
    tree = entry.get("summary")
    if not isinstance(tree, dict) or set(tree) != {*_TEXTS, *_COUNTS, *_LISTS, "status"}:
        return None
    sound = (
        all(isinstance(tree[name], str) for name in _TEXTS)
        and all(type(tree[name]) is int for name in _COUNTS)
        and all(isinstance(tree[name], list) for name in _LISTS)
        and all(isinstance(item, str) for name in _LISTS for item in tree[name])
        and tree["name"] == path.stem
        and tree["status"] in (None, *RunStatus)
    )
    if not sound:
        return None
    status = RunStatus(tree["status"]) if tree["status"] else None
    lists = {name: tuple(tree[name]) for name in _LISTS}
    return RunSummary(**(tree | lists | {"path": path, "status": status}))
