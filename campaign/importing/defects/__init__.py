"""Defects of a recording: pure functions on arrays.

They only detect. Repairs that a mapping requests happen where channels are made of columns
(`importing.derived_channels`), times become a clock (`even_clock`), and samples are read.
"""

from campaign.importing.defects.defect import Defect
from campaign.importing.defects.find_defects import find

__all__ = ["CHANNEL_KINDS", "Defect", "find"]

CHANNEL_KINDS = (
    *("absurd", "clipping", "delay", "dropout", "factor", "filled", "held"),
    *("lost", "sign", "spike", "twice", "unrelated", "wraparound"),
)
"""Kinds of defects in channels, without those of time."""
