"""numba, with a cache that notices a changed callee.

numba's own cache compares only the file a function stands in: edit a function that it calls in
another file, and the old machine code goes on giving the old numbers. Here the cache folder's name
is a hash of every source file of `campaign.physics`, so any edit starts afresh.
"""

from __future__ import annotations

import hashlib
import platform
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

_CONFIG: Any = numba.config
F = TypeVar("F", bound=Callable[..., Any])


@cache
def cache_folder() -> Path:
    """Where compiled functions are kept: the user's cache, or a temporary folder if it is shut."""
    import platformdirs

    name = digest_of_sources(Path(__file__).parent)
    folder = platformdirs.user_cache_path("campaign") / "compiled" / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="campaign-compiled-"))
    return folder


def digest_of_sources(folder: Path) -> str:
    """16 hexadecimal digits that change with numba, Python, or any source file in `folder`."""
    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for source in sorted(folder.rglob("*.py")):
        digest.update(source.relative_to(folder).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


@contextmanager
def _cached_here() -> Iterator[None]:
    """Numba chooses the cache folder when it decorates; other packages keep their own."""
    before = _CONFIG.CACHE_DIR
    _CONFIG.CACHE_DIR = before or str(cache_folder())
    try:
        yield
    finally:
        _CONFIG.CACHE_DIR = before


def compiled(function: F) -> F:
    """Decorator: compile at the first call, keep on disk, release the GIL while running."""
    with _cached_here():
        return cast(F, numba.njit(cache=True, nogil=True)(function))


def inlined(function: F) -> F:
    """Decorator: a part of the engine's loop, pasted into its caller so that it costs no call."""
    return cast(F, numba.njit(inline="always")(function))


def compiled_callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile `function` now, with a C signature; the result has an `address`."""
    with _cached_here():
        return numba.cfunc(signature, cache=True)(function)
