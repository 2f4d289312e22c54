"""Reactions of a device to commands: tables and pure functions, as in `firmware/`.

States change only by a command (`after`, `after_hello`), by the end of a trial (`after_end`) and by
silence of the host (`after_silence`). `SequenceNumbers` distinguishes new and repeated commands.
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
        # The axis is braked first: END sets ENDED. A STOP that arrives after the end of the trial
        # is not an error.
        (State.RUNNING, Kind.STOP): State.RUNNING,
        (State.ENDED, Kind.STOP): State.ENDED,
        (State.SAFE, Kind.STOP): State.SAFE,
        (State.FAULT, Kind.STOP): State.FAULT,
        (State.ENDED, Kind.RELEASE): State.IDLE,
        (State.SAFE, Kind.CLEAR): State.IDLE,
        (State.FAULT, Kind.CLEAR): State.IDLE,
        **{(state, Kind.SAFE): State.SAFE for state in State},
        # SAFE does not hide a fault: the drive is already off.
        (State.FAULT, Kind.SAFE): State.FAULT,
        # The latch is independent of the states: UNLATCH changes none. It is refused in states
        # where the drive is on or may switch on.
        **{(state, Kind.UNLATCH): state for state in State if state not in _MAY_MOVE},
    }
)
"""State after a command, by state and command; all other pairs are refused as WRONG_STATE."""

WATCHED = frozenset(_MAY_MOVE)
"""States with a heartbeat timeout (`after_silence`); ARM and START need a recent heartbeat, too."""


def after(state: State, kind: Kind) -> State | NakCode:
    """The state after a command other than HELLO, or the reason of its refusal.

    A device may refuse an allowed command for other reasons (a wrong checksum, a limit, a
    persistent cause ...): its state then stays.
    """
    return TRANSITIONS.get((state, kind), NakCode.WRONG_STATE)


def after_hello(state: State, same_session: bool, held: bool) -> State | NakCode:
    """The state after HELLO: a reconnection changes nothing, a new host ends a configuration.

    `held`: heartbeats of the present session arrive within the timeout of CAPABILITIES. Then no
    other host gets the device, not even between two trials.
    """
    if same_session:
        return state
    if held or state in WATCHED:
        return NakCode.BUSY
    return State.IDLE if state is State.CONFIGURED else state


def after_end(state: State, outcome: Outcome) -> State:
    """The state after the record END; it does not change a state set by SAFE or a fault."""
    if state is not State.RUNNING:
        return state
    return State.FAULT if outcome is Outcome.FAULT else State.ENDED


def after_silence(state: State) -> State:
    """The state after the heartbeat timeout of CAPABILITIES."""
    return State.FAULT if state in WATCHED else state


def latches(session: int, holder: int | None) -> bool:
    """Whether a SAFE of `session` is a stop from outside: not from the holder of the device."""
    return session == 0 or session != holder


class Turn(Enum):
    """Meaning of a command's sequence number."""

    NEW = "new"  # execute it
    REPEATED = "repeated"  # answer as before, execute nothing
    OUT_OF_ORDER = "out of order"  # refuse it; nothing else changes


class SequenceNumbers:
    """Sequence numbers of commands: each is the last one plus 1, modulo 65536.

    An accepted HELLO restarts the sequence with its own number. SAFE is exempt: always new, and not
    stored. A refused command uses its number; one out of order does not.
    """

    def __init__(self) -> None:
        self._hello: tuple[int, int] | None = None
        self._last: tuple[int, int | None] | None = None

    def same_session(self, session: int) -> bool:
        """Whether HELLO renews the present session."""
        return self._hello is not None and self._hello[0] == session

    def begin(self, session: int, sequence: int) -> None:
        """Register an accepted HELLO; a repeated one (late or twice) changes nothing."""
        if self._hello != (session, sequence):
            self._hello = (session, sequence)
            self._last = (sequence, None)

    def turn(self, kind: int, sequence: int, body: bytes) -> Turn:
        """Classify a command; store it if it is new and neither HELLO nor SAFE."""
        if kind in (Kind.HELLO, Kind.SAFE):
            return Turn.NEW
        if self._last is None:  # no HELLO yet
            return Turn.OUT_OF_ORDER
        this = (sequence, zlib.crc32(bytes((kind,)) + body))
        if this == self._last:
            return Turn.REPEATED
        if sequence != (self._last[0] + 1) % 2**16:
            return Turn.OUT_OF_ORDER
        self._last = this
        return Turn.NEW
