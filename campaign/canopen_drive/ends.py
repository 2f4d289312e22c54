"""How a trial of the relay ended, and what fault of the run that is."""

from __future__ import annotations

from enum import StrEnum

from campaign.recording import Fault


class End(StrEnum):
    """What the relay tells the host."""

    PLAYED = "played"
    STOPPED = "stopped"
    PANIC_STOP = "panic stop"
    HOST_GONE = "host gone"
    HOST_SILENT = "host silent"
    POSITION_LIMIT = "position limit"
    RATE_LIMIT = "rate limit"
    TORQUE_LIMIT = "torque limit"
    DRIVE_LIMIT = "limit of the drive"
    STATE = "state"
    DRIVE = "drive"
    SILENT = "silent"
    LOST = "lost sample"
    LATE = "late sync"
    RESET = "reset"


STOPPED = {End.STOPPED, End.PANIC_STOP, End.HOST_GONE, End.HOST_SILENT}
"""By somebody, whatever the drive says of itself."""
LIMITS = {End.POSITION_LIMIT, End.RATE_LIMIT, End.TORQUE_LIMIT, End.DRIVE_LIMIT}
FAULTS = {
    End.LOST: Fault.LOST_SAMPLES,
    End.LATE: Fault.RECORDING,
    End.SILENT: Fault.LOST_CONNECTION,
    End.HOST_GONE: Fault.HEARTBEAT,
    End.HOST_SILENT: Fault.HEARTBEAT,
    End.RESET: Fault.RESET,
    End.DRIVE: Fault.REFUSED,
    End.STATE: Fault.DRIVE,
}
