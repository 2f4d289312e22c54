"""The table of states and commands, and the numbering of commands."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from campaign.wire.codes import COMMANDS, Kind, NakCode, Outcome, State
from campaign.wire.statemachine import (
    SequenceNumbers,
    Turn,
    after,
    after_end,
    after_hello,
    after_silence,
    latches,
)


def test_a_trial_goes_through_its_states() -> None:
    state: State | NakCode = State.IDLE
    seen = [state]
    for kind in (Kind.SET, Kind.SET, Kind.ARM, Kind.START, Kind.STOP):
        state = after(seen[-1], kind)
        assert isinstance(state, State)
        seen.append(state)
    assert [s.text for s in seen] == [
        "idle", "configured", "configured", "armed", "running", "running",
    ]  # fmt: skip
    assert after_end(State.RUNNING, Outcome.INTERRUPTED) is State.ENDED
    assert after(State.ENDED, Kind.RELEASE) is State.IDLE


@pytest.mark.parametrize("state", State)
def test_safe_is_obeyed_in_every_state_and_hides_no_fault(state: State) -> None:
    assert after(state, Kind.SAFE) is (State.FAULT if state is State.FAULT else State.SAFE)


def test_only_an_armed_device_can_be_set_in_motion() -> None:
    ways = {(s, k) for s in State for k in COMMANDS if after(s, k) is State.RUNNING}
    assert ways == {(State.ARMED, Kind.START), (State.RUNNING, Kind.STOP)}


def test_silence_and_faults_end_motion() -> None:
    assert {s for s in State if after_silence(s) is not s} == {State.ARMED, State.RUNNING}
    assert after_silence(State.RUNNING) is State.FAULT
    assert after_end(State.RUNNING, Outcome.FAULT) is State.FAULT
    assert after_end(State.SAFE, Outcome.INTERRUPTED) is State.SAFE


def test_a_latch_can_be_cleared_only_where_nothing_moves_and_that_changes_no_state() -> None:
    for state in State:
        moves = state in (State.ARMED, State.RUNNING)
        assert after(state, Kind.UNLATCH) is (NakCode.WRONG_STATE if moves else state)


def test_another_host_takes_nothing_over_that_moves_or_is_about_to() -> None:
    for held in (False, True):
        assert after_hello(State.RUNNING, same_session=False, held=held) is NakCode.BUSY
        assert after_hello(State.ARMED, same_session=False, held=held) is NakCode.BUSY
    assert after_hello(State.CONFIGURED, same_session=False, held=False) is State.IDLE


@pytest.mark.parametrize("state", State)
def test_nobody_takes_a_device_from_a_host_that_is_heard(state: State) -> None:
    assert after_hello(state, same_session=False, held=True) is NakCode.BUSY
    for held in (False, True):
        assert after_hello(state, same_session=True, held=held) is state


def test_every_safe_but_the_holders_latches() -> None:
    assert not latches(42, holder=42)
    assert latches(43, holder=42)
    assert latches(42, holder=None)
    assert latches(0, holder=42)
    assert latches(0, holder=None)
    assert latches(0, holder=0)  # nobody is no session


def test_numbers_follow_each_other_over_the_wrap() -> None:
    numbering = SequenceNumbers()
    for number in (0, 1):
        assert numbering.turn(Kind.SET, number, b"a") is Turn.OUT_OF_ORDER  # nobody said HELLO
    assert numbering.turn(Kind.SAFE, 9, b"") is Turn.NEW
    numbering.begin(session=1, sequence=65534)
    assert numbering.turn(Kind.SET, 65535, b"a") is Turn.NEW
    assert numbering.turn(Kind.SET, 65535, b"a") is Turn.REPEATED
    assert numbering.turn(Kind.SET, 65535, b"b") is Turn.OUT_OF_ORDER
    assert numbering.turn(Kind.SAFE, 65535, b"") is Turn.NEW
    assert numbering.turn(Kind.UNLATCH, 65535, b"") is Turn.OUT_OF_ORDER  # numbered as any other
    assert numbering.turn(Kind.ARM, 0, b"crc.") is Turn.NEW
    assert numbering.turn(Kind.SET, 65535, b"a") is Turn.OUT_OF_ORDER
    numbering.begin(session=1, sequence=65534)  # the first HELLO, heard once more
    assert numbering.turn(Kind.ARM, 0, b"crc.") is Turn.REPEATED
    numbering.begin(session=1, sequence=7)
    assert numbering.turn(Kind.START, 8, b"") is Turn.NEW


def test_the_same_number_and_body_of_another_kind_is_no_repetition() -> None:
    numbering = SequenceNumbers()
    numbering.begin(session=1, sequence=1)
    assert numbering.turn(Kind.START, 2, b"") is Turn.NEW
    assert numbering.turn(Kind.STOP, 2, b"") is Turn.OUT_OF_ORDER
    assert numbering.turn(Kind.START, 2, b"") is Turn.REPEATED


def test_a_session_is_the_same_until_another_begins() -> None:
    numbering = SequenceNumbers()
    assert numbering.same_session(7) is False
    numbering.begin(session=7, sequence=9)
    assert numbering.same_session(7) is True
    assert numbering.same_session(9) is False
    numbering.begin(session=8, sequence=9)
    assert numbering.same_session(7) is False


@given(st.lists(st.tuples(st.integers(0, 3), st.booleans()), max_size=30))
def test_each_command_is_carried_out_once_and_in_order(sendings: list[tuple[int, bool]]) -> None:
    """A host that sends again until it is answered, over a line that repeats and loses."""
    numbering = SequenceNumbers()
    numbering.begin(session=5, sequence=0)
    carried_out, number = [], 1
    for repetitions, arrives in sendings:
        turns = [numbering.turn(Kind.SET, number, bytes((number,))) for _ in range(1 + repetitions)]
        carried_out += [number] * turns.count(Turn.NEW)
        if arrives:
            number += 1
    assert carried_out == sorted(set(carried_out))
    assert len(carried_out) >= number - 1
