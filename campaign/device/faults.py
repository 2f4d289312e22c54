"""Faults on request: `--fault NAME[=VALUE][@trial=N][@time=T]`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from campaign.backends.sim import CHANNELS
from campaign.channels import COMMAND, GYRO_RATE
from campaign.errors import UsageError
from campaign.text import nearest


class FaultName(StrEnum):
    """Kinds of faults. The first five concern the line and have a rate, the others a time."""

    DROP = "drop"  # a byte is lost
    DUPLICATE = "duplicate"  # a byte arrives twice
    REORDER = "reorder"  # a byte is swapped with its neighbor
    CORRUPT = "corrupt"  # a byte is changed
    LOST_BLOCKS = "lost-blocks"  # a whole frame of records is lost
    STALL = "stall"  # the controller neither sends nor receives for some time
    REBOOT = "reboot"  # the controller restarts and loses its state
    UNPLUG = "unplug"  # the line is disconnected and connected again
    SENSOR = "sensor"  # a channel freezes, and the controller detects it
    OVER_TEMPERATURE = "over-temperature"  # the motor is too hot
    LIMIT_SWITCH = "limit-switch"  # the axis reaches its limit switch


BYTE_FAULTS = (FaultName.DROP, FaultName.DUPLICATE, FaultName.REORDER, FaultName.CORRUPT)
RATES = (*BYTE_FAULTS, FaultName.LOST_BLOCKS)

SECONDS = {
    FaultName.STALL: 0.05,
    FaultName.REBOOT: 0.2,
    FaultName.UNPLUG: 1.0,
    FaultName.OVER_TEMPERATURE: 0.0,
}
"""Faults with a duration, and its default (s of the wall clock)."""
DEFAULT_TIME = 0.5
"""s after the start of the trial."""
STUCK_CHANNELS = tuple(info.name for info in CHANNELS if info.measured and info.name != COMMAND)


@dataclass(frozen=True)
class FaultSpec:
    """One requested fault.

    Attributes:
        rate: share of affected bytes or frames of a line fault, in both directions.
        seconds: duration on the wall clock (s).
        channel: frozen channel of a sensor fault.
        trial: number of the trial since the start of the controller, from 1; None for all. A line
            fault without it also affects messages between trials.
        time: time of the fault in the trial (s of its own time); unused for a line fault.
    """

    name: FaultName
    rate: float = 0.0
    seconds: float = 0.0
    channel: str = ""
    trial: int | None = None
    time: float = DEFAULT_TIME

    def meets(self, trial: int | None) -> bool:
        """Whether it occurs in that trial; `trial` is None while none runs."""
        return self.trial is None or self.trial == trial


def parse_faults(texts: Sequence[str]) -> tuple[FaultSpec, ...]:
    """The faults of all `--fault` options. Raises UsageError."""
    return tuple(parse_fault(text) for text in texts)


def parse_fault(text: str) -> FaultSpec:
    """Parse `NAME[=VALUE][@trial=N][@time=T]`, T in seconds. Raises UsageError with the syntax."""
    what, *places = text.split("@")
    word, has_value, value = (part.strip() for part in what.partition("="))
    name = _name(text, word)
    trial, time = None, None
    for place in places:
        key, _, written = (part.strip() for part in place.partition("="))
        if key == "trial" and written.isascii() and written.isdigit() and int(written) > 0:
            trial = int(written)
        elif key == "time" and name not in RATES:
            time = _number(text, written, "a time in seconds", 0.0, math.inf)
        else:
            allowed = "@trial=N" if name in RATES else "@trial=N and @time=SECONDS"
            raise UsageError(f"--fault {text}: {place!r} is not a place; {name} takes {allowed}")
    given = value if has_value else None
    return FaultSpec(
        name,
        rate=_rate(text, name, given),
        seconds=_seconds(text, name, given),
        channel=_channel(text, name, given),
        trial=trial,
        time=DEFAULT_TIME if time is None else time,
    )


def _name(text: str, word: str) -> FaultName:
    try:
        return FaultName(word)
    except ValueError:
        names = list(map(str, FaultName))
        hint = nearest(word, names) or f"; there are {', '.join(names)}"
        raise UsageError(f"--fault {text}: there is no fault {word!r}{hint}") from None


def _rate(text: str, name: FaultName, value: str | None) -> float:
    if name not in RATES:
        return 0.0
    if value is None:
        raise UsageError(f"--fault {text}: {name} needs a rate, e.g. {name}=1e-4")
    return _number(text, value, "a rate from 0 to 1", 0.0, 1.0)


def _seconds(text: str, name: FaultName, value: str | None) -> float:
    if name not in SECONDS:
        return 0.0
    if value is None:
        return SECONDS[name]
    return _number(text, value, "a time in seconds", 0.0, 3600.0)


def _channel(text: str, name: FaultName, value: str | None) -> str:
    if name is FaultName.SENSOR:
        channel = value if value is not None else GYRO_RATE
        if channel not in STUCK_CHANNELS:
            raise UsageError(
                f"--fault {text}: {channel!r} cannot be stuck; one of {', '.join(STUCK_CHANNELS)}"
            )
        return channel
    if value is not None and name not in RATES and name not in SECONDS:
        raise UsageError(f"--fault {text}: {name} takes no value")
    return ""


def _number(text: str, written: str, what: str, low: float, high: float) -> float:
    try:
        number = float(written)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise UsageError(f"--fault {text}: {written!r} is not {what}")
    return number
