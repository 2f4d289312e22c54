"""The latch in C, sentence by sentence of docs/developers/serial-protocol.md."""

import pytest

from campaign.wire import messages as wire
from campaign.wire.frames import encode_frame
from campaign.wire.messages import LatchCause, NakCode, State

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

NOBODY = "an unnamed host"
STOPPED = LatchCause.STOPPED
WHERE_IT_CAN_BE_CLEARED = [s for s in State if s not in (State.ARMED, State.RUNNING)]
FOREIGN = [
    (wire.Safe(OTHERS, "eve"), "eve"),
    (wire.Safe(OTHERS), NOBODY),
    (wire.Safe(0, "eve"), "eve"),
    (wire.Safe(), NOBODY),
]


def latch_of(console: Console) -> wire.Latch:
    return asked(console)[1]


def remembered(lines: list) -> list[str]:
    return [line for line in lines if isinstance(line, str) and line.startswith("remember")]


def note(latched: bool, count: int, cause: LatchCause, by: str) -> str:
    return f"remember {int(latched)} {count} {int(cause)} {by.encode().hex() or '-'}"


def kinds(found: list) -> list[object]:
    """Hook calls as they are, messages by their type."""
    return [what if isinstance(what, str) else type(what) for what in found]


# The session's own


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("host", ["", "ada@lab-3"])
def test_the_holders_own_safe_ends_what_moves_and_no_more(
    console: Console, state: State, host: str
) -> None:
    bring_to(console, state)
    found = console.upon(9, wire.Safe(OURS, host))
    assert kinds(found)[:3] == ["drive off", wire.Ack, wire.Status]
    assert not only(wire.Latch, found)
    assert not remembered(console.log)
    assert latch_of(console) == wire.Latch(False, 0, LatchCause.NONE, None)
    if state is State.RUNNING:
        assert only(wire.End, found)[0].reason == "switched off by SAFE"


def test_a_session_remains_the_devices_after_its_silence_and_its_bye(console: Console) -> None:
    bring_to(console, State.RUNNING)
    console.wait(100_001)
    console.send(0, wire.Safe(OURS))
    console.send(0, wire.Bye(OURS))
    console.send(0, wire.Safe(OURS))
    assert not latch_of(console).latched


def test_where_there_is_no_session_every_safe_is_from_outside(console: Console) -> None:
    console.do("new", 16)
    assert only(wire.Latch, console.send(1, wire.Safe(OURS, "ada")))[0].count == 1


# Every other one


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize(("stop", "by"), FOREIGN)
def test_every_other_safe_latches_in_every_state(
    console: Console, state: State, stop: wire.Safe, by: str
) -> None:
    bring_to(console, state)
    found = console.upon(9, stop)
    # Off, then remembered, then acknowledged; what was running ends after that.
    assert kinds(found)[:5] == [
        "drive off", note(True, 1, STOPPED, by), wire.Ack, wire.Status, wire.Latch,
    ]  # fmt: skip
    _, _, ack, status, latch = found[:5]
    into = State.FAULT if state is State.FAULT else State.SAFE
    assert (ack.sequence, ack.kind, ack.state) == (9, wire.Kind.SAFE, into)
    assert (status.state, status.drive_on) == (into, False)
    assert latch == wire.Latch(True, 1, STOPPED, 0.0, by)
    ends = only(wire.End, found)
    assert [end.reason for end in ends] == ([f"panic stop by {by}"] if ends else [])
    assert bool(ends) == (state is State.RUNNING)


@pytest.mark.parametrize(
    "body",
    [bytes(4), b"\x2a", b"\x2a\0\0", b"\x2a\0\0\0\x04ad", b"\x2a\0\0\0\x01\xff", b"\x2a\0\0\0\0\0"],
)
def test_what_is_no_session_or_anything_else_is_nobodys(console: Console, body: bytes) -> None:
    """Even where the first four bytes are the session that holds the device."""
    bring_to(console, State.RUNNING)
    frame = encode_frame(wire.Kind.SAFE, 9, body).hex()
    [latch] = only(wire.Latch, console.messages("receive", 0, frame))
    assert latch == wire.Latch(True, 1, STOPPED, 0.0, NOBODY)


@pytest.mark.parametrize("body", [b"\x2a\0\0\0", b"\x2a\0\0\0\0", b"\x2a\0\0\0\x03ada"])
def test_with_or_without_its_name_the_holder_is_the_holder(console: Console, body: bytes) -> None:
    bring_to(console, State.RUNNING)
    console.messages("receive", 0, encode_frame(wire.Kind.SAFE, 9, body).hex())
    assert not latch_of(console).latched


def test_the_first_end_of_a_trial_is_the_one_that_is_told(console: Console) -> None:
    bring_to(console, State.RUNNING)
    console.do("rest", 0)
    console.send(following(State.RUNNING), wire.Stop())
    assert only(wire.Latch, console.send(0, wire.Safe()))
    console.do("rest", 1)
    [end] = only(wire.End, console.wait(1))
    assert end.reason == "stopped by the host"


# Counting


def test_one_sessions_safe_sent_again_is_one_stop_and_nobodys_counts_each_time(
    console: Console,
) -> None:
    bring_to(console, State.IDLE)
    counts = []
    for stop in (
        wire.Safe(43, "eve"), wire.Safe(43, "eve"), wire.Safe(43), wire.Safe(), wire.Safe(),
        wire.Safe(0, "eve"), wire.Safe(43, "eve"), wire.Safe(44, "mallory"), wire.Safe(43, "eve"),
        wire.Safe(43, "eve"),
    ):  # fmt: skip
        console.now += 10_000
        heartbeat(console)
        before = len(remembered(console.log))
        found = console.upon(0, stop)
        [latch] = only(wire.Latch, found)  # answered each time
        news = not counts or latch.count != counts[-1]
        assert len(remembered(console.log)) - before == news
        counts.append(latch.count)
    assert counts == [1, 1, 1, 2, 3, 4, 5, 6, 7, 7]
    latch = latch_of(console)
    assert (latch.by, latch.age) == ("eve", 0.01)  # since it was stopped, not since it was repeated


def test_the_same_session_stops_anew_once_it_was_cleared(console: Console) -> None:
    bring_to(console, State.IDLE)
    console.send(0, wire.Safe(OTHERS, "eve"))
    assert only(wire.Ack, console.send(1, wire.Unlatch(1, "ada")))
    assert only(wire.Latch, console.send(0, wire.Safe(OTHERS, "eve")))[0] == wire.Latch(
        True, 2, STOPPED, 0.0, "eve"
    )


def test_the_count_is_modulo_2_to_the_32(console: Console) -> None:
    console.do("new", 16, "latched", 2**32 - 1)
    assert latch_of(console).count == 2**32 - 1
    assert only(wire.Latch, console.send(0, wire.Safe()))[0].count == 0
    console.send(0, hello())
    console.send(1, wire.Unlatch(0, "ada"))
    assert not latch_of(console).latched


# While it is latched


@pytest.mark.parametrize("session", [OURS, OTHERS])
@pytest.mark.parametrize("crc", [CRC, 0])
def test_arm_is_refused_before_all_other_checks_but_the_state(
    console: Console, session: int, crc: int
) -> None:
    """Whoever it is: OTHERS has just stopped it and then come to hold it."""
    bring_to(console, State.IDLE)
    console.send(0, wire.Safe(OTHERS, "eve"))
    if session == OTHERS:
        console.send(0, wire.Bye(OURS))
        console.send(0, hello(OTHERS))
    [nak] = console.send(1, wire.Arm(crc))
    assert nak.code is NakCode.WRONG_STATE
    console.send(2, wire.Clear())
    console.send(3, SETS[0])
    console.now += 200_000  # nor is there a heartbeat
    [nak] = console.send(4, wire.Arm(crc))
    assert nak == wire.Nak(
        4, wire.Kind.ARM, NakCode.LATCHED, State.CONFIGURED, "", "stopped by eve"
    )
    assert console.send(4, wire.Arm(crc)) == [nak]
    [nak] = console.send(5, wire.Start(TRIAL))
    assert nak.code is NakCode.WRONG_STATE  # never armed: the latch is not even asked
    assert "drive on" not in console.log


def test_what_is_not_known_to_have_stopped_it_is_said_so(console: Console) -> None:
    bring_to(console, State.CONFIGURED, past="forgetful")
    [nak] = console.send(2, wire.Arm(CRC))
    assert (nak.code, nak.text) == (NakCode.LATCHED, "stopped by an unknown host")


def test_clear_hello_a_reset_and_the_end_of_the_session_leave_it_latched(console: Console) -> None:
    bring_to(console, State.RUNNING)
    console.send(0, wire.Safe(OTHERS, "eve"))
    stopped = wire.Latch(True, 1, STOPPED, 0.0, "eve")
    assert only(wire.Ack, console.send(4, wire.Clear()))[0].state is State.IDLE
    assert latch_of(console) == stopped
    for _ in range(2):
        capabilities, latch = console.send(5, hello())
        assert capabilities.state is State.IDLE
        assert latch == stopped
    console.send(0, wire.Bye(OURS))
    assert latch_of(console) == stopped
    assert console.send(6, hello(OTHERS, "eve"))[1] == stopped
    console.do("reset")
    assert latch_of(console) == wire.Latch(True, 1, STOPPED, None, "eve")
    assert console.send(7, hello())[1] == wire.Latch(True, 1, STOPPED, None, "eve")


def test_the_age_of_a_stop_is_counted_from_it(console: Console) -> None:
    bring_to(console, State.IDLE)
    console.send(0, wire.Safe())
    console.now += 2_500_000
    assert latch_of(console).age == 2.5


# UNLATCH


# A stop leads out of ENDED, and while it is latched no trial can end there.
@pytest.mark.parametrize("state", [s for s in WHERE_IT_CAN_BE_CLEARED if s is not State.ENDED])
def test_unlatch_clears_it_and_changes_no_state(console: Console, state: State) -> None:
    bring_to(console, state, past="latched 3")
    number = following(state)
    found = console.upon(number, wire.Unlatch(3, "ada"))
    # Remembered, then acknowledged.
    assert kinds(found) == [note(False, 3, LatchCause.NONE, "ada"), wire.Ack, wire.Latch]
    assert found[1] == wire.Ack(number, wire.Kind.UNLATCH, state, 7)
    assert found[2] == wire.Latch(False, 3, LatchCause.NONE, None, "ada")
    again = console.upon(number, wire.Unlatch(3, "ada"))
    assert again == found[1:]  # answered, not carried out
    console.do("reset")
    assert not latch_of(console).latched


def test_it_can_then_be_armed_and_started(console: Console) -> None:
    bring_to(console, State.CONFIGURED, past="latched 3")
    assert console.send(2, wire.Arm(CRC))[0].code is NakCode.LATCHED
    console.send(3, wire.Unlatch(3, "ada"))
    assert only(wire.Ack, console.send(4, wire.Arm(CRC)))
    assert only(wire.Ack, console.send(5, wire.Start(TRIAL)))
    assert console.log.count("drive on") == 1


@pytest.mark.parametrize("state", [State.ARMED, State.RUNNING])
def test_it_is_refused_where_something_may_move(console: Console, state: State) -> None:
    bring_to(console, state)
    [nak] = console.send(following(state), wire.Unlatch(0, "ada"))
    assert (nak.code, nak.state) == (NakCode.WRONG_STATE, state)


@pytest.mark.parametrize("count", [0, 2, 4, 2**32 - 1])
def test_another_count_clears_nothing(console: Console, count: int) -> None:
    bring_to(console, State.IDLE, past="latched 3")
    [nak] = console.upon(1, wire.Unlatch(count, "ada"))
    assert nak.code is NakCode.OTHER_STOP
    assert latch_of(console) == wire.Latch(True, 3, STOPPED, None, "ada")


@pytest.mark.parametrize("state", WHERE_IT_CAN_BE_CLEARED)
def test_nor_does_any_count_of_a_device_that_is_not_latched(console: Console, state: State) -> None:
    bring_to(console, state)
    [nak] = console.upon(following(state), wire.Unlatch(0, "ada"))
    assert (nak.code, nak.state) == (NakCode.OTHER_STOP, state)


def test_a_stop_that_came_since_stays(console: Console) -> None:
    bring_to(console, State.IDLE, past="latched 3")
    shown = latch_of(console).count
    console.send(0, wire.Safe(OTHERS, "eve"))
    [nak] = console.send(1, wire.Unlatch(shown, "ada"))
    assert nak.code is NakCode.OTHER_STOP
    assert latch_of(console).latched


def test_a_repeated_unlatch_tells_of_a_stop_that_came_since(console: Console) -> None:
    bring_to(console, State.IDLE, past="latched 3")
    console.send(1, wire.Unlatch(3, "ada"))
    console.send(0, wire.Safe(OTHERS, "eve"))
    [_, latch] = console.upon(1, wire.Unlatch(3, "ada"))
    assert latch == wire.Latch(True, 4, STOPPED, 0.0, "eve")


def test_it_is_numbered_as_any_other_command(console: Console) -> None:
    bring_to(console, State.IDLE, past="latched 3")
    [nak] = console.send(5, wire.Unlatch(3, "ada"))
    assert nak.code is NakCode.OUT_OF_ORDER
    console.do("new", 16, "latched", 3)
    [nak] = console.send(1, wire.Unlatch(3, "ada"))  # nor by anybody without a session
    assert nak.code is NakCode.OUT_OF_ORDER
    assert latch_of(console).latched


@pytest.mark.parametrize("body", [b"\x03\0\0\0", b"\x03\0\0\0\x03ad", b"\x03\0\0\0\x01\xff", b""])
def test_a_malformed_unlatch_clears_nothing(console: Console, body: bytes) -> None:
    bring_to(console, State.IDLE, past="latched 3")
    [nak] = console.messages("receive", 0, encode_frame(wire.Kind.UNLATCH, 1, body).hex())
    assert nak.code is NakCode.MALFORMED
    assert latch_of(console).latched


# Memory


def test_a_stop_that_cannot_be_remembered_holds_until_the_next_reset(console: Console) -> None:
    bring_to(console, State.RUNNING)
    console.do("memory", 0)
    found = console.upon(0, wire.Safe(OTHERS, "eve"))
    assert kinds(found)[:6] == [
        "drive off", note(True, 1, STOPPED, "eve"), "failed", wire.Ack, wire.Status, wire.Latch,
    ]  # fmt: skip
    assert latch_of(console).latched
    console.send(4, wire.Clear())
    console.send(5, SETS[0])
    assert console.send(6, wire.Arm(CRC))[0].code is NakCode.LATCHED


def test_what_could_not_be_remembered_is_tried_again_with_the_same_stop(console: Console) -> None:
    bring_to(console, State.IDLE)
    console.do("memory", 0)
    console.upon(0, wire.Safe(OTHERS, "eve"))
    console.do("memory", 1)
    remembered = note(True, 1, STOPPED, "eve")
    assert remembered in kinds(console.upon(0, wire.Safe(OTHERS, "eve")))
    assert remembered not in kinds(console.upon(0, wire.Safe(OTHERS, "eve")))  # once is enough


def test_an_unlatch_that_cannot_be_remembered_is_refused(console: Console) -> None:
    bring_to(console, State.IDLE, past="latched 3")
    console.do("memory", 0)
    found = console.upon(1, wire.Unlatch(3, "ada"))
    assert kinds(found) == [note(False, 3, LatchCause.NONE, "ada"), "failed", wire.Nak]
    assert (found[2].code, found[2].state) == (NakCode.NOT_READY, State.IDLE)
    assert latch_of(console) == wire.Latch(True, 3, STOPPED, None, "ada")
    console.do("memory", 1)
    assert console.send(1, wire.Unlatch(3, "ada")) == [found[2]]  # a repetition is not carried out
    assert only(wire.Ack, console.send(2, wire.Unlatch(3, "ada")))
    assert not latch_of(console).latched


def test_an_unlatch_that_was_refused_does_not_make_a_repeated_stop_another_one(
    console: Console,
) -> None:
    bring_to(console, State.IDLE)
    console.send(0, wire.Safe(OTHERS, "eve"))
    console.do("memory", 0)
    console.send(1, wire.Unlatch(1, "ada"))
    assert only(wire.Latch, console.send(0, wire.Safe(OTHERS, "eve")))[0].count == 1


def test_without_lasting_memory_it_starts_latched_by_every_reset(console: Console) -> None:
    console.do("new", 16, "forgetful")
    for boot in (7, 8, 9):
        assert asked(console)[0].boot == boot
        assert latch_of(console) == wire.Latch(True, boot, LatchCause.NO_MEMORY, None)
        console.send(0, hello())
        [nak] = console.send(1, wire.Unlatch(boot - 1, "ada"))  # of an earlier life
        assert nak.code is NakCode.OTHER_STOP
        assert only(wire.Ack, console.send(2, wire.Unlatch(boot, "ada")))
        assert not latch_of(console).latched
        console.do("reset")
    assert not remembered(console.log)


def test_a_memory_that_was_lost_is_none_and_one_again_once_it_is_written(console: Console) -> None:
    console.do("new", 16)
    console.do("wipe")
    assert latch_of(console) == wire.Latch(True, 8, LatchCause.NO_MEMORY, None)
    console.send(0, hello())
    console.send(1, wire.Unlatch(8, "ada"))
    console.do("reset")
    assert latch_of(console) == wire.Latch(False, 8, LatchCause.NONE, None)
    assert only(wire.Latch, console.send(0, wire.Safe()))[0].count == 9


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize(
    "loss", ["wipe", "cut 0", "cut 1", "cut 10", "fill 1 0", "fill 99 0", "fill 99 255"]
)
def test_a_memory_that_is_lost_after_a_stop_keeps_the_drive_off(
    console: Console, loss: str, state: State
) -> None:
    bring_to(console, state)
    console.send(0, wire.Safe(OTHERS, "eve"))
    before = len(console.log)
    console.do(*loss.split())
    latch = latch_of(console)
    assert (latch.latched, latch.cause) == (True, LatchCause.NO_MEMORY)
    console.send(0, hello())
    console.send(1, wire.Clear())
    console.send(2, SETS[0])
    [nak] = console.send(3, wire.Arm(CRC))
    assert nak.code is NakCode.LATCHED
    [nak] = console.send(4, wire.Unlatch(1, "ada"))  # the stop that was lost
    assert nak.code is NakCode.OTHER_STOP
    assert not asked(console)[0].drive_on
    assert "drive on" not in console.log[before:]
    assert only(wire.Ack, console.send(5, wire.Unlatch(latch.count, "ada")))
    assert not latch_of(console).latched


def test_no_beginning_of_a_memory_is_a_memory(console: Console) -> None:
    for length in range(11):  # octets of one that says no more than that there was no stop
        console.do("new", 16)
        console.do("cut", length)
        assert latch_of(console).latched, length
    console.do("new", 16)
    console.do("cut", 11)
    assert not latch_of(console).latched


def test_a_stop_of_a_device_that_knows_of_none_is_one_more(console: Console) -> None:
    console.do("new", 16, "forgetful")
    [latch] = only(wire.Latch, console.send(0, wire.Safe(OTHERS, "eve")))
    assert latch == wire.Latch(True, 8, STOPPED, 0.0, "eve")


def test_the_drive_is_off_before_anything_is_known_after_a_reset(console: Console) -> None:
    bring_to(console, State.RUNNING)
    take(console, 0)
    assert console.do("reset") == ["drive off"]


def test_a_program_of_version_1_stops_and_latches_and_is_answered(console: Console) -> None:
    """Its panic stop is an empty SAFE; it ignores the LATCH that follows."""
    bring_to(console, State.RUNNING)
    frame = bytes.fromhex("000301090105f683299600")
    found = console.messages("receive", 0, frame.hex())
    assert kinds(found)[:3] == [wire.Ack, wire.Status, wire.Latch]
    assert latch_of(console).latched
