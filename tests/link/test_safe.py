"""When a device counts as safe."""

from __future__ import annotations

import pytest

from campaign.link.safe import SafeWatch, is_safe
from campaign.wire.codes import Fault, Kind, LatchCause, State
from campaign.wire.frames import encode_frame
from campaign.wire.messages import Ack, Latch, Message, Status, encode

HEARD = Ack(0, Kind.SAFE, State.SAFE, 1)
"""It has heard our SAFE: what it said before counts for nothing."""


def status(state: State = State.SAFE, *, at_rest: bool = True, drive_on: bool = False) -> Status:
    return Status(state, Fault.NONE, at_rest, drive_on, 1, 0.0, 0, 0.0, 0, 0, 0, 0)


def wired(*messages: Message) -> bytes:
    return b"".join(encode_frame(kind, 0, body) for kind, body in map(encode, messages))


@pytest.mark.parametrize("state", State)
def test_safe_is_switched_off_at_rest_with_the_drive_off_and_nothing_else(state: State) -> None:
    off = state in (State.SAFE, State.FAULT)
    assert is_safe(status(state)) is off
    assert not is_safe(status(state, at_rest=False))
    assert not is_safe(status(state, drive_on=True))


def test_a_watch_waits_for_the_status_that_confirms_and_keeps_what_is_newest() -> None:
    watch = SafeWatch()
    assert (watch.last, watch.latch, watch.confirmed.is_set()) == (None, None, False)
    moving = status(at_rest=False)
    watch.feed(wired(HEARD, status(State.RUNNING), moving))
    assert watch.last == moving
    assert not watch.confirmed.is_set()
    watch.feed(wired(status()))
    assert watch.last == status()
    assert watch.confirmed.is_set()
    first, second = (Latch(True, n, LatchCause.STOPPED, 1.0, "eve") for n in (1, 2))
    watch.feed(wired(first, second))
    assert watch.latch == second


def test_only_the_answer_to_our_own_safe_acknowledges_it_and_later_ones_change_nothing() -> None:
    watch = SafeWatch(sequence=99)
    others = (Ack(98, Kind.SAFE, State.SAFE, 1), Ack(99, Kind.STOP, State.ENDED, 1))
    for other in others:
        watch.feed(wired(other))
        assert not watch.acknowledged
    watch.feed(wired(Ack(99, Kind.SAFE, State.SAFE, 1)))
    assert watch.acknowledged is True
    watch.feed(wired(*others))
    assert watch.acknowledged is True


def test_the_first_sequence_number_is_zero_unless_it_is_said() -> None:
    watch = SafeWatch()
    watch.feed(wired(Ack(0, Kind.SAFE, State.SAFE, 1)))
    assert watch.acknowledged


def test_rubbish_between_and_within_frames_hides_no_confirmation() -> None:
    told: list[Message] = []
    watch = SafeWatch(told=told.append)
    damaged = encode_frame(Kind.STATUS, 0, b"too short")
    data = b"noise" + damaged + encode_frame(0x7F, 0, b"") + wired(HEARD, status())
    for begin in range(0, len(data), 3):  # however the line cuts it
        watch.feed(data[begin : begin + 3])
    assert watch.confirmed.is_set()
    assert told == [HEARD, status()]
