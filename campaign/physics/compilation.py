"""numba compilation with a cache that detects changed callees.

numba's own cache compares only the file of a function. After an edit of a callee in another file,
the old machine code would still run. Here the name of the cache folder is a hash of every source
file that the function can call, so any edit causes a new compilation:

- for a function of `campaign.physics`, all of `campaign.physics`, which calls nothing outside;
- for any other, also the rest of this program, its own distribution, the folders and editable
  installs that it imports from (`campaign.source_hash`), and the list of installed libraries.

Without that information (a notebook's cell, a source edited since the process began) no code is
cached. Data files that a module reads during its import are not included.
"""

from __future__ import annotations

import hashlib
import os
import platform
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.registry import CPUDispatcher

from campaign.entry_points import packages_of
from campaign.source_hash import digest, sources_of

_CONFIG: Any = numba.config
_PHYSICS = Path(__file__).parent
_CHOSEN_BY_USER: str = _CONFIG.CACHE_DIR  # NUMBA_CACHE_DIR
_DECORATING = threading.RLock()
_IMPORTED_AT = time.time()
CLOCK_TICK = 0.02
"""s; a file's time can be earlier than its writing by this much: Linux counts in ticks."""
F = TypeVar("F", bound=Callable[..., Any])


@cache
def cache_folder(module: str) -> Path | None:
    """Cache folder for machine code of a module's functions; None: no cache.

    It is in the user's cache (in NUMBA_CACHE_DIR if that is set), or in a temporary folder if that
    is not writable, or if another user may have written to it (`distrust`).
    """
    try:
        name = _key(module)
    except OSError:  # a source that is missing or not readable
        name = None
    if name is None:
        return None
    folder = _user_cache() / name
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        trusted = not distrust(folder)
    except OSError:
        trusted = False
    if not trusted:
        folder = Path(tempfile.mkdtemp(prefix="campaign-compiled-"))
    return folder


@cache
def distrust(folder: Path) -> str:
    """Why another user may have written code to a folder, which would be executed; "" if none may.

    Group-writable files (umask 002) are accepted in a folder that others cannot enter. On Windows
    every cache is trusted.
    """
    if os.name != "posix":
        return ""
    loose = 0o022 if folder.stat().st_mode & 0o077 else 0o002
    inside = (
        Path(base, name) for base, folders, files in os.walk(folder) for name in (*folders, *files)
    )
    for path in (folder, folder.resolve(), *inside):
        with suppress(FileNotFoundError):  # another process writes to the folder
            about = path.lstat()
            if about.st_uid != os.geteuid():
                return f"{path} belongs to another user"
            if stat.S_ISLNK(about.st_mode):
                if path != folder:
                    return f"{path} is a link"
            elif about.st_mode & loose:
                return f"{path} can be written by other users"
    return ""


def distrusted() -> str:
    """Message if the engine's cache folder is not trusted and thus not used; "" else."""
    folder = _user_cache() / digest_of_sources(_PHYSICS)
    why = distrust(folder) if folder.is_dir() else ""
    return why and (
        f"the machine code kept in {folder} is not used: {why}; remove that folder, or let "
        "NUMBA_CACHE_DIR name one of your own"
    )


def is_kept_for_good(folder: Path) -> bool:
    """Whether a cache folder is that of the user, not a temporary one of this process."""
    return folder.parent == _user_cache()


def _user_cache() -> Path:
    import platformdirs

    if _CHOSEN_BY_USER:
        return Path(_CHOSEN_BY_USER) / "campaign"
    return platformdirs.user_cache_path("campaign") / "compiled"


def _key(module: str) -> str | None:
    """16 hexadecimal digits that change with any code that a module's functions can call."""
    physics = digest_of_sources(_PHYSICS)
    if f"{module}.".startswith("campaign.physics."):
        return physics
    own = sources_of(packages_of(module))
    if not own or _is_newer(own):
        return None
    parts = (physics, digest(sources_of(("campaign",))), digest(own), *_libraries())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def digest_of_sources(folder: Path) -> str:
    """16 hexadecimal digits that change with numba, Python, or any source file in `folder`."""
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for source in sorted(folder.rglob("*.py")):
        digest.update(source.relative_to(folder).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _is_newer(sources: Mapping[str, Path]) -> bool:
    """Whether a source was changed after this process may have imported it."""
    return any(path.stat().st_mtime > _IMPORTED_AT - CLOCK_TICK for path in sources.values())


def _libraries() -> list[str]:
    """Names, versions and times of all distributions on the module search path."""
    folders = (Path(folder) for folder in dict.fromkeys(sys.path) if folder)
    abouts = (about for folder in folders for about in folder.glob("*.dist-info"))
    return sorted(f"{about.name} {about.stat().st_mtime_ns}" for about in abouts)


class ByModule:
    """Cache locator of numba: by the module of a function, not by the path of its file.

    The folder has a hash of the sources, so that all copies of them share machine code: a new
    environment or another checkout does not compile again.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._folder = Path(_CONFIG.CACHE_DIR) / function.__module__
        self._file = Path(file)
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> ByModule | None:
        """Factory for numba; None for a function without a file."""
        return cls(function, file) if Path(file).is_file() else None

    def ensure_cache_path(self) -> None:
        """Create the folder. Raises OSError."""
        self._folder.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        """Path of the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Hash of the source file; numba ignores entries with another stamp."""
        return hashlib.sha256(self._file.read_bytes()).hexdigest()

    def get_disambiguator(self) -> str:
        """Line number, to distinguish functions with the same name."""
        return str(self._line)


@contextmanager
def _kept_in(folder: Path | None) -> Iterator[None]:
    """Set the cache folder during a decoration of numba; other packages keep their own."""
    own = {"CACHE_DIR": str(folder), "CACHE_LOCATOR_CLASSES": f"{__name__}.{ByModule.__name__}"}
    with _DECORATING:
        before = {name: getattr(_CONFIG, name, "") for name in own}
        for name, value in (own if folder is not None else before).items():
            setattr(_CONFIG, name, value)
        try:
            yield
        finally:
            for name, value in before.items():
                setattr(_CONFIG, name, value)


def compiled(function: F, **options: Any) -> F:
    """Decorator: compile at the first call, cache on disk, run without the GIL."""
    folder = cache_folder(function.__module__)
    with _kept_in(folder):
        compile_ = numba.njit(cache=folder is not None, nogil=True, error_model="numpy", **options)
        return cast(F, compile_(function))


def entry(function: F) -> F:
    """Decorator: as `compiled`, without reference counting, for code that creates no arrays.

    The engine's structures have dozens of arrays: counting doubled the compilation time.
    """
    return compiled(function, _nrt=False, no_cfunc_wrapper=True)


class _WithinCompiledCode(CPUDispatcher):  # type: ignore[misc]
    """Dispatcher without a Python wrapper; a call from Python would crash."""

    def __call__(self, *args: object, **options: object) -> None:
        raise TypeError(f"{self.__name__} is called by compiled code alone; see its py_func")


def inlined(function: F) -> F:
    """Decorator: a part of the engine's loop without the cost of a call; it creates no arrays.

    LLVM inlines it into its callers: it compiles in half the time of `pasted`.
    """
    options = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher = numba.njit(error_model="numpy", _nrt=False, **options)(function)
    dispatcher.__class__ = _WithinCompiledCode
    return cast(F, dispatcher)


def pasted(function: F) -> F:
    """Decorator: inlined into its caller as source, so that numbers of lanes are literals.

    Arrays of vectors then stay in registers.
    """
    return cast(F, numba.njit(inline="always", error_model="numpy")(function))


def called(function: F) -> F:
    """Decorator: a part of the engine that is compiled separately, if a call costs little.

    As with `entry`, it creates no arrays.
    """
    return cast(F, numba.njit(error_model="numpy", _nrt=False, no_cfunc_wrapper=True)(function))


def compiled_callback(signature: Any, function: Callable[..., Any], module: str) -> Any:
    """Compile `function`, which calls one of `module`, now; the result has an `address`.

    Each call determines the cache folder again, because the module can be edited and reloaded.
    """
    folder = cache_folder.__wrapped__(module)
    with _kept_in(folder):
        return numba.cfunc(signature, cache=folder is not None, error_model="numpy")(function)
