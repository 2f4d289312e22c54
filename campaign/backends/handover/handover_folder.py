"""The folder of a hand-over: outgoing files, returned files and their state.

    FOLDER/handover.json                whose it is
    FOLDER/columns.toml                 which columns of returned files are which channels
    FOLDER/index.html                   for the person at the rig
    FOLDER/trial-00017/                 what trial 17 asks, and its first attempt
    FOLDER/trial-00017/returned/        where its recording is put
    FOLDER/trial-00017/verdict.json     what became of that
    FOLDER/trial-00017/attempt-2/       the same once more, when the first was refused

Whatever is written is whole or not there: it is renamed into place. What came back stays as it is.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.errors import BackendError, UsageError
from campaign.plain_text import json_text
from campaign.trial import Trial

OWNER = "handover.json"
COLUMNS = "columns.toml"
MANIFEST = "manifest.json"
VERDICT = "verdict.json"
RETURNED = "returned"
PAGE = "index.html"
MARKS = ("done", "done.txt")
"""A file of such a name in `returned` says that its recording is whole."""
UNFINISHED = (".part", ".tmp", ".crdownload", ".partial")
"""Endings of files that somebody is still copying."""


@dataclass(frozen=True)
class Verdict:
    """What became of a recording that came back.

    Attributes:
        reason: why it was refused; empty when it was taken.
        files: SHA-256 by name.
        columns: SHA-256 of the layout by which it was read.
    """

    reason: str
    files: dict[str, str]
    columns: str = ""


@dataclass(frozen=True)
class Came:
    """Where a file came back before."""

    trial: int
    attempt: str
    columns: str


@dataclass(frozen=True)
class Attempt:
    """One attempt at a trial, and its folder."""

    trial: int
    number: int
    folder: Path

    @property
    def name(self) -> str:
        """For people, as in `trial-00017, attempt 2`."""
        return f"trial-{self.trial:05d}, attempt {self.number}"

    @property
    def returned(self) -> Path:
        return self.folder / RETURNED

    @property
    def verdict(self) -> Verdict | None:
        """What became of it; None while it is out."""
        tree = read_json(self.folder / VERDICT)
        if tree is None:
            return None
        files = {str(name): str(digest) for name, digest in dict(tree.get("files") or {}).items()}
        return Verdict(str(tree.get("refused", "")), files, str(tree.get("columns", "")))

    def judge(self, verdict: Verdict) -> None:
        """Keep what became of it."""
        tree = {
            "refused": verdict.reason,
            "files": verdict.files,
            "columns": verdict.columns,
        }
        write_text(self.folder / VERDICT, json_text(tree) + "\n")

    @property
    def fingerprint(self) -> str:
        """Of the trial that was handed out; empty when the manifest cannot be read."""
        return str((read_json(self.folder / MANIFEST) or {}).get("fingerprint", ""))

    @property
    def files(self) -> list[Path]:
        """What came back so far, by name: neither marks nor what is still being copied."""
        try:
            found = sorted(self.returned.iterdir())
        except OSError:
            return []
        return [path for path in found if path.is_file() and not _is_aside(path.name)]

    @property
    def is_marked(self) -> bool:
        """Whether somebody has said that all of it is there."""
        return any((self.returned / mark).exists() for mark in MARKS)


class Places:
    """The folder of one hand-over."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def columns(self) -> Path:
        return self.folder / COLUMNS

    def check_owner(self, run: str) -> None:
        """Raises UsageError when the folder is another run's, or somebody's own."""
        owner = read_json(self.folder / OWNER)
        if owner is not None and (other := str(owner.get("run", ""))) != run:
            raise UsageError(
                f"{self.folder} is the hand-over of {other or 'another run'}, and stays as it is; "
                f"take another folder, or go on with that run: campaign resume {other}"
            )
        if owner is None and next(self.folder.glob("trial-*"), None) is not None:
            raise UsageError(
                f"{self.folder} has trials of which no {OWNER} says whose they are; take another "
                "folder"
            )

    def claim(self, run: str) -> None:
        """The folder is that run's from now on. Raises BackendError when it cannot be written."""
        if not (self.folder / OWNER).exists():
            with writing(self.folder):
                self.folder.mkdir(parents=True, exist_ok=True)
            write_text(self.folder / OWNER, json_text({"run": run}) + "\n")

    def trials(self) -> list[int]:
        """Numbers of those that were handed out, in order."""
        names = [path.name.removeprefix("trial-") for path in self.folder.glob("trial-*")]
        numbers = sorted(int(name) for name in names if name.isdecimal())
        return [number for number in numbers if self.attempts(number)]

    def attempts(self, number: int) -> list[Attempt]:
        """Those at a trial that were handed out, in order."""
        first = self.folder / f"trial-{number:05d}"
        if not (first / MANIFEST).exists():
            return []
        found = [Attempt(number, 1, first)]
        while (folder := first / f"attempt-{len(found) + 1}").is_dir():
            found.append(Attempt(number, len(found) + 1, folder))
        return found

    def next_attempt(self, trial: Trial) -> tuple[Attempt, bool]:
        """The attempt that is due, and whether it is handed out already.

        A new one is due when the last was refused, or was that of a trial that is another today.
        """
        had = self.attempts(trial.number)
        if had and had[-1].fingerprint == trial.fingerprint:
            verdict = had[-1].verdict
            if verdict is None or not verdict.reason:
                return had[-1], True
        first = self.folder / trial.name
        number = len(had) + 1
        folder = first if number == 1 else first / f"attempt-{number}"
        return Attempt(trial.number, number, folder), False

    def came(self) -> dict[str, Came]:
        """Every file that was judged, by its SHA-256, and for what it came back last."""
        found: dict[str, Came] = {}
        for number in self.trials():
            for attempt in self.attempts(number):
                if (verdict := attempt.verdict) is not None:
                    found |= came_by(attempt, verdict)
        return found


def came_by(attempt: Attempt, verdict: Verdict) -> dict[str, Came]:
    """The files of one attempt, by their SHA-256."""
    came = Came(attempt.trial, attempt.name, verdict.columns)
    return {digest: came for digest in verdict.files.values() if digest}


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """A folder that is at `folder` when the block ends without an error. Raises BackendError."""
    part = folder.with_name(f".{folder.name}.part")
    with writing(folder):
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        try:
            yield part
            part.rename(folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Within the block something is written; what fails is a BackendError that names it."""
    try:
        yield
    except OSError as error:
        why = error.strerror or str(error)
        raise BackendError(f"{path}: the hand-over cannot be written: {why}") from None


def write_text(path: Path, text: str) -> None:
    """Write a file whole, or not at all. Raises BackendError."""
    part = path.with_name(f".{path.name}.part")
    with writing(path):
        part.write_text(text, encoding="utf-8", newline="\n")
        part.replace(path)


def read_json(path: Path) -> dict[str, Any] | None:
    """The table in a file; None where there is none."""
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return tree if isinstance(tree, dict) else None


def _is_aside(name: str) -> bool:
    return (
        name.startswith((".", "~"))
        or name in (*MARKS, MANIFEST)
        or name.lower().endswith(UNFINISHED)
    )
