"""State machine of CiA 402: states from statuswords, and permitted controlwords.

`canopen.profiles.p402` is not used: it may enable the drive to reach a state. Here a stop is one
controlword that enables nothing in any state. It is also valid if the state has changed since the
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
        """Name of the state for messages."""
        return self.name.lower().replace("_", " ")

    @property
    def off(self) -> bool:
        """Whether the power stage produces no torque."""
        return self in (State.NOT_READY, State.SWITCH_ON_DISABLED, State.READY, State.FAULT)


QUICK_STOP = 0x0002
"""Voltage enabled, quick stop bit 0. In all states except `ENABLED` and `QUICK_STOP` it leads to
`SWITCH_ON_DISABLED` or has no effect."""
DISABLE_VOLTAGE = 0x0000
FAULT_RESET = 0x0080
"""All other bits 0: without a fault it disables the voltage."""
ENABLING = {State.SWITCH_ON_DISABLED: 0x0006, State.READY: 0x0007, State.SWITCHED_ON: 0x000F}
"""Controlwords toward `ENABLED`; none from `QUICK_STOP` and from a fault."""
INTERNAL_LIMIT = 0x0800
"""Bit 11 of the statusword."""


def state_of(statusword: int) -> State | None:
    """State of a statusword; None for an invalid word."""
    for state in State:
        mask, value = state.value
        if statusword & mask == value:
            return state
    return None


def stop_word(state: State | None, *, at_rest: bool) -> int:
    """Controlword to bring the drive to rest and switch it off.

    A drive that stays in `QUICK_STOP` (605Ah from 5 to 8) is switched off at rest. Before, the word
    is the quick stop for any state: a drive read as `SWITCHED_ON` may be `ENABLED` now, and would
    coast without voltage.
    """
    return DISABLE_VOLTAGE if state is State.QUICK_STOP and at_rest else QUICK_STOP


def reset_words(state: State | None) -> tuple[int, ...]:
    """Controlwords that clear a fault by a rising bit 7; none without a fault."""
    return (DISABLE_VOLTAGE, FAULT_RESET, DISABLE_VOLTAGE) if state is State.FAULT else ()
