"""What is wrong with a recording, and what can be done about it: pure functions on arrays.

Finding and repairing are apart: nothing is repaired because it was found.
"""

from campaign.importing.defects.defect import Defect, Severity
from campaign.importing.defects.finding import find

__all__ = ["CHANNEL_KINDS", "Defect", "Severity", "find"]

CHANNEL_KINDS = (
    "absurd",
    "clipping",
    "constant",
    "delay",
    "dropout",
    "factor",
    "filled",
    "held",
    "lost",
    "quantisation",
    "sign",
    "spike",
    "twice",
    "unrelated",
    "wraparound",
)
"""Kinds of what is found in channels; those of time are not among them."""
