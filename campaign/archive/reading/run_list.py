"""The runs of a results folder, and the run that a name refers to."""

from __future__ import annotations

import re
import shlex
from fnmatch import fnmatchcase
from pathlib import Path

from campaign.archive.layout.files import PART
from campaign.archive.layout.names import PARTIAL, RESULTS, SEALED, results_path
from campaign.archive.reading.index import Index
from campaign.archive.reading.summary import RunSummary
from campaign.errors import UsageError

_HDF5 = b"\x89HDF\r\n\x1a\n"
_DATED = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}-\d{2}-\d{2}-")


def list_runs(results: Path) -> list[RunSummary]:
    """Every run in `results`, oldest first; a bad file is listed with its problem.

    Runs that are unchanged since the last listing are not opened: see `index`.
    """
    index = Index.load(results)
    runs = [index.summary(path) for path in run_paths(results)]
    index.save()
    return runs


def run_paths(results: Path) -> list[Path]:
    """Paths of the runs in `results`, oldest first by name; a sealed run hides its folder.

    Results files are excluded, with or without their run beside them. Raises UsageError if the
    folder does not exist or is unreadable.
    """
    try:
        entries = sorted(results.iterdir())
    except FileNotFoundError:
        hint = "there is no such folder; name the one that holds the runs; `campaign run` makes one"
        raise UsageError(f"{results}: {hint}") from None
    except OSError as error:
        raise UsageError(f"{results}: cannot be read: {error.strerror}") from None
    sealed = {path.stem: path for path in entries if path.suffix == SEALED and path.is_file()}
    partial = {path.stem: path for path in entries if path.suffix == PARTIAL and path.is_dir()}
    runs = partial | sealed
    order = sorted(runs, key=lambda name: (bool(_DATED.match(name)), name))
    return _without_results([runs[name] for name in order])


def _without_results(paths: list[Path]) -> list[Path]:
    """Those of `paths` that are not results files; opens only files with the name of results.

    A run may have such a name, too. A file with unclear content counts as results if the run that
    belongs to its name is beside it.
    """
    if not any(path.name.endswith(RESULTS) for path in paths):
        return paths
    from campaign.archive.reading.results_file import holds_results

    beside = {results_path(path) for path in paths}

    def is_run(path: Path) -> bool:
        if not path.name.endswith(RESULTS):
            return True
        results = holds_results(path)
        return path not in beside if results is None else not results

    return [path for path in paths if is_run(path)]


def find_run(results: Path, name: str | None = None) -> Path:
    """The run that a user means: a path, a name, a unique beginning of one, or None for the newest.

    Raises UsageError, with a list of runs, if none or several match, and for a file of another
    program.
    """
    if name and (path := _as_path(name)):
        _refuse_foreign(path)
        return path
    runs = {path.stem: path for path in run_paths(results)}
    if not runs:
        raise UsageError(f"{results}: there are no runs; `campaign run` makes one")
    if name is None:
        return list(runs.values())[-1]
    wanted = name.removesuffix(SEALED).removesuffix(PARTIAL)
    if wanted in runs:
        return runs[wanted]
    matching = [run for run in runs if wanted and run.startswith(wanted)]
    if len(matching) == 1:
        return runs[matching[0]]
    if matching:
        raise UsageError(f"{name!r} begins several runs: {_some(matching)}")
    raise UsageError(f"{results}: there is no run {name!r}; there are {_some(list(runs))}")


def find_runs(results: Path, name: str) -> list[Path]:
    """The runs that a user means by a name, a path, or a pattern of either such as `2026-11-*`.

    Raises UsageError if none matches.
    """
    if not any(mark in name for mark in "*?[") or _as_path(name):
        return [find_run(results, name)]
    wanted = Path(name)
    folder = wanted.parent if wanted.parent != Path() else results
    pattern = wanted.name.removesuffix(SEALED).removesuffix(PARTIAL)
    matches = [path for path in run_paths(folder) if fnmatchcase(path.stem, pattern)]
    if not matches:
        raise UsageError(f"{folder}: there is no run that {name!r} matches")
    return matches


def _as_path(name: str) -> Path | None:
    for path in (Path(name), Path(name + SEALED), Path(name + PARTIAL)):
        if path.is_file() or (path.is_dir() and path.suffix == PARTIAL):
            return path
    return None


def _refuse_foreign(path: Path) -> None:
    """Raise UsageError for a file without the suffix of a run that is not HDF5."""
    if path.is_dir() or path.suffix in (SEALED, PART):
        return
    try:
        with path.open("rb") as file:
            begins = file.read(len(_HDF5))
    except OSError:
        return  # opening the run reports the error
    if begins != _HDF5:
        raise UsageError(
            f"{path}: is not a run. If another program recorded it, `campaign import --guess "
            f"{shlex.quote(str(path))} > mapping.toml` writes a first mapping to import it by"
        )


def _some(names: list[str]) -> str:
    latest = names[-10:]
    return ", ".join(latest) + (f" and {len(names) - 10} more" if len(names) > 10 else "")
