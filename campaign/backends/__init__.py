"""Backends, which execute trials: one file each in this folder, or an installed plug-in."""

from __future__ import annotations

from functools import cache

from campaign.backends.interface import BackendKind
from campaign.plugins import Kinds


@cache
def backends() -> Kinds[BackendKind]:
    """All backends by name."""
    return Kinds("backend", __name__, "BACKEND", BackendKind)
