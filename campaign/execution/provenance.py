"""What an archive says about where a run comes from: versions, machine, command, revision."""

from __future__ import annotations

import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import campaign

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "h5py", "pydantic")


def versions() -> dict[str, str]:
    """Versions of this program, Python, and the libraries that shape the samples."""
    found = {"campaign": campaign.__version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def host() -> dict[str, str]:
    """The machine that executed the run."""
    return {
        "name": platform.node(),
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
    }


def command() -> tuple[str, ...]:
    """The command line, with the program by its bare name."""
    return (Path(sys.argv[0]).name, *sys.argv[1:])


def git_revision(file: Path) -> str:
    """Revision of the working tree that `file` is tracked in, `-dirty` when it has changes.

    Empty when there is none, or no git.
    """
    folder = file.resolve().parent
    if not _git(folder, "ls-files", "--error-unmatch", "--", file.name):
        return ""
    return _git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")


def _git(folder: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(  # noqa: S603 - a list, never a shell
            ["git", "-C", str(folder), *arguments],  # noqa: S607 - whichever git the user has
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
