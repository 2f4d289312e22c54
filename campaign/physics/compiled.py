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
from typing import Any, TypeVar

import numba
from numba import config

F = TypeVar("F", bound=Callable[..., Any])


@cache
def cache_folder() -> Path:
    """Where compiled functions are kept: the user's cache, or a temporary folder if that is shut."""
    import platformdirs

    digest = hashlib.sha256(f"{numba.__version__} {platform.python_version()}".encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    folder = platformdirs.user_cache_path("campaign") / "compiled" / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="campaign-compiled-"))
    return folder


@contextmanager
def _cached_here() -> Iterator[None]:
    """numba chooses the cache folder when it decorates; other packages keep their own."""
    before = config.CACHE_DIR
    config.CACHE_DIR = before or str(cache_folder())
    try:
        yield
    finally:
        config.CACHE_DIR = before


def compiled(function: F) -> F:
    """Decorator: compile at the first call, keep on disk, release the GIL while running."""
    with _cached_here():
        return numba.njit(cache=True, nogil=True)(function)  # type: ignore[no-any-return]


def compiled_callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Compile `function` now, with a C signature; the result has an `address`."""
    with _cached_here():
        return numba.cfunc(signature, cache=True)(function)
