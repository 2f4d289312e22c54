"""Locations of shipped protocols, benches and templates.

A wheel contains them under `campaign/_shipped`; in a checkout they are top-level folders. The
working directory is never searched: a template is code.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from campaign.errors import CampaignError, UsageError, writing

SHIPPED = ("protocols", "templates")


def protocols_folder() -> Path:
    """The shipped protocols, with their benches under `benches/`."""
    return _shipped_root() / "protocols"


def templates_folder() -> Path:
    """The shipped Jinja2 templates of the report."""
    return _shipped_root() / "templates"


def shipped_protocols() -> tuple[str, ...]:
    """Names of the shipped protocols for `campaign run NAME`, sorted."""
    return tuple(sorted(path.stem for path in protocols_folder().glob("*.toml")))


def shipped_protocol(name: str) -> Path | None:
    """Path of the shipped protocol with this bare name (`quickstart`), or None."""
    return protocols_folder() / f"{name}.toml" if name in shipped_protocols() else None


def shipped_benches() -> tuple[str, ...]:
    """Names of the shipped benches, sorted."""
    return tuple(sorted(path.stem for path in (protocols_folder() / "benches").glob("*.toml")))


def copy_shipped(destination: Path) -> tuple[Path, ...]:
    """Copy protocols, benches and templates into `destination`; paths of the written files.

    Raises UsageError if a file would be overwritten (before writing any), or if the folder is not
    writable.
    """
    copies = {
        source: destination / source.relative_to(_shipped_root())
        for folder in SHIPPED
        for source in sorted((_shipped_root() / folder).rglob("*"))
        if source.is_file() and "__pycache__" not in source.parts
    }
    taken = [path for path in copies.values() if path.exists()]
    if taken:
        more = f", and {len(taken) - 1} more of the files" if len(taken) > 1 else ""
        raise UsageError(
            f"{taken[0]} is there already{more}; "
            "nothing was written: name a new folder, or move the old files away"
        )
    with writing(destination):
        for source, copy in copies.items():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)
    return tuple(copies.values())


def _shipped_root() -> Path:
    package = Path(__file__).resolve().parent
    installed = package / "_shipped"
    root = installed if installed.is_dir() else package.parent
    if not all((root / folder).is_dir() for folder in SHIPPED):
        raise CampaignError(
            f"the shipped protocols and templates are missing from {root}; install again"
        )
    return root
