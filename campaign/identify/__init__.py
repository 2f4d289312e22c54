"""Identifying a rig from archived runs: which trials a method takes, what it finds, where it goes.

Estimators are in `campaign.estimation`, as functions on arrays; a method feeds them from trials
and says what their numbers are of the rig.
"""

from __future__ import annotations

from functools import cache

# Before the function of the same name: imported later, the folder would take its place.
import campaign.identify.methods  # noqa: F401
from campaign.experiments.interface import Model
from campaign.plugins import Kinds


@cache
def methods() -> Kinds[Model]:
    """Every method of identification, by name."""
    return Kinds("identification method", f"{__name__}.methods", "METHOD", Model)
