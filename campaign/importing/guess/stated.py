"""Units as files write them, in the spelling of the program's grammar."""

from __future__ import annotations

from campaign.importing.cells import UNIT_WORDS
from campaign.unit_grammar import parse_unit


def stated_unit(text: str) -> tuple[str, str]:
    """The unit as written, and as the grammar has it: "" where it is none."""
    written = text.strip()
    if not written:
        return "", ""
    spelled = UNIT_WORDS.get(written.lower(), written)
    try:
        parse_unit(spelled)
    except ValueError:
        return written, ""
    return written, spelled
