"""State machine of CiA 402: what a statusword says, and which controlword may follow.

`canopen.profiles.p402` is not used: on its way to a state it enables the drive. Here a stop is one
word that enables nothing in any state, so it is right also when the state has changed since the
statusword was read.
"""

from __future__ import annotations

from enum import Enum


class State(Enum):
    """States of a drive: mask and value of the statusword."""

    NOT_READY = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    ENABLED = (0x6F, 0x27)
    QUICK_STOP = (0x6F, 0x07)
    FAULT_REACTION = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)

    @property
    def text(self) -> str:
        """For people."""
        return self.name.lower().replace("_", " ")

    @property
    def off(self) -> bool:
        """Whether the power stage gives no torque."""
        return self in (State.NOT_READY, State.SWITCH_ON_DISABLED, State.READY, State.FAULT)


QUICK_STOP = 0x0002
"""Voltage stays, quick stop bit 0. In every state but `ENABLED` and `QUICK_STOP` it leads to
`SWITCH_ON_DISABLED` or nowhere."""
DISABLE_VOLTAGE = 0x0000
FAULT_RESET = 0x0080
"""All other bits 0: in a state that is no fault it disables the voltage."""
ENABLING = {State.SWITCH_ON_DISABLED: 0x0006, State.READY: 0x0007, State.SWITCHED_ON: 0x000F}
"""What leads nearer to `ENABLED`. From `QUICK_STOP` and from a fault nothing does."""
INTERNAL_LIMIT = 0x0800
"""Bit 11 of the statusword."""


def state_of(statusword: int) -> State | None:
    """None of a word that no state has."""
    for state in State:
        mask, value = state.value
        if statusword & mask == value:
            return state
    return None


def stop_word(state: State | None, *, at_rest: bool) -> int:
    """What is commanded on the way to rest with the drive off.

    A drive that keeps `QUICK_STOP` (605Ah of 5 to 8) is switched off once it stands. Until then the
    word is the quick stop, whatever the state was: a drive read as `SWITCHED_ON` may be `ENABLED`
    by now, and without voltage it would coast.
    """
    return DISABLE_VOLTAGE if state is State.QUICK_STOP and at_rest else QUICK_STOP


def reset_words(state: State | None) -> tuple[int, ...]:
    """What clears a fault: bit 7 has to rise. Nothing where there is no fault."""
    return (DISABLE_VOLTAGE, FAULT_RESET, DISABLE_VOLTAGE) if state is State.FAULT else ()
