"""The folder of a hand-over: outgoing files, returned files and their state.

    FOLDER/handover.json                run that owns the folder
    FOLDER/columns.toml                 mapping of columns of returned files to channels
    FOLDER/index.html                   page for the person at the rig
    FOLDER/trial-00017/                 files of trial 17, and its first attempt
    FOLDER/trial-00017/returned/        folder for its recording
    FOLDER/trial-00017/verdict.json     verdict on the recording
    FOLDER/trial-00017/attempt-2/       the next attempt after a refusal

Files are written completely and then renamed. Returned files are never changed.
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
"""Names of a file in `returned` that marks the recording as complete."""
UNFINISHED = (".part", ".tmp", ".crdownload", ".partial")
"""Extensions of incomplete copies."""


@dataclass(frozen=True)
class Verdict:
    """Verdict on a returned recording.

    Attributes:
        reason: reason of the refusal; empty if it was accepted.
        files: SHA-256 by name.
        columns: SHA-256 of the layout used to read it.
    """

    reason: str
    files: dict[str, str]
    columns: str = ""


@dataclass(frozen=True)
class Came:
    """Trial and attempt for which a file was returned earlier."""

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
        """Name for messages, as `trial-00017, attempt 2`."""
        return f"trial-{self.trial:05d}, attempt {self.number}"

    @property
    def returned(self) -> Path:
        return self.folder / RETURNED

    @property
    def verdict(self) -> Verdict | None:
        """Verdict on its recording; None while there is none."""
        tree = read_json(self.folder / VERDICT)
        if tree is None:
            return None
        files = {str(name): str(digest) for name, digest in dict(tree.get("files") or {}).items()}
        return Verdict(str(tree.get("refused", "")), files, str(tree.get("columns", "")))

    def judge(self, verdict: Verdict) -> None:
        """Write the verdict."""
        tree = {
            "refused": verdict.reason,
            "files": verdict.files,
            "columns": verdict.columns,
        }
        write_text(self.folder / VERDICT, json_text(tree) + "\n")

    @property
    def fingerprint(self) -> str:
        """Fingerprint of the exported trial; empty if the manifest is unreadable."""
        return str((read_json(self.folder / MANIFEST) or {}).get("fingerprint", ""))

    @property
    def files(self) -> list[Path]:
        """Returned files sorted by name, without marks and incomplete copies."""
        try:
            paths = sorted(self.returned.iterdir())
        except OSError:
            return []
        return [path for path in paths if path.is_file() and not _is_aside(path.name)]

    @property
    def is_marked(self) -> bool:
        """Whether a mark declares the recording complete."""
        return any((self.returned / mark).exists() for mark in MARKS)


class Places:
    """The folder of one hand-over."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def columns(self) -> Path:
        return self.folder / COLUMNS

    def check_owner(self, run: str) -> None:
        """Raise UsageError if the folder belongs to another run, or to no run."""
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
        """Note `run` as the owner of the folder. Raises BackendError if it is not writable."""
        if not (self.folder / OWNER).exists():
            with writing(self.folder):
                self.folder.mkdir(parents=True, exist_ok=True)
            write_text(self.folder / OWNER, json_text({"run": run}) + "\n")

    def trials(self) -> list[int]:
        """Numbers of the exported trials, in order."""
        names = [path.name.removeprefix("trial-") for path in self.folder.glob("trial-*")]
        numbers = sorted(int(name) for name in names if name.isdecimal())
        return [number for number in numbers if self.attempts(number)]

    def attempts(self, number: int) -> list[Attempt]:
        """The exported attempts at a trial, in order."""
        first = self.folder / f"trial-{number:05d}"
        if not (first / MANIFEST).exists():
            return []
        attempts = [Attempt(number, 1, first)]
        while (folder := first / f"attempt-{len(attempts) + 1}").is_dir():
            attempts.append(Attempt(number, len(attempts) + 1, folder))
        return attempts

    def next_attempt(self, trial: Trial) -> tuple[Attempt, bool]:
        """The due attempt, and whether it is already exported.

        A new one is due if the last was refused, or if the trial has changed since.
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
        """Last use of every judged file, by its SHA-256."""
        came_by_digest: dict[str, Came] = {}
        for number in self.trials():
            for attempt in self.attempts(number):
                if (verdict := attempt.verdict) is not None:
                    came_by_digest |= came_by(attempt, verdict)
        return came_by_digest


def came_by(attempt: Attempt, verdict: Verdict) -> dict[str, Came]:
    """Use of the files of one attempt, by their SHA-256."""
    came = Came(attempt.trial, attempt.name, verdict.columns)
    return {digest: came for digest in verdict.files.values() if digest}


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Create `folder` completely, after the block, or not at all. Raises BackendError."""
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
    """Convert an OSError of writing in the block to a BackendError that names `path`."""
    try:
        yield
    except OSError as error:
        why = error.strerror or str(error)
        raise BackendError(f"{path}: the hand-over cannot be written: {why}") from None


def write_text(path: Path, text: str) -> None:
    """Write a file completely, or not at all. Raises BackendError."""
    part = path.with_name(f".{path.name}.part")
    with writing(path):
        part.write_text(text, encoding="utf-8", newline="\n")
        part.replace(path)


def read_json(path: Path) -> dict[str, Any] | None:
    """JSON table in a file; None without a valid one."""
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
