"""Finding kinds: every module of a package, and every installed entry point of a group.

A new experiment, friction model, compensation method or backend is one file in its room, or one
installed package that names itself under an entry point group such as `campaign.experiments`.
"""

from __future__ import annotations

import importlib
import pkgutil
from importlib.metadata import entry_points
from typing import Any

from campaign.errors import UsageError


def discover(package: str, attribute: str, group: str) -> dict[str, Any]:
    """Objects named `attribute` in the modules of `package`, then entry points of `group`, by name.

    Names are sorted, so that what depends on the order (help, errors, archives) is reproducible.
    Raises UsageError when two objects share a name.
    """
    found: dict[str, Any] = {}
    path = importlib.import_module(package).__path__
    candidates = []
    for module_info in pkgutil.iter_modules(path):
        module = importlib.import_module(f"{package}.{module_info.name}")
        if hasattr(module, attribute):
            candidates.append(getattr(module, attribute))
    candidates += [entry.load() for entry in entry_points(group=group)]
    for candidate in candidates:
        if candidate.name in found:
            raise UsageError(f"two {group} are called {candidate.name!r}; remove one of them")
        found[candidate.name] = candidate
    return dict(sorted(found.items()))
