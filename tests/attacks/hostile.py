"""A plug-in whose backends do what their options say: `at` which call, `do` which expression.

It is installed as the package `sabotage` and imported as that, never by a test. The value of the
expression takes the place of what the call would have returned. Several calls are joined by `+`; at
`all` the expression is evaluated at every call, and its value dropped.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from campaign.backends.interface import BackendKind, Source
from campaign.channels import info
from campaign.errors import UsageError
from campaign.options import Options
from campaign.recording import ChannelInfo, Ending, Event, Fault, Outcome, PanicStop, SafeState

if Path("spam").exists():
    print("SPAM: imported")  # noqa: T201 - what many a library does
TOOLS = (ctypes, os, signal, sys, warnings, Event, PanicStop, SimpleNamespace, UsageError)
"""For the expressions, and used nowhere else; with all other names of this file."""

CHANNELS = (
    info("relative_rate"),
    info("relative_angle"),
    info("gyro_rate"),
    info("drive_torque"),
    info("motor_current"),
    info("temperature"),
)
GOOD = 0.01
"""In every channel, at every time."""
BLOCK = 20
LONGEST = 30.0
"""s; whoever waits for that has failed."""
NASTY = "lone \ud800 nul \0 esc \x1b[2J\x1b]0;owned\a \r\x7f\x9b1m turned \u202e sep \u2028 end"
LONG = "long " * 200_000
GARBAGE = object()

# What a test in the same process looks at and sets

EXECUTED: list[int] = []
"""Numbers of the trials that were begun."""
STOPPED: list[bool] = []
"""What the stop flag said when `start` had returned, or that it raised."""
RELEASED = threading.Event()
"""Lets go of whatever hangs."""
WAITED_OUT: list[str] = []
"""Hangs that nobody left behind: they ended by themselves."""


def hang() -> None:
    """Come back when the test is over, and not before."""
    if not RELEASED.wait(LONGEST):
        WAITED_OUT.append(threading.current_thread().name)


def renew() -> None:
    """As if it had just been imported."""
    global RELEASED
    RELEASED = threading.Event()
    for memory in (EXECUTED, STOPPED, WAITED_OUT):
        memory.clear()


def throw(error: type[BaseException] | BaseException) -> None:
    raise error


def recurse() -> None:
    recurse()


class RoughError(BaseException):
    """Not one that `except Exception` catches."""


class UnprintableError(Exception):
    """Raises where it is told."""

    def __str__(self) -> str:
        raise ValueError("no words for it")

    __repr__ = __str__


class Liar:
    """No array, though it says so."""

    shape, ndim = (6, 20), 2

    def __array__(self, *arguments: object, **more: object) -> np.ndarray:
        raise RoughError("no array")


class HostileOptions(Options):
    """What is done, and when."""

    at: str = ""
    """The calls at which it is done."""
    do: str = "None"
    """A Python expression; of several lines, each is for one trial."""


COMPLETED = Ending(Outcome.COMPLETED)


def fault(reason: object, **more: object) -> Ending:
    return Ending(Outcome.FAULT, reason, **{"fault": Fault.DRIVE, **more})


def told(**telemetry: object) -> Ending:
    return Ending(Outcome.COMPLETED, telemetry=telemetry)


def first(**changes: object) -> tuple[ChannelInfo, ...]:
    """The channels, the first one with changes."""
    return (replace(CHANNELS[0], **changes), *CHANNELS[1:])


def column(value: float) -> np.ndarray:
    """A sample whose first channel has another value."""
    return np.array([[value]] + [[GOOD]] * (len(CHANNELS) - 1))


def deep(depth: int) -> list[object]:
    found: list[object] = []
    for _ in range(depth):
        found = [found]
    return found


class Hostile:
    """Does all that the interface asks for, but for what its options say."""

    def __init__(self, options: HostileOptions) -> None:
        self.options = options
        self.calls: dict[str, int] = {}

    def at(self, call: str, good: object, **names: object) -> object:
        """What a call returns."""
        self.calls[call] = self.calls.get(call, 0) + 1
        calls = self.options.at.split("+")
        if call not in calls and calls != ["all"]:
            return good
        known = {"call": call, "calls": self.calls[call], "good": good, "self": self, **names}
        lines = self.options.do.split("\n")
        line = lines[min(max(len(EXECUTED), 1), len(lines)) - 1]
        found = eval(line, {**globals(), **known})
        return good if calls == ["all"] else found

    def __enter__(self) -> object:
        return self.at("enter", self)

    def __exit__(self, *exception: object) -> object:
        return self.at("exit", None)

    def refuses(self, trial: object) -> object:
        return self.at("refuses", None, trial=trial)

    def channels(self, trial: object) -> object:
        return self.at("channels", frozenset(each.name for each in CHANNELS), trial=trial)

    def make_safe(self) -> object:
        return self.at("make_safe", SafeState.CONFIRMED)

    def execute(self, trial, recorder, stop) -> object:
        """As many trials are hostile as there are lines, the others are good."""
        EXECUTED.append(trial.number)
        spoilt = len(EXECUTED) <= len(self.options.do.split("\n"))

        def at(call: str, good: object, **names: object) -> object:
            known = {"trial": trial, "recorder": recorder, "stop": stop, **names}
            return self.at(call, good, **known) if spoilt else good

        ending = at("execute", self)
        if ending is not self:
            return ending
        announced = at("announced", CHANNELS)
        try:
            recorder.start(announced)
        except BaseException:
            STOPPED.append(True)
            raise
        STOPPED.append(stop())
        rows = len(announced) if isinstance(announced, tuple) else len(CHANNELS)
        count = int(trial.task.duration * trial.task.sample_rate)
        heeds = not (spoilt and self.options.at.startswith("announced"))
        value = at("value", GOOD)
        for number, begin in enumerate(range(0, count, BLOCK)):
            if heeds and stop():
                return Ending(Outcome.INTERRUPTED, "stopped")
            moments = np.arange(begin, min(begin + BLOCK, count)) / trial.task.sample_rate
            block = np.full((rows, len(moments)), value)
            if number == 1:
                at("within", None)
                moments, block = at("samples", (moments, block), time=moments, block=block)
            recorder.append(moments, block)
        return at("ending", COMPLETED)


class Stoppable(Hostile):
    """Others can switch it off, it says."""

    def introduce(self, run: str) -> object:
        return self.at("introduce", None)

    def panic_stop(self) -> object:
        return self.at("panic_stop", None)

    def clear_stop(self, count: int) -> object:
        return self.at("clear_stop", None)


class Together(Hostile):
    """Many trials at a time."""

    fewest_together, most_together = 2, 8

    def group(self, trial: object) -> object:
        return self.at("group", 0)

    def execute_together(self, trials, recorders, stops) -> Iterator[tuple[int, object]]:
        together = zip(trials, recorders, stops, strict=True)
        good = ((place, self.execute(*each)) for place, each in enumerate(together))
        return self.at("together", good)


def without(method: str, *instead: object, base: type[Hostile] = Hostile) -> type:
    """A backend's class that lacks a method, or has something else in its place."""
    every = {name: each for made in base.__mro__[-2::-1] for name, each in vars(made).items()}
    kept = {k: v for k, v in every.items() if k not in (method, "__dict__", "__weakref__")}
    return type("Lacking", (), {**kept, **dict.fromkeys((method,) * len(instead), *instead)})


def _opens(made: type[Hostile]):
    def open_(options: HostileOptions) -> object:
        return made(options).at("open", made(options), options=options)

    return open_


LIVE = BackendKind(
    "hostile", "a live one", HostileOptions, _opens(Hostile), Source.HARDWARE, live=True
)
CALM = BackendKind(
    "hostile_calm", "one that moves nothing", HostileOptions, _opens(Hostile), Source.SIMULATION
)
STOPPABLE = BackendKind(
    "hostile_stop",
    "a live one that others stop",
    HostileOptions,
    _opens(Stoppable),
    Source.HARDWARE,
    live=True,
    stopped_outside=True,
)
TOGETHER = BackendKind(
    "hostile_together",
    "one of many trials at a time",
    HostileOptions,
    _opens(Together),
    Source.SIMULATION,
)
