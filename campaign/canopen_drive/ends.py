"""Ends of a trial in the relay, and the corresponding outcomes."""

from __future__ import annotations

from enum import StrEnum

from campaign.recording import Fault, Outcome


class End(StrEnum):
    """End of a job, as the relay reports it to the host."""

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
"""Ends by the host or a user, independent of the drive's state."""
RESULTS = {
    End.PLAYED: (Outcome.COMPLETED, None),
    End.STOPPED: (Outcome.INTERRUPTED, None),
    End.PANIC_STOP: (Outcome.INTERRUPTED, None),
    End.HOST_GONE: (Outcome.FAULT, Fault.HEARTBEAT),
    End.HOST_SILENT: (Outcome.FAULT, Fault.HEARTBEAT),
    End.POSITION_LIMIT: (Outcome.LIMIT, None),
    End.RATE_LIMIT: (Outcome.LIMIT, None),
    End.TORQUE_LIMIT: (Outcome.LIMIT, None),
    End.DRIVE_LIMIT: (Outcome.LIMIT, None),
    End.STATE: (Outcome.FAULT, Fault.DRIVE),
    End.DRIVE: (Outcome.FAULT, Fault.REFUSED),
    End.SILENT: (Outcome.FAULT, Fault.LOST_CONNECTION),
    End.LOST: (Outcome.FAULT, Fault.LOST_SAMPLES),
    End.LATE: (Outcome.FAULT, Fault.RECORDING),
    End.RESET: (Outcome.FAULT, Fault.RESET),
}
