"""Remnants of killed processes in a results folder, and their removal.

Only files written by this program (recognized by name) are removed, and only empty folders.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from campaign.archive.layout.files import PART, sync_folder
from campaign.archive.layout.names import (
    HEADER,
    JOURNAL,
    PARTIAL,
    PLAN,
    PLAN_TREES,
    PLAN_TRIALS,
    SEALED,
    SEALING,
    TRIAL_FILE,
)

OWN_FILES = frozenset({HEADER, PLAN, JOURNAL, PLAN_TRIALS, PLAN_TREES, SEALING})
"""Names of the files in the folder of a run, without those of trials."""


def is_own(name: str) -> bool:
    """Whether `name` is a name of this program's files in the folder of a run."""
    whole = name.removesuffix(PART)
    return name in OWN_FILES or whole in OWN_FILES or TRIAL_FILE.fullmatch(whole) is not None


def remove_folder(folder: Path) -> list[Path]:
    """Remove this program's files in a run's folder, and the folder; return other files.

    Other files stay, and then the folder too.
    """
    others = []
    # Header and journal are removed last, so a partly removed folder is recognizable as a run's.
    for path in sorted(folder.iterdir(), key=lambda path: path.name in (HEADER, JOURNAL)):
        if is_own(path.name) and not path.is_dir():
            path.unlink()
        else:
            others.append(path)
    if not others:
        folder.rmdir()
    sync_folder(folder.parent)
    return others


def take_over(folder: Path, target: Path) -> None:
    """Move the files that this program did not write from a run's folder into another."""
    for path in sorted(folder.iterdir()):
        if not is_own(path.name) or path.is_dir():
            path.rename(target / path.name)


def find_remnants(results: Path) -> dict[Path, str]:
    """Remnants of killed processes in a results folder, each with a description."""
    remnants = {}
    with contextlib.suppress(OSError):
        names = {path.name for path in results.iterdir()}
        for name in sorted(names):
            if (what := _remnant(name, names)) and not _in_use(results, name):
                remnants[results / name] = what
    return remnants


def clear_beginning(results: Path, run: str) -> None:
    """Remove an unfinished new folder of a run; the caller holds the run's lock.

    A folder beside its sealed file stays: if that file is damaged, the folder may have the run.
    """
    part = results / f"{run}{PARTIAL}{PART}"
    if part.is_dir():
        remove_folder(part)


def _remnant(name: str, names: set[str]) -> str:
    if name.endswith(PARTIAL + PART):
        return "the beginning of a run's folder, which was never finished"
    if name.endswith(PARTIAL) and name.removesuffix(PARTIAL) + SEALED in names:
        return "what is left of the folder of a run that is sealed; verify that run first"
    if name.startswith(".") and name.endswith(".lock"):
        return "the lock of a process that was killed; it locks nothing"
    return ""


def _in_use(results: Path, name: str) -> bool:
    """Whether a process is writing that run now."""
    run = name.removesuffix(PART).removesuffix(PARTIAL).removesuffix(SEALED)
    lock = results / (name if name.endswith(".lock") else f".{run}.lock")
    if os.name == "nt" or not lock.exists():
        return False
    import fcntl

    with lock.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
    return False
