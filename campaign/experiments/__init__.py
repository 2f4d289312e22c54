"""Experiments: a file or folder each, with options, trials, analysis, tables and figures."""

from __future__ import annotations

from functools import cache

from campaign.experiments.interface import Experiment
from campaign.plugins import Kinds


@cache
def experiments() -> Kinds[Experiment]:
    """Every experiment, by name."""
    return Kinds("experiment", __name__, "EXPERIMENT", Experiment)
