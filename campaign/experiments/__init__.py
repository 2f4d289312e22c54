"""Experiments: one file each, with options, trials, analysis, tables and figures."""

from __future__ import annotations

from functools import cache

from campaign.experiments.interface import Experiment
from campaign.plugins import discover


@cache
def experiments() -> dict[str, Experiment]:
    """Every experiment, by name."""
    return discover(__name__, "EXPERIMENT", "campaign.experiments")
