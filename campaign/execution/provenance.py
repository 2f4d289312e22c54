"""Provenance in an archive: versions, machine, command, revision."""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import campaign
from campaign.archive.layout.header import FORMAT
from campaign.backends import backends
from campaign.entry_points import PlugIn
from campaign.experiments import experiments
from campaign.physics.compensation import compensation_methods
from campaign.physics.engine_version import ENGINE
from campaign.physics.friction import friction_models
from campaign.plugins import Kinds
from campaign.protocol.files import SCHEMA
from campaign.source_hash import digest, sources_of
from campaign.trial import Tree, Trial
from campaign.wire.codes import VERSION

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "h5py", "pydantic")


SHAPING = ("campaign", "python", "engine", *LIBRARIES)
"""Components whose version may change samples; compared when a run is resumed."""


def own_versions() -> dict[str, str]:
    """Version numbers of the program's parts, each independent of the others."""
    numbers = {
        "engine": ENGINE,
        "format": FORMAT,
        "wire": VERSION,
        "bench schema": SCHEMA["bench"],
        "protocol schema": SCHEMA["protocol"],
    }
    return {name: str(number) for name, number in numbers.items()}


def shaping(versions: Mapping[str, str]) -> dict[str, str]:
    """The entries of `versions` that may change samples."""
    return {name: versions[name] for name in SHAPING if name in versions}


def versions() -> dict[str, str]:
    """Versions of this program, its parts, Python, and the libraries that affect samples."""
    installed = {
        "campaign": campaign.__version__,
        **own_versions(),
        "python": platform.python_version(),
    }
    for name in LIBRARIES:
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            continue
    return installed


def plug_ins(
    trials: Iterable[Trial], backend: str, truths: Iterable[Tree] = ()
) -> tuple[Tree, ...]:
    """Records of the plug-ins that trials and backend use, with the hash of their sources.

    Friction models and compensation methods are those of the trials' benches and of `truths`.
    """
    friction, compensation = friction_models(), compensation_methods()
    benches = bool(friction.plug_ins or compensation.plug_ins)
    named: set[tuple[str, str]] = set()
    experiment_names: set[str] = set()
    for trial in trials:
        experiment_names.add(trial.kind)
        if benches:
            named |= set(_words(trial.bench.get("friction")))
            named |= set(_words(trial.bench.get("compensation")))
    for plant in truths:
        named |= set(_words(plant.get("friction")))
    rooms: tuple[tuple[Kinds[Any], set[str]], ...] = (
        (experiments(), experiment_names),
        (friction, {word for key, word in named if key == "model"}),
        (compensation, {word for key, word in named if key == "method"}),
        (backends(), {backend}),
    )
    plug_ins_used = ((room, room.plug_in(name)) for room, names in rooms for name in sorted(names))
    return tuple(
        _record(room.room, plug_in) for room, plug_in in plug_ins_used if plug_in is not None
    )


def _words(tree: Any) -> Iterator[tuple[str, str]]:
    """(key, text) of every text field in nested tables."""
    for key, value in tree.items() if isinstance(tree, dict) else ():
        if isinstance(value, str):
            yield key, value
        else:
            yield from _words(value)


def _record(room: str, plug_in: PlugIn) -> Tree:
    return {
        "room": room,
        "name": plug_in.name,
        "distribution": plug_in.distribution,
        "version": plug_in.version,
        "entry_point": plug_in.entry_point,
        "sha256": digest(sources_of(plug_in.packages)),
    }


def host() -> dict[str, str]:
    """Name, system and processor of this machine."""
    return {
        "name": platform.node(),
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
    }


def command() -> tuple[str, ...]:
    """The command line, with the program by its bare name."""
    return (Path(sys.argv[0]).name, *sys.argv[1:])


def git_revision(file: Path) -> str:
    """Revision of the working tree that tracks `file`, with `-dirty` if it has changes.

    Empty if `file` is not tracked or git is missing.
    """
    folder = file.resolve().parent
    if not _git(folder, "ls-files", "--error-unmatch", "--", file.name):
        return ""
    return _git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")


def _git(folder: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(  # noqa: S603 - a list, never a shell
            ["git", "-C", str(folder), *arguments],  # noqa: S607 - the user's git
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
