"""TOML to Protocol to Plan: `load_protocol`, `make_plan`, `check_limits`, `check_loops`."""

from __future__ import annotations

from campaign.protocol.limit_check import check_limits, check_loops, low_margins
from campaign.protocol.load import load_protocol
from campaign.protocol.plan import LimitUse, Plan, PlannedTest, make_plan
from campaign.protocol.plan_tree import as_tree
from campaign.protocol.schema import ExperimentKind, Protocol, ProtocolFile, TestEntry
from campaign.protocol.stages import PlannedStage

__all__ = [
    "ExperimentKind",
    "LimitUse",
    "Plan",
    "PlannedStage",
    "PlannedTest",
    "Protocol",
    "ProtocolFile",
    "TestEntry",
    "as_tree",
    "check_limits",
    "check_loops",
    "load_protocol",
    "low_margins",
    "make_plan",
]
