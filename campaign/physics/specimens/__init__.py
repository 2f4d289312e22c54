"""Friction models of single contacts, outside any loop: one file each.

A specimen has a prescribed motion. A bench cannot use it: the engine has friction models only.
"""

from __future__ import annotations

from functools import cache

from campaign.physics.specimens.interface import Specimen
from campaign.plugins import Kinds


@cache
def specimens() -> Kinds[Specimen]:
    """All specimens, by name."""
    return Kinds("friction specimen", __name__, "SPECIMEN", Specimen, tag="model")
