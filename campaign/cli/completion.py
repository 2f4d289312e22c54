"""Shell completion of runs, protocols and kinds; silent on errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import typer

RESULTS = "-results"
"""Ending of the name of a results file beside its run."""
RUNS = (".nxs", ".partial")
"""Suffixes of runs; completion does not open the files, as that takes too long."""


def complete_run(context: typer.Context, incomplete: str) -> list[str]:
    """Names of runs in the folder of `--results`, the newest first."""
    results = context.params.get("results")
    with suppress(OSError):
        paths = (results if isinstance(results, Path) else Path("results")).iterdir()
        names = {path.stem for path in paths if path.suffix in RUNS}
        names -= {f"{name}{RESULTS}" for name in names}
        return [name for name in sorted(names, reverse=True) if name.startswith(incomplete)]
    return []


def complete_protocol(context: typer.Context, incomplete: str) -> list[str]:
    """Names of protocols, shipped or in `protocols/`, and matching files and folders."""
    from campaign.resources import shipped_protocols

    own = (path.stem for path in Path("protocols").glob("*.toml"))
    known = sorted({*shipped_protocols(), *own})
    names = [name for name in known if name.startswith(incomplete)]
    with suppress(OSError):
        return names + list(_files(incomplete))
    return names


def complete_kind(context: typer.Context, incomplete: str) -> list[str]:
    """Names that `campaign kinds` explains."""
    from campaign.cli.kinds import kind_names

    return [name for name in kind_names() if name.startswith(incomplete)]


def _files(incomplete: str) -> Iterator[str]:
    """TOML files and folders that begin with the incomplete path."""
    folder, begun = incomplete.rpartition("/")[::2]
    prefix = f"{folder}/" if "/" in incomplete else ""
    for path in sorted(Path(prefix or ".").iterdir()):
        if path.name.startswith(begun) and not path.name.startswith("."):
            if path.is_dir():
                yield f"{prefix}{path.name}/"
            elif path.suffix == ".toml":
                yield f"{prefix}{path.name}"
