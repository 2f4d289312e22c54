"""What is wrong with a recording: pure functions on arrays.

Nothing is repaired because it was found: what a mapping asks for is done where channels are made of
columns (`importing.made`), times a clock (`even_clock`) and samples read.
"""

from campaign.importing.defects.defect import Defect
from campaign.importing.defects.find_defects import find

__all__ = ["CHANNEL_KINDS", "Defect", "find"]

CHANNEL_KINDS = (
    *("absurd", "clipping", "delay", "dropout", "factor", "filled", "held"),
    *("lost", "sign", "spike", "twice", "unrelated", "wraparound"),
)
"""Kinds of what is found in channels; those of time are not among them."""
