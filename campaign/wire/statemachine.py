"""Reactions of a device to commands: tables and pure functions, as in `firmware/`.

States change by a command (`after`, `after_hello`), by the end of a trial (`after_end`) and by
silence of the host (`after_silence`); nothing else changes them. `SequenceNumbers` tells a new
command from a repeated one.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType

from campaign.wire.codes import Kind, NakCode, Outcome, State

_MAY_MOVE = (State.ARMED, State.RUNNING)

TRANSITIONS: Mapping[tuple[State, Kind], State] = MappingProxyType(
    {
        (State.IDLE, Kind.SET): State.CONFIGURED,
        (State.IDLE, Kind.CLEAR): State.IDLE,
        (State.CONFIGURED, Kind.SET): State.CONFIGURED,
        (State.CONFIGURED, Kind.ARM): State.ARMED,
        (State.CONFIGURED, Kind.CLEAR): State.IDLE,
        (State.ARMED, Kind.START): State.RUNNING,
        (State.ARMED, Kind.CLEAR): State.IDLE,
        # The axis is braked first: ENDED comes with END. Late for a trial just over, STOP is no
        # mistake.
        (State.RUNNING, Kind.STOP): State.RUNNING,
        (State.ENDED, Kind.STOP): State.ENDED,
        (State.SAFE, Kind.STOP): State.SAFE,
        (State.FAULT, Kind.STOP): State.FAULT,
        (State.ENDED, Kind.RELEASE): State.IDLE,
        (State.SAFE, Kind.CLEAR): State.IDLE,
        (State.FAULT, Kind.CLEAR): State.IDLE,
        **{(state, Kind.SAFE): State.SAFE for state in State},
        # A fault is not hidden by switching off what is off already.
        (State.FAULT, Kind.SAFE): State.FAULT,
        # The latch is beside the states: UNLATCH changes none. It cannot be set where the drive is
        # on or may come on.
        **{(state, Kind.UNLATCH): state for state in State if state not in _MAY_MOVE},
    }
)
"""State and command to the state afterwards; every other pair is refused as WRONG_STATE."""

WATCHED = frozenset(_MAY_MOVE)
"""Where the host must be heard: `after_silence`, and ARM and START need a fresh heartbeat."""


def after(state: State, kind: Kind) -> State | NakCode:
    """The state after a command other than HELLO, or why it is refused.

    A device may refuse an allowed command for reasons of its own (a wrong checksum, a limit, a
    cause that persists ...): its state then stays.
    """
    return TRANSITIONS.get((state, kind), NakCode.WRONG_STATE)


def after_hello(state: State, same_session: bool, held: bool) -> State | NakCode:
    """The state after HELLO: a reconnection changes nothing, a new host ends a configuration.

    `held`: the session that there is was heard within the time of CAPABILITIES. Nobody takes a
    device from it, not even between two trials.
    """
    if same_session:
        return state
    if held or state in WATCHED:
        return NakCode.BUSY
    return State.IDLE if state is State.CONFIGURED else state


def after_end(state: State, outcome: Outcome) -> State:
    """The state when the record END is made; after SAFE or a fault only the record was missing."""
    if state is not State.RUNNING:
        return state
    return State.FAULT if outcome is Outcome.FAULT else State.ENDED


def after_silence(state: State) -> State:
    """The state when no heartbeat was heard for the time of CAPABILITIES."""
    return State.FAULT if state in WATCHED else state


def latches(session: int, holder: int | None) -> bool:
    """Whether a SAFE of `session` is a stop from outside: of anybody but who holds the device."""
    return session == 0 or session != holder


class Turn(Enum):
    """Whose turn a command's sequence number makes it."""

    NEW = "new"  # carry it out
    REPEATED = "repeated"  # answer as before, carry out nothing
    OUT_OF_ORDER = "out of order"  # refuse it; nothing else changes


class SequenceNumbers:
    """Sequence numbers of commands: each is the last one plus 1, modulo 65536.

    An accepted HELLO begins anew with its own number; SAFE is outside: always new, and remembered
    by nobody. A command that is refused has used its number; one out of order has not.
    """

    def __init__(self) -> None:
        self._hello: tuple[int, int] | None = None
        self._last: tuple[int, int | None] | None = None

    def same_session(self, session: int) -> bool:
        """Whether HELLO renews the session there is."""
        return self._hello is not None and self._hello[0] == session

    def begin(self, session: int, sequence: int) -> None:
        """An accepted HELLO; one that was heard before (late or twice) changes nothing."""
        if self._hello != (session, sequence):
            self._hello = (session, sequence)
            self._last = (sequence, None)

    def turn(self, kind: int, sequence: int, body: bytes) -> Turn:
        """Judge a command, and remember it when it is new and neither HELLO nor SAFE."""
        if kind in (Kind.HELLO, Kind.SAFE):
            return Turn.NEW
        if self._last is None:  # nobody said HELLO
            return Turn.OUT_OF_ORDER
        this = (sequence, zlib.crc32(bytes((kind,)) + body))
        if this == self._last:
            return Turn.REPEATED
        if sequence != (self._last[0] + 1) % 2**16:
            return Turn.OUT_OF_ORDER
        self._last = this
        return Turn.NEW
