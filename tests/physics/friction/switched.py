"""Friction models switched at their events: slow, and with nothing of `campaign.physics`.

A load of inertia J hangs on a spring whose far end is commanded, and is pushed:
J dv/dt = k (x(t) - q) + p(t) - T - sigma2 v. Between events scipy's order-8 Runge-Kutta solves
smooth equations; an event is a root, and says what follows it. Parameters are named as in the
thesis, per N m, rad and s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
Next = Callable[[float, Array], tuple[Array, Any]]
NEARLY = 1e-9
"""Of r = 1 in Leuven's equation, which sliding approaches from below."""


@dataclass(frozen=True)
class Event:
    """A root of `value` in this direction; `then` gives state and mode after it."""

    value: Callable[[float, Array], float]
    direction: float
    then: Next


@dataclass
class Load:
    """The load, and the curve Tc + (Ts - Tc) exp(-|v / vs|^2) of what rubs on it."""

    inertia: float = 35.0
    spring: float = 0.0
    pull: Callable[[float], float] = lambda t: 0.0
    push: Callable[[float], float] = lambda t: 0.0
    coulomb: float = 26.0
    static: float = 32.0
    width: float = 0.03
    viscous: float = 4.0
    longest: float = math.inf

    def applied(self, t: float, y: Array) -> float:
        return self.spring * (self.pull(t) - y[1]) + self.push(t)

    def moved(self, t: float, y: Array, torque: float) -> list[float]:
        return [(self.applied(t, y) - torque - self.viscous * y[0]) / self.inertia, y[0]]

    def curve(self, v: float) -> float:
        return self.coulomb + (self.static - self.coulomb) * math.exp(-((v / self.width) ** 2))

    def remember(self, part: Any) -> None:
        """Of a solved part."""


@dataclass
class Karnopp(Load):
    """Within |v| < band a moving load meets Ts. Modes: direction, within; or (0, True)."""

    band: float = 1e-3

    def start(self) -> tuple[Array, Any]:
        return np.zeros(2), (0, True)

    def torque(self, t: float, y: Array, mode: Any) -> float:
        way, within = mode
        if way == 0:
            return self.applied(t, y)
        return way * (self.static if within else self.curve(y[0]))

    def rates(self, t: float, y: Array, mode: Any) -> list[float]:
        return [0.0, 0.0] if mode[0] == 0 else self.moved(t, y, self.torque(t, y, mode))

    def events(self, mode: Any) -> list[Event]:
        way, within = mode
        if way == 0:
            return [
                Event(
                    lambda t, y: self.applied(t, y) - self.static, +1, lambda t, y: (y, (1, True))
                ),
                Event(
                    lambda t, y: self.applied(t, y) + self.static, -1, lambda t, y: (y, (-1, True))
                ),
            ]
        crosses = Event(
            lambda t, y: way * y[0] - self.band,
            +1 if within else -1,
            lambda t, y: (y, (way, not within)),
        )
        return [Event(lambda t, y: y[0], -way, self._stops), crosses]

    def _stops(self, t: float, y: Array) -> tuple[Array, Any]:
        y, applied = np.array([0.0, y[1]]), self.applied(t, y)
        held = abs(applied) <= self.static
        return y, (0, True) if held else (int(math.copysign(1, applied)), True)


@dataclass
class PrintedKarnopp(Load):
    """As Karnopp prints it: a momentum within the band, and an angle that stands still there.

    y[0] is momentum / J. Modes: direction of sliding; (0, way) within: stuck, or pushed over Ts.
    """

    band: float = 1e-3

    def start(self) -> tuple[Array, Any]:
        return np.zeros(2), (0, 0)

    def torque(self, t: float, y: Array, mode: Any) -> float:
        if mode[0] == 0:
            return mode[1] * self.static if mode[1] else self.applied(t, y)
        return mode[0] * self.curve(y[0])

    def rates(self, t: float, y: Array, mode: Any) -> list[float]:
        if mode[0] == 0:
            return [(self.applied(t, y) - self.torque(t, y, mode)) / self.inertia, 0.0]
        return self.moved(t, y, self.torque(t, y, mode))

    def events(self, mode: Any) -> list[Event]:
        way, pushed = mode
        if way:
            return [Event(lambda t, y: way * y[0] - self.band, -1, self._inside)]
        if pushed:
            return [
                Event(lambda t, y: pushed * y[0] - self.band, +1, lambda t, y: (y, (pushed, 0))),
                Event(lambda t, y: pushed * self.applied(t, y) - self.static, -1, self._inside),
            ]
        return [
            Event(
                lambda t, y, w=w: w * self.applied(t, y) - self.static,
                +1,
                lambda t, y, w=w: (y, (0, w)),
            )
            for w in (1, -1)
        ]

    def _inside(self, t: float, y: Array) -> tuple[Array, Any]:
        applied = self.applied(t, y)
        return y, (0, 0 if abs(applied) <= self.static else int(math.copysign(1, applied)))


@dataclass(frozen=True)
class ArmstrongMode:
    """way: direction of sliding, 0 stuck.   excess: D when sliding, Da when stuck.   since: s."""

    way: int
    excess: float
    since: float


@dataclass
class Armstrong(Load):
    """State v, q, torque of the spring. No part is longer than the lag: it looks into the past."""

    stiffness: float = 18000.0
    lag: float = 5e-3
    recovery: float = 0.5
    past: list[Any] = field(default_factory=list)

    def start(self) -> tuple[Array, Any]:
        self.longest, self.past = self.lag, []
        return np.zeros(3), ArmstrongMode(0, self.static - self.coulomb, 0.0)

    def remember(self, part: Any) -> None:
        self.past.append((part.t[0], part.t[-1], part.sol))

    def _fallen(self, t: float) -> float:
        at, v = t - self.lag, 0.0
        for start, end, solution in reversed(self.past):
            if start <= at:
                v = solution(min(at, end))[0]
                break
        return 1.0 / (1.0 + (v / self.width) ** 2)

    def _level(self, t: float, mode: Any) -> float:
        dwell, most = t - mode.since, self.static - self.coulomb
        return self.coulomb + mode.excess + (most - mode.excess) * dwell / (dwell + self.recovery)

    def torque(self, t: float, y: Array, mode: Any) -> float:
        if mode.way == 0:
            return float(y[2])
        return mode.way * (self.coulomb + mode.excess * self._fallen(t))

    def rates(self, t: float, y: Array, mode: Any) -> list[float]:
        stretched = self.stiffness * y[0] if mode.way == 0 else 0.0
        return [*self.moved(t, y, self.torque(t, y, mode)), stretched]

    def events(self, mode: Any) -> list[Event]:
        if mode.way:
            return [Event(lambda t, y: y[0], -mode.way, lambda t, y: self._sticks(t, y, mode))]
        return [
            Event(
                lambda t, y, w=w: w * y[2] - self._level(t, mode), +1,
                lambda t, y, w=w: (y, ArmstrongMode(w, self._level(t, mode) - self.coulomb, t)),
            )
            for w in (1, -1)
        ]  # fmt: skip

    def _sticks(self, t: float, y: Array, mode: Any) -> tuple[Array, Any]:
        left = mode.excess * self._fallen(t)
        return np.array([0.0, y[1], mode.way * (self.coulomb + left)]), ArmstrongMode(0, left, t)


@dataclass
class Gms(Load):
    """State v, q, torques of the elements. Mode: direction of motion, and which elements slip."""

    shares: tuple[float, ...] = (0.5, 0.5)
    stiffnesses: tuple[float, ...] = (12000.0, 6000.0)
    attraction: float = 3000.0

    def start(self) -> tuple[Array, Any]:
        way = int(math.copysign(1, self.applied(1e-6, np.zeros(2))))
        return np.zeros(2 + len(self.shares)), (way, (False,) * len(self.shares))

    def torque(self, t: float, y: Array, mode: Any) -> float:
        return float(np.sum(y[2:]))

    def rates(self, t: float, y: Array, mode: Any) -> list[float]:
        way, slips = mode
        s = self.curve(y[0])
        own = [
            self.attraction * (share * way - torque / s) if slip else stiffness * y[0]
            for share, stiffness, torque, slip in zip(
                self.shares, self.stiffnesses, y[2:], slips, strict=True
            )
        ]
        return [*self.moved(t, y, self.torque(t, y, mode)), *own]

    def events(self, mode: Any) -> list[Event]:
        way, slips = mode
        found = [Event(lambda t, y: y[0], -way, lambda t, y: (y, (-way, (False,) * len(slips))))]
        for i, slip in enumerate(slips):
            if not slip:
                after = (way, (*slips[:i], True, *slips[i + 1 :]))
                found.append(
                    Event(
                        lambda t, y, i=i: way * y[2 + i] - self.shares[i] * self.curve(y[0]), +1,
                        lambda t, y, after=after: (y, after),
                    )
                )  # fmt: skip
        return found


@dataclass
class Leuven(Load):
    """State v, q, torques of the elements. Mode: direction of motion, of z; which elements slip."""

    levels: tuple[float, ...] = (16.0, 16.0)
    stiffnesses: tuple[float, ...] = (12000.0, 6000.0)
    damping: float = 800.0
    exponent: float = 1.0

    def start(self) -> tuple[Array, Any]:
        way = int(math.copysign(1, self.applied(1e-6, np.zeros(2))))
        return np.zeros(2 + len(self.levels)), (way, 1, (False,) * len(self.levels))

    def _opens(self, y: Array, way: int) -> float:
        ratio = way * float(np.sum(y[2:])) / self.curve(y[0])
        return 1.0 - math.copysign(abs(ratio) ** self.exponent, ratio)

    def torque(self, t: float, y: Array, mode: Any) -> float:
        return float(np.sum(y[2:])) + self.damping * y[0] * self._opens(y, mode[0])

    def rates(self, t: float, y: Array, mode: Any) -> list[float]:
        z = y[0] * self._opens(y, mode[0])
        own = [0.0 if slip else k * z for k, slip in zip(self.stiffnesses, mode[2], strict=True)]
        return [*self.moved(t, y, self.torque(t, y, mode)), *own]

    def events(self, mode: Any) -> list[Event]:
        way, forth, slips = mode
        none = (False,) * len(slips)
        margin = NEARLY * forth
        found = [
            Event(lambda t, y: y[0], -way, lambda t, y: (y, (-way, 1, none))),
            Event(
                lambda t, y: self._opens(y, way) + margin, -forth,
                lambda t, y: (y, (way, -forth, none)),
            ),
        ]  # fmt: skip
        for i, slip in enumerate(slips):
            if not slip:
                after = (way, forth, (*slips[:i], True, *slips[i + 1 :]))
                found.append(
                    Event(
                        lambda t, y, i=i: way * forth * y[2 + i] - self.levels[i], +1,
                        lambda t, y, after=after: (y, after),
                    )
                )  # fmt: skip
        return found


def switched(load: Any, times: Array, rtol: float = 1e-10) -> tuple[dict[str, Array], list[float]]:
    """`load_rate`, `relative_angle` and `friction_torque` (viscous too) at `times`; the events."""
    y, mode = load.start()
    t, end, done, events = float(times[0]), float(times[-1]), 0, []
    found = np.empty((3, len(times)))
    while done < len(times):
        until = min(end, t + load.longest)
        watched = load.events(mode)
        functions = [_function(event) for event in watched]
        part = solve_ivp(
            load.rates, (t, until), y, method="DOP853", dense_output=True, args=(mode,),
            events=functions, rtol=rtol, atol=rtol * 1e-2, max_step=5e-3,
        )  # fmt: skip
        assert part.success, part.message
        here = times[done:]
        last = part.status != 1 and until >= end
        here = here if last else here[here < part.t[-1]]
        if len(here):
            values = part.sol(here)
            torques = [
                load.torque(at, state, mode) for at, state in zip(here, values.T, strict=True)
            ]
            found[:, done : done + len(here)] = [
                values[0], values[1], np.array(torques) + load.viscous * values[0],
            ]  # fmt: skip
            done += len(here)
        load.remember(part)
        t, y = float(part.t[-1]), part.y[:, -1].copy()
        if part.status == 1:
            which = next(k for k, hits in enumerate(part.t_events) if len(hits))
            y, mode = watched[which].then(t, y)
            events.append(t)
    return dict(zip(("load_rate", "relative_angle", "friction_torque"), found, strict=True)), events


def _function(event: Event) -> Any:
    def value(t: float, y: Array, mode: Any) -> float:
        return event.value(t, y)

    value.terminal, value.direction = True, event.direction  # type: ignore[attr-defined]
    return value


__all__ = ["Armstrong", "Gms", "Karnopp", "Leuven", "Load", "PrintedKarnopp", "replace", "switched"]
