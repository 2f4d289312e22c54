"""Friction pictures of single contacts, outside any loop: one file each.

A specimen meets a prescribed motion. A bench cannot name it: the engine knows friction models only.
"""

from __future__ import annotations

from functools import cache

from campaign.physics.specimens.interface import Specimen
from campaign.plugins import Kinds


@cache
def specimens() -> Kinds[Specimen]:
    """Every specimen, by name."""
    return Kinds("friction specimen", __name__, "SPECIMEN", Specimen, tag="model")
