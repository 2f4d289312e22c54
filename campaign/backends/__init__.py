"""Backends execute trials: `sim`, and whatever else is a file here or an installed plug-in."""

from __future__ import annotations

from functools import cache

from campaign.backends.interface import BackendKind
from campaign.plugins import discover


@cache
def backends() -> dict[str, BackendKind]:
    """Every backend, by name."""
    return discover(__name__, "BACKEND", "campaign.backends")
