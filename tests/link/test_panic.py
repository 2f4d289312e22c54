"""What a latch tells of who stopped the bench."""

from __future__ import annotations

import pytest

from campaign.link.panic import FORGETFUL, NOBODY, panic_stop_of, printable
from campaign.recording import PanicStop
from campaign.wire.codes import LatchCause
from campaign.wire.messages import Latch


def test_what_is_not_latched_was_not_stopped() -> None:
    assert panic_stop_of(Latch(False, 3, LatchCause.NONE, 1.5, "eve")) is None


@pytest.mark.parametrize(
    ("cause", "by", "who"),
    [
        (LatchCause.STOPPED, "eve", "eve"),
        (LatchCause.STOPPED, "", NOBODY),
        (LatchCause.NO_MEMORY, "", FORGETFUL),
        (LatchCause.NO_MEMORY, "eve", "eve"),
        (LatchCause.STOPPED, "e\x1b[2Jve\n", "e?[2Jve?"),
    ],
)
def test_a_stop_has_its_count_its_age_and_somebody(cause: LatchCause, by: str, who: str) -> None:
    assert panic_stop_of(Latch(True, 3, cause, 1.5, by)) == PanicStop(3, who, 1.5)
    assert panic_stop_of(Latch(True, 3, cause, None, by)) == PanicStop(3, who, None)


def test_what_came_over_a_line_moves_no_cursor_and_keeps_its_letters() -> None:
    assert printable("Zoë 3 \x07\u202e°") == "Zoë 3 ??°"
