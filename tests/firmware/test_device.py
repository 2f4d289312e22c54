"""The device in C: what it answers, state by state, and what it keeps."""

import pytest

from campaign.wire import messages as wire
from campaign.wire.frames import encode_frame
from campaign.wire.messages import State
from campaign.wire.statemachine import after

from .console import Console
from .host import CRC, OURS, SETS, TRIAL, bring_to, following, heartbeat, only, take


def test_parameters_arrive_as_they_were_sent(console: Console) -> None:
    bring_to(console, State.IDLE)
    kind, body = wire.encode(SETS[0])
    lines = console.do("receive", 0, encode_frame(kind, 1, body).hex())
    received = [line.split()[1:] for line in lines if line.startswith("set ")]
    assert received == [
        ["task.mode", "4", b"rate".hex()],
        ["task.duration", "1", "1.5"],
        ["rehearsal.seed", "2", str(2**64 - 3)],
        ["task.values", "5", "3", "0", "0.5", "-1e-300", "3"],
        ["task.hold", "3", "1"],
    ]


def test_a_set_with_one_refused_item_sets_none(console: Console) -> None:
    bring_to(console, State.IDLE)
    message = wire.Set((wire.Item("task.duration", 1.0), wire.Item("unknown.name", 1.0)))
    kind, body = wire.encode(message)
    lines = console.do("receive", 0, encode_frame(kind, 1, body).hex())
    assert not [line for line in lines if line.startswith("set ")]
    [nak] = console.send(1, message)  # repeated: the same answer
    assert nak == wire.Nak(
        1, 2, wire.NakCode.UNKNOWN_NAME, State.IDLE, "unknown.name", "no such parameter"
    )


@pytest.mark.parametrize("state", State)
def test_safe_switches_off_in_every_state(console: Console, state: State) -> None:
    bring_to(console, state)
    answer = console.send(999, wire.Safe(OURS))
    [ack] = only(wire.Ack, answer)
    expected = State.FAULT if state is State.FAULT else State.SAFE
    assert (ack.sequence, ack.kind, ack.state) == (999, wire.Kind.SAFE, expected)
    status = only(wire.Status, answer)[-1]
    assert (status.drive_on, status.at_rest, status.state) == (False, True, expected)
    ends = only(wire.End, answer)
    assert bool(ends) == (state is State.RUNNING)
    if ends:
        assert (ends[0].outcome, ends[0].safe) == (wire.Outcome.INTERRUPTED, True)


def test_safe_needs_no_session(console: Console) -> None:
    console.do("new", 16)
    assert only(wire.Ack, console.send(5, wire.Safe()))[0].state is State.SAFE


def test_silence_of_the_host_stops_the_axis(console: Console) -> None:
    bring_to(console, State.RUNNING)
    assert only(wire.End, console.wait(100_000)) == []
    found = console.wait(1)
    [end] = only(wire.End, found)
    assert (end.outcome, end.fault, end.safe) == (wire.Outcome.FAULT, wire.Fault.HEARTBEAT, True)
    status = only(wire.Status, found)[0]
    assert (status.state, status.fault) == (State.FAULT, wire.Fault.HEARTBEAT)
    assert not status.drive_on


def test_heartbeats_keep_it_running_and_other_messages_do_not(console: Console) -> None:
    bring_to(console, State.RUNNING)
    for counter in range(20):
        console.wait(90_000)
        assert heartbeat(console, counter).state is State.RUNNING
    for _ in range(4):
        console.now += 30_000
        console.send(0, wire.Resend(TRIAL, 0, 1))
    assert heartbeat(console).state is State.FAULT


def test_an_axis_that_does_not_come_to_rest_is_not_called_safe(console: Console) -> None:
    bring_to(console, State.RUNNING)
    console.do("rest", 0)
    found = console.send(4, wire.Stop())
    assert only(wire.End, found) == []
    for counter in range(40):
        console.now += 50_000
        found = console.send(0, wire.Heartbeat(counter, TRIAL, 0, OURS))
        if only(wire.End, found):
            break
    [end] = only(wire.End, found)
    assert (console.now, end.safe) == (2_000_000, False)
    assert not only(wire.Status, found)[-1].drive_on


def test_a_trial_waits_for_rest_before_it_can_be_cleared(console: Console) -> None:
    bring_to(console, State.RUNNING)
    console.do("rest", 0)
    console.send(0, wire.Safe(OURS))
    [nak] = console.send(4, wire.Clear())
    assert nak.code is wire.NakCode.NOT_READY
    console.do("rest", 1)
    assert only(wire.End, console.wait(1))[0].safe
    assert only(wire.Ack, console.send(5, wire.Clear()))[0].state is State.IDLE


def test_records_are_kept_until_released_and_sent_again(console: Console) -> None:
    bring_to(console, State.RUNNING)
    live = [record for n in range(4) for record in take(console, 2 * n)]
    live += console.messages("event", 0.004, b"an event".hex())
    live += only(wire.End, console.messages("finish", 0, 0, "-"))
    assert [record.number for record in live] == [0, 1, 2, 3, 4, 5]
    assert live[4] == wire.Event(TRIAL, 4, 0.004, "an event")
    assert live[5] == wire.End(TRIAL, 5, wire.Outcome.COMPLETED, wire.Fault.NONE, 8, True)
    assert console.send(0, wire.Resend(TRIAL, 1, 3)) == live[1:4]
    assert console.send(0, wire.Resend(TRIAL, 4, 99)) == live[4:]
    status = heartbeat(console, following=3)
    assert (status.first_record, status.next_record, status.ring_used) == (3, 6, 3)
    answer = console.send(0, wire.Resend(TRIAL, 1, 3))
    assert answer == [wire.LostRecords(TRIAL, 1, 2), live[3]]
    assert console.send(4, wire.Release(TRIAL))[0].state is State.IDLE
    assert console.send(0, wire.Resend(TRIAL, 3, 2)) == [wire.LostRecords(TRIAL, 3, 2)]


def test_what_a_full_ring_dropped_is_said_to_be_lost(console: Console) -> None:
    bring_to(console, State.RUNNING, records=4)
    live = [record for n in range(10) for record in take(console, 2 * n)]
    assert [record.number for record in live] == list(range(10))
    assert heartbeat(console).first_record == 6
    answer = console.send(0, wire.Resend(TRIAL, 2, 6))
    assert answer == [wire.LostRecords(TRIAL, 2, 4), live[6], live[7]]
    assert console.send(0, wire.Resend(TRIAL, 0, 6)) == [wire.LostRecords(TRIAL, 0, 6)]


def test_a_heartbeat_frees_nothing_of_the_future_or_of_another_trial(console: Console) -> None:
    bring_to(console, State.RUNNING)
    take(console, 0)
    assert heartbeat(console, following=2).ring_used == 1
    console.send(0, wire.Heartbeat(2, TRIAL + 1, 1, OURS))
    assert heartbeat(console).ring_used == 1


def test_a_repeated_command_is_answered_and_not_carried_out(console: Console) -> None:
    bring_to(console, State.CONFIGURED)
    again = console.send(1, SETS[0])
    assert [type(message) for message in again] == [wire.Ack]
    first = console.send(2, wire.Arm(CRC))  # would be refused had SET been carried out twice
    assert only(wire.Ack, first)[0].state is State.ARMED
    [channels] = only(wire.Channels, first)
    assert [channel.format for channel in channels.channels] == [wire.Format.F64, wire.Format.I16]
    repeated = console.send(2, wire.Arm(CRC))
    assert repeated == [*only(wire.Ack, first), channels]
    console.send(3, wire.Start(TRIAL))
    take(console, 0)
    [ack] = console.send(3, wire.Start(TRIAL))
    assert ack.state is State.RUNNING
    assert heartbeat(console).next_record == 1


@pytest.mark.parametrize("body", [b"", b"\x01", b"\x01\x02a.\x03\x01", b"\x01\x01a\x03\x02"])
def test_a_malformed_command_is_refused_and_changes_nothing(console: Console, body: bytes) -> None:
    bring_to(console, State.IDLE)
    [nak] = console.messages("receive", 0, encode_frame(wire.Kind.SET, 1, body).hex())
    assert (nak.code, nak.state) == (wire.NakCode.MALFORMED, State.IDLE)
    assert only(wire.Ack, console.send(2, SETS[0]))


def test_an_unknown_command_is_refused(console: Console) -> None:
    bring_to(console, State.IDLE)
    [nak] = console.messages("receive", 0, encode_frame(0x3F, 1, b"").hex())
    assert nak.code is wire.NakCode.UNKNOWN_MESSAGE
    assert console.messages("receive", 0, encode_frame(0xBF, 1, b"").hex()) == []


@pytest.mark.parametrize("state", State)
def test_the_device_refuses_what_the_table_refuses(console: Console, state: State) -> None:
    """One command each in each state, from a fresh device: the reply is the table's."""
    commands = [SETS[0], wire.Arm(CRC), wire.Start(TRIAL), wire.Stop(), wire.Clear()]
    for command in [*commands, wire.Release(TRIAL)]:
        bring_to(console, state)
        kind = wire.encode(command)[0]
        answer = console.send(following(state), command)[0]
        expected = after(state, kind)
        result = answer.state if isinstance(answer, wire.Ack) else answer.code
        assert result is expected, (state, kind)
