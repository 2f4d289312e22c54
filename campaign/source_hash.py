"""One hash of a package's source files.

An archive keeps it beside a plug-in's version, and compiled machine code is stored under it. A
version states the intended release, the hash the actual source.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

_SOURCES = (".py", *EXTENSION_SUFFIXES)
_INSTALLED = {"site-packages", "dist-packages"}
_PROGRAM = __name__.partition(".")[0]


def sources_of(packages: Iterable[str]) -> dict[str, Path]:
    """Python files and extension modules of top-level `packages` and of their imports.

    Imports are followed into folders on the path and editable installs, which change by edits; not
    into this program, the standard library, or installed libraries. Nothing is imported. Keys are
    relative to the folder on the path; an unknown package has no files.
    """
    chosen = tuple(packages)
    waiting = list(chosen)
    files_by_key: dict[str, Path] = {}
    done: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in done:
            continue
        done.add(name)
        places = _places(name)
        if name not in chosen and any(_INSTALLED.intersection(place.parts) for place in places):
            continue
        files = {key: path for place in places for key, path in _files(name, place)}
        files_by_key |= files
        if name != _PROGRAM:
            waiting += (each for path in files.values() for each in _imported(path))
    return dict(sorted(files_by_key.items()))


def digest(sources: Mapping[str, Path]) -> str:
    """SHA-256 of names and contents, hexadecimal. Raises OSError."""
    whole = hashlib.sha256()
    for name, path in sorted(sources.items()):
        content = path.read_bytes()
        whole.update(f"{name}\0{len(content)}\0".encode())
        whole.update(content)
    return whole.hexdigest()


def _places(name: str) -> tuple[Path, ...]:
    """Folders of a top-level package, or the file of a module; empty if not found."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):  # ValueError: __main__
        return ()
    if spec is None:
        return ()
    if spec.submodule_search_locations is not None:
        return tuple(map(Path, spec.submodule_search_locations))
    return (Path(spec.origin),) if spec.origin is not None else ()


def _files(name: str, place: Path) -> Iterator[tuple[str, Path]]:
    """Keys and paths of the source files at one location of a package."""
    if place.is_file():
        yield place.name, place
    for path in place.rglob("*"):
        if path.name.endswith(_SOURCES) and path.is_file():
            yield f"{name}/{path.relative_to(place).as_posix()}", path


def _imported(path: Path) -> tuple[str, ...]:
    """Top-level names that a file imports, without the standard library and this program."""
    try:
        return _imported_names(path.read_bytes()) if path.suffix == ".py" else ()
    except (OSError, SyntaxError, ValueError, RecursionError):
        return ()  # a file that cannot be imported


@cache
def _imported_names(source: bytes) -> tuple[str, ...]:
    """Imported names, parsed once per content: a package of 500 files takes 2 s."""
    names: list[str] = []
    waiting: list[ast.AST] = [ast.parse(source)]
    while waiting:  # only statements: an import is never part of an expression
        node = waiting.pop()
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.append(node.module)
        for block in ("body", "orelse", "handlers", "finalbody", "cases"):
            waiting += getattr(node, block, ())
    tops = dict.fromkeys(name.partition(".")[0] for name in names)
    return tuple(top for top in tops if top != _PROGRAM and top not in sys.stdlib_module_names)
