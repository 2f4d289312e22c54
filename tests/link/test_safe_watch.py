"""When a bench counts as safe: by what it says after it heard our SAFE, and by its newest word."""

from __future__ import annotations

from campaign.link.safe import SafeWatch
from campaign.wire.frames import encode_frame
from campaign.wire.messages import (
    Ack,
    Fault,
    Kind,
    Latch,
    LatchCause,
    Message,
    State,
    Status,
    encode,
)

OURS = 77


def framed(*messages: Message) -> bytes:
    out = b""
    for message in messages:
        kind, body = encode(message)
        out += encode_frame(kind, 0, body)
    return out


def status(state: State, *, rest: bool, drive: bool = False) -> Status:
    return Status(state, Fault.NONE, rest, drive, 1, 0.0, 0, 0.0, 0, 0, 0, 0)


AT_REST = status(State.SAFE, rest=True)
RUNNING = status(State.RUNNING, rest=False, drive=True)
COASTING = status(State.SAFE, rest=False)
HEARD = Ack(OURS, Kind.SAFE, State.SAFE, 1)
LATCHED = Latch(True, 1, LatchCause.STOPPED, 0.0, "ada")


def test_what_was_said_before_it_heard_us_counts_for_nothing() -> None:
    watch = SafeWatch(OURS)
    watch.feed(framed(AT_REST, LATCHED))  # of an earlier stop, perhaps cleared since
    assert not watch.confirmed.is_set()
    watch.feed(framed(RUNNING, HEARD, COASTING))
    assert not watch.confirmed.is_set()
    assert watch.latch is None
    watch.feed(framed(LATCHED, AT_REST))
    assert watch.confirmed.is_set()
    assert watch.latch == LATCHED


def test_its_newest_word_counts() -> None:
    watch = SafeWatch(OURS)
    watch.feed(framed(HEARD, AT_REST, RUNNING))
    assert not watch.confirmed.is_set()


def test_an_answer_to_somebody_elses_stop_is_none_to_ours() -> None:
    watch = SafeWatch(OURS)
    watch.feed(framed(Ack(OURS + 1, Kind.SAFE, State.SAFE, 1), AT_REST))
    assert not watch.confirmed.is_set()
