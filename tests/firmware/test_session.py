"""Who holds the device in C: HELLO, HEARTBEAT, QUERY, BYE."""

import pytest

from campaign.wire import messages as wire
from campaign.wire.frames import encode_frame
from campaign.wire.messages import NakCode, State
from campaign.wire.statemachine import after_hello

from .console import Console
from .host import (
    CRC,
    OTHERS,
    OURS,
    SETS,
    TRIAL,
    asked,
    bring_to,
    following,
    heartbeat,
    hello,
    only,
    take,
)

SILENCE = 100_001  # microseconds: more than the timeout


def reached(state: State) -> bool:
    """Whether a device may stay in `state` with nobody to be heard."""
    return state not in (State.ARMED, State.RUNNING)


def test_hello_is_answered_by_capabilities_and_latch(console: Console) -> None:
    console.do("new", 16)
    found, latch = console.send(9, wire.Hello(1, 3, OURS, "host"))
    assert found == wire.Capabilities(
        9, 2, 2, 2, 7, State.IDLE, 0.1, 16, 1000, 1000.0, "console", "reference",
        ("rate", "torque"), ("observer",),
        (wire.Item("limits.angle", 1.0), wire.Item("limits.rate", 2.0)),
    )  # fmt: skip
    assert latch == wire.Latch(False, 0, wire.LatchCause.NONE, None)
    assert console.send(9, wire.Hello(1, 3, OURS, "host")) == [found, latch]  # heard once more


@pytest.mark.parametrize("versions", [(1, 1), (3, 9), (0, 0)])
def test_without_a_common_version_nothing_changes(
    console: Console, versions: tuple[int, int]
) -> None:
    console.do("new", 16)
    [found] = console.send(9, wire.Hello(*versions, OURS, "host"))
    assert (found.version, found.lowest, found.highest) == (0, 2, 2)
    assert asked(console)[2] == wire.Holder(False, None)
    # Neither for a host that might have been told that it is busy.
    bring_to(console, State.RUNNING)
    [found] = console.send(9, wire.Hello(*versions, OTHERS, "host"))
    assert found.version == 0


@pytest.mark.parametrize(
    "body",
    [
        b"\x02\x02" + bytes(4) + b"\x04host",  # nobody's session
        b"\x01\x01" + bytes(4) + b"\x04host",  # the version is not looked at before that
        b"\x02\x02\x2a\0\0\0\x05host",
        b"\x02\x02\x2a\0\0\0\x04host!",
        b"\x02\x02\x2a\0\0\0\x01\xff",
        b"\x02\x02\x2a\0\0",
        b"",
    ],
)
def test_a_malformed_hello_begins_nothing(console: Console, body: bytes) -> None:
    console.do("new", 16)
    [nak] = console.messages("receive", 0, encode_frame(wire.Kind.HELLO, 9, body).hex())
    assert (nak.sequence, nak.kind, nak.code) == (9, wire.Kind.HELLO, NakCode.MALFORMED)
    assert asked(console)[2] == wire.Holder(False, None)


@pytest.mark.parametrize("state", State)
def test_nobody_takes_the_device_from_a_host_that_is_heard(console: Console, state: State) -> None:
    bring_to(console, state)
    before = heartbeat(console)
    [nak] = console.send(70, hello(OTHERS, "eve@lab-4"))
    assert nak == wire.Nak(70, wire.Kind.HELLO, NakCode.BUSY, state, "", "it is held by ada@lab-3")
    assert after_hello(state, False, held=True) is NakCode.BUSY
    assert heartbeat(console) == before
    assert asked(console)[2].host == "ada@lab-3"
    # The holder's commands go on to be numbered as they were.
    [answer, *_] = console.send(following(state), SETS[0])
    allowed = state in (State.IDLE, State.CONFIGURED)
    assert isinstance(answer, wire.Ack) if allowed else answer.code is NakCode.WRONG_STATE


@pytest.mark.parametrize("state", [s for s in State if reached(s)])
@pytest.mark.parametrize("way", ["silence", "bye"])
def test_a_device_that_nobody_holds_is_free(console: Console, state: State, way: str) -> None:
    bring_to(console, state)
    if way == "silence":
        console.wait(SILENCE)
    else:
        assert console.send(0, wire.Bye(OURS)) == []
    assert not asked(console)[2].held
    answer = console.send(70, hello(OTHERS, "eve@lab-4"))
    [capabilities] = only(wire.Capabilities, answer)
    assert capabilities.version == 2
    assert capabilities.state is after_hello(state, False, held=False)
    # A change of state is told, as every one.
    told = [status.state for status in only(wire.Status, answer)]
    assert told == ([State.IDLE] if state is State.CONFIGURED else [])
    assert asked(console)[2] == wire.Holder(True, 0.0, "eve@lab-4")
    [nak] = console.send(71, hello(OURS))
    assert (nak.code, nak.text) == (NakCode.BUSY, "it is held by eve@lab-4")


def test_the_host_that_was_silent_in_motion_is_not_displaced_before_the_axis_is_off(
    console: Console,
) -> None:
    bring_to(console, State.RUNNING)
    console.now += SILENCE
    [nak, *further] = console.send(70, hello(OTHERS))
    assert nak.code is NakCode.BUSY
    assert only(wire.Status, further)[0].state is State.FAULT
    assert only(wire.Capabilities, console.send(71, hello(OTHERS)))


def test_a_nameless_host_can_be_told_of(console: Console) -> None:
    console.do("new", 16)
    console.send(1, hello(OURS, ""))
    [nak] = console.send(1, hello(OTHERS))
    assert nak.text == "it is held by a host that did not say its name"


@pytest.mark.parametrize("length", [119, 120, 121, 122, 123, 250])
def test_a_long_name_is_clipped_between_characters(console: Console, length: int) -> None:
    console.do("new", 16)
    name = "x" * (length % 2) + "µ" * (length // 2)
    console.send(1, hello(OURS, name))
    kept = asked(console)[2].host
    assert kept == name.encode()[:120].decode("utf-8", "ignore")
    [nak] = console.send(1, hello(OTHERS))
    assert nak.text == f"it is held by {kept}"
    console.send(1, wire.Safe(OTHERS, name))
    assert asked(console)[1].by == kept


def test_a_hello_counts_as_heard_when_it_begins_a_session_and_not_when_it_renews_one(
    console: Console,
) -> None:
    console.do("new", 16)
    console.now = 1_000_000
    console.send(1, hello())
    assert asked(console)[2] == wire.Holder(True, 0.0, "ada@lab-3")
    console.now += 60_000
    console.send(7, hello(host="ada@lab-5"))
    assert asked(console)[2] == wire.Holder(True, 0.06, "ada@lab-5")
    console.now += 40_000
    assert asked(console)[2].held
    console.now += 1
    assert not asked(console)[2].held
    console.send(8, hello())
    assert not asked(console)[2].held
    assert heartbeat(console).heartbeat_age == 0.0
    assert asked(console)[2].held


def test_a_session_can_arm_upon_its_hello_alone_and_not_after_silence(console: Console) -> None:
    console.do("new", 16)
    console.send(0, hello())
    console.send(1, SETS[0])
    console.now += SILENCE
    [nak] = console.send(2, wire.Arm(CRC))
    assert nak.code is NakCode.NO_HEARTBEAT
    console.send(3, hello())  # renewed: not heard
    [nak] = console.send(4, wire.Arm(CRC))
    assert nak.code is NakCode.NO_HEARTBEAT
    console.send(0, wire.Bye(OURS))
    console.send(5, hello(OTHERS))
    console.send(6, SETS[0])
    assert only(wire.Ack, console.send(7, wire.Arm(CRC)))


def test_a_foreign_heartbeat_is_answered_and_nothing_else(console: Console) -> None:
    bring_to(console, State.RUNNING)
    take(console, 0)
    console.now += 60_000
    [status] = console.send(0, wire.Heartbeat(99, TRIAL, 1, OTHERS))
    assert (status.state, status.heartbeat, status.heartbeat_age) == (State.RUNNING, 1, 0.06)
    assert (status.first_record, status.ring_used) == (0, 1)
    console.now += 40_001
    found = console.send(0, wire.Heartbeat(100, TRIAL, 1, OTHERS))
    assert only(wire.Status, found)[-1].state is State.FAULT  # nobody was heard
    assert only(wire.Status, found)[-1].fault is wire.Fault.HEARTBEAT


@pytest.mark.parametrize("session", [OURS, 0])
def test_before_any_hello_no_heartbeat_is_the_sessions(console: Console, session: int) -> None:
    console.do("new", 16)
    console.now = 50_000
    [status] = console.send(0, wire.Heartbeat(9, 0, 0, session))
    assert (status.heartbeat, status.heartbeat_age) == (0, 0.05)
    assert asked(console)[2] == wire.Holder(False, None)


def test_a_heartbeat_of_version_1_is_none(console: Console) -> None:
    bring_to(console, State.IDLE)
    frame = encode_frame(wire.Kind.HEARTBEAT, 0, b"\x09\0\0\0" + bytes(8))
    assert console.messages("receive", 0, frame.hex()) == []
    assert asked(console)[0].heartbeat == 1


def test_the_counter_begins_anew_with_another_session(console: Console) -> None:
    bring_to(console, State.IDLE)
    console.send(0, wire.Bye(OURS))
    console.send(1, hello(OTHERS))
    assert asked(console)[0].heartbeat == 0


@pytest.mark.parametrize("state", State)
def test_anybody_may_ask_and_changes_nothing(console: Console, state: State) -> None:
    bring_to(console, state)
    before = heartbeat(console)
    console.now += 10_000
    status, latch, holder = console.send(0, wire.Query())
    assert (status.state, status.heartbeat, status.heartbeat_age) == (state, 1, 0.01)
    assert latch == wire.Latch(False, 0, wire.LatchCause.NONE, None)
    assert holder == wire.Holder(True, 0.01, "ada@lab-3")
    console.now -= 10_000
    assert heartbeat(console) == before
    console.now += SILENCE  # it was no heartbeat
    assert console.send(0, wire.Query())[2].held is False


def test_a_question_with_a_body_is_none(console: Console) -> None:
    bring_to(console, State.IDLE)
    assert console.messages("receive", 0, encode_frame(wire.Kind.QUERY, 0, b"?").hex()) == []


@pytest.mark.parametrize("state", State)
def test_bye_of_the_session_lets_go_at_once(console: Console, state: State) -> None:
    bring_to(console, state)
    found = console.send(0, wire.Bye(OURS))
    if reached(state):
        assert found == []
    else:  # nobody is left to be heard
        assert only(wire.Status, found)[0].state is State.FAULT
        assert only(wire.Status, found)[0].fault is wire.Fault.HEARTBEAT
        assert not asked(console)[0].drive_on
    assert asked(console)[2] == wire.Holder(False, None, "ada@lab-3")
    console.send(80, hello())
    assert not asked(console)[2].held  # nor does a HELLO of that session change that
    assert heartbeat(console).heartbeat == 1  # it may think better of it
    assert asked(console)[2].held


@pytest.mark.parametrize("body", [b"\x2b\0\0\0", bytes(4), b"\x2a\0\0\0\0", b"\x2a\0\0", b""])
def test_anybody_elses_bye_and_a_malformed_one_are_nothing(console: Console, body: bytes) -> None:
    bring_to(console, State.RUNNING)
    assert console.messages("receive", 0, encode_frame(wire.Kind.BYE, 0, body).hex()) == []
    status, _, holder = asked(console)
    assert (status.state, holder.held) == (State.RUNNING, True)
