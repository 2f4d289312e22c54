"""Backends execute trials: `sim`, and whatever else is a file here or an installed plug-in."""

from __future__ import annotations

from functools import cache

from campaign.backends.interface import BackendKind
from campaign.plugins import Kinds


@cache
def backends() -> Kinds[BackendKind]:
    """Every backend, by name."""
    return Kinds("backend", __name__, "BACKEND", BackendKind)
