"""A simulated CiA 402 drive with an axis of inertia and friction, as a node on a python-can bus.

Its state machine and its object numbers are written down here anew, after the standard, and share
nothing with the program. While it is enabled and SYNC comes, its time is that of SYNC: one period
for each, however late it is. Otherwise it is the wall clock's; off, it is faster by `speed`.
"""

from __future__ import annotations

import math
import random
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

import can
import canopen
from canopen.objectdictionary import ODRecord, ODVariable

SIZES = {"b": 0x02, "h": 0x03, "i": 0x04, "B": 0x05, "H": 0x06, "I": 0x07}  # CiA 301, table 44
OBJECTS: dict[int, tuple[str, dict[int, int]]] = {
    0x1000: ("I", {0: 0x00020192}),
    0x1001: ("B", {0: 0}),
    0x1006: ("I", {0: 0}),
    0x1016: ("I", {1: 0}),
    0x1017: ("H", {0: 0}),
    0x1018: ("I", {1: 0x2A, 2: 0x402, 3: 1, 4: 7}),
    0x1019: ("B", {0: 0}),
    0x1029: ("B", {1: 0}),
    **{0x1400 + n: ("", {}) for n in range(3)},
    0x6007: ("h", {0: 1}),
    0x603F: ("H", {0: 0}),
    0x6040: ("H", {0: 0}),
    0x6041: ("H", {0: 0}),
    0x605A: ("h", {0: 1}),
    0x605E: ("h", {0: 1}),
    0x6060: ("b", {0: 0}),
    0x6061: ("b", {0: 0}),
    0x6064: ("i", {0: 0}),
    0x6065: ("I", {0: 100000}),
    0x606C: ("i", {0: 0}),
    0x6071: ("h", {0: 0}),
    0x6072: ("H", {0: 5000}),
    0x6075: ("I", {0: 1000}),
    0x6076: ("I", {0: 2000}),
    0x6077: ("h", {0: 0}),
    0x6078: ("h", {0: 0}),
    0x607D: ("i", {1: -(2**31), 2: 2**31 - 1}),
    0x607F: ("I", {0: 2**32 - 1}),
    0x6080: ("I", {0: 3000}),
    0x6083: ("I", {0: 1000}),
    0x6084: ("I", {0: 1000}),
    0x6085: ("I", {0: 1000}),
    0x6087: ("I", {0: 1000}),
    0x608F: ("I", {1: 1 << 20, 2: 1}),
    0x6091: ("I", {1: 1, 2: 1}),
    0x60A9: ("I", {0: 0xFDB44700}),  # 1/1000 of 1/min
    0x60C5: ("I", {0: 2**32 - 1}),
    0x60C6: ("I", {0: 2**32 - 1}),
    0x60E0: ("H", {0: 5000}),
    0x60E1: ("H", {0: 5000}),
    0x60FF: ("i", {0: 0}),
}
RECORDS: dict[int, tuple[str, ...]] = {
    **{0x1400 + n: ("B", "I", "B") for n in range(3)},
    **{0x1600 + n: ("B", "I", "I", "I") for n in range(3)},
    **{0x1800 + n: ("B", "I", "B") for n in range(2)},
    **{0x1A00 + n: ("B", "I", "I", "I") for n in range(2)},
    0x60C2: ("B", "B", "b"),
}
STATUS = {
    "switch on disabled": 0x0240,
    "ready": 0x0231,
    "switched on": 0x0233,
    "enabled": 0x0237,
    "quick stop": 0x0217,
    "fault reaction": 0x021F,
    "fault": 0x0208,
}
OFF = ("switch on disabled", "ready", "fault")
TICK = 0.005
"""s of the wall clock between two looks at it."""
STEP = 1e-3
"""s of the axis."""
STRIBECK, PRESLIDING = 0.02, 0.01
"""rad/s, rad."""
RATED = 2.0
"""N m."""
STILL = 1e-3
"""rad/s; slower it is at rest."""
NOTHING = 1e-9
"""N m, rad/s, rad; with less, a drive that is off moves nowhere."""
NO_SYNC = 0.5
"""s of the wall clock after which an enabled axis goes on without SYNC."""


def dictionary(lacking: tuple[int, ...] = ()) -> canopen.ObjectDictionary:
    found = canopen.ObjectDictionary()
    for index, (code, values) in OBJECTS.items():
        if index in lacking or not code:
            continue
        parts = {sub: (code, value) for sub, value in values.items()}
        _add(found, index, parts)
    for index, codes in RECORDS.items():
        if index not in lacking:
            _add(found, index, {sub: (code, 0) for sub, code in enumerate(codes)})
    return found


def _add(to: canopen.ObjectDictionary, index: int, parts: dict[int, tuple[str, int]]) -> None:
    record = ODRecord(f"{index:04X}", index)
    for sub, (code, value) in parts.items():
        variable = ODVariable(f"{index:04X}:{sub}", index, sub)
        variable.data_type, variable.default = SIZES[code], value
        variable.access_type = "rw"
        record.add_member(variable)
    to.add_object(record[0] if set(parts) == {0} else record)


class SimulatedDrive:
    """One drive.

    Attributes:
        peak_friction: the largest torque of it (N m) while it was enabled last.
        log: what happened, in order: ("word", w), ("state", name, angle), ("moves", angle),
            ("rest", angle).
        quirks: what is wrong with it; see the tests.
        speed: of its clock for heartbeats and rest, where the relay's is faster, too.
    """

    def __init__(
        self,
        channel: Any,
        node: int = 5,
        *,
        coulomb: float = 1.0,
        static: float = 1.5,
        viscous: float = 0.5,
        lacking: tuple[int, ...] = (),
        stiff: tuple[int, ...] = (),
        **quirks: Any,
    ) -> None:
        self.inertia, self.coulomb, self.static, self.viscous = 0.1, coulomb, static, viscous
        self.quirks, self.stiff, self.speed = quirks, stiff, float(quirks.pop("speed", 1.0))
        self.log: list[tuple[Any, ...]] = []
        self.state, self.rate, self.angle, self.torque = "switch on disabled", 0.0, 0.0, 0.0
        self.bristle, self.moves, self.peak_friction = 0.0, False, 0.0
        self.peak_rate = 0.0
        self.reference = self.ramp = self.integral = 0.0
        self.error = self.last = 0
        self.operational = self.closed = False
        self.syncs = self.counter = 0
        self._beat: float | None = None  # own time since the last heartbeat; None before the first
        self._since_sync = math.inf
        self._codes: dict[tuple[int, int], str] = {}
        self._owed = 0.0  # s of the axis that are less than a step
        self._lock, self._then = threading.RLock(), time.monotonic()
        self.on_read: Callable[[int], None] = lambda index: None
        self.on_sync: Callable[[int], None] = lambda count: None
        bus = can.Bus(interface="virtual", channel=channel)
        self.network = canopen.Network(bus)
        self.network.NOTIFIER_CYCLE = 0.05
        self.network.connect()
        self.node = self.network.create_node(node, dictionary(lacking))
        self.node.add_read_callback(self._reads)
        self.node.add_write_callback(self._writes)
        self.network.subscribe(0, self._nmt)
        self.network.subscribe(0x80, self._sync)
        self.network.subscribe(0x700 + 127, self._heartbeat)
        for number in range(3):
            self.network.subscribe(0x200 + 0x100 * number + node, self._rpdo)
        self._clock = threading.Thread(target=self._ticks, daemon=True)
        self._clock.start()

    def close(self) -> None:
        self.closed = True
        self._clock.join(5)
        self.network.disconnect()

    def __enter__(self) -> SimulatedDrive:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    # Questions of tests

    def get(self, index: int, sub: int = 0) -> int:
        data = self.node.data_store.get(index, {}).get(sub)
        if data is None or index in self.quirks.get("stubborn", ()):
            data = self.node.get_data(index, sub)
        return int.from_bytes(data, "little", signed=self._code(index, sub).islower())

    def put(self, index: int, value: int, sub: int = 0) -> None:
        code = self._code(index, sub)
        self.node.data_store.setdefault(index, {})[sub] = struct.pack("<" + code, value)

    def _code(self, index: int, sub: int) -> str:
        if (index, sub) not in self._codes:
            found = self.node._find_object(index, sub).data_type
            self._codes[index, sub] = next(code for code, size in SIZES.items() if size == found)
        return self._codes[index, sub]

    def wait(self, condition: Callable[[], bool], patience: float = 60.0) -> None:
        deadline = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < deadline, self.log[-20:]
            time.sleep(0.005)

    def at_rest_and_off(self) -> bool:
        return self.state in OFF and not self.moves

    # The bus

    def _nmt(self, cob: int, data: bytearray, timestamp: float) -> None:
        if data[1] in (0, self.node.id):
            self.operational = data[0] == 1

    def _heartbeat(self, cob: int, data: bytearray, timestamp: float) -> None:
        self._beat = 0.0

    def _rpdo(self, cob: int, data: bytearray, timestamp: float) -> None:
        if not self.operational:
            return
        for number in range(3):
            if self.get(0x1400 + number, 1) != cob:
                continue
            for entry in range(1, 1 + self.get(0x1600 + number, 0)):
                mapped = self.get(0x1600 + number, entry)
                index, size = mapped >> 16, (mapped & 0xFF) // 8
                value = int.from_bytes(data[:size], "little", signed=index != 0x6040)
                data = data[size:]
                self.put(index, value)
                if index == 0x6040:
                    self.control(value)

    def _sync(self, cob: int, data: bytearray, timestamp: float) -> None:
        if not self.operational or cob != 0x80:
            return
        with self._lock:
            counts = self.get(0x1019) if 0x1019 in self.node.object_dictionary else 0
            assert len(data) == (1 if counts else 0), "SYNC and 1019h differ"
            if counts and data[0] == self.counter:
                return  # the same SYNC again
            if counts:
                self.counter = data[0]
                self.syncs = 0 if data[0] == 1 else self.syncs
            self.syncs += 1
            self._since_sync = 0.0
            self.on_sync(self.syncs)
            if not self.operational:
                return
            for number in range(2):
                cob = self.get(0x1800 + number, 1)
                count = self.get(0x1A00 + number, 0)
                entries = [self.get(0x1A00 + number, n) for n in range(1, 1 + count)]
                raw = b"".join(self._value(each >> 16) for each in entries)
                for _ in range(self.quirks.get("frames", lambda syncs: 1)(self.syncs)):
                    self.network.send_message(cob, raw)
            self._advance(max(STEP, self.get(0x1006) * 1e-6))

    def _value(self, index: int) -> bytes:
        code = self._code(index, 0)
        return struct.pack("<" + code, int(self._measured(index)))

    def _measured(self, index: int) -> float:
        per_turn = 2 * math.pi
        noise, draw = self.quirks.get("noise", 0.0), random.Random(self.syncs)
        limited = 0x0800 if self.quirks.get("limit bit") else 0
        values = {
            0x6041: STATUS[self.state] | limited,
            0x6061: self.get(0x6060),
            0x6064: round(self.angle / per_turn * (1 << 20) * self.quirks.get("scale", 1)),
            0x606C: round(
                (self.rate + draw.gauss(0.0, 0.1 * noise))
                / per_turn
                * 60e3
                * self.quirks.get("sign", 1)
            ),
            0x6077: round((self.torque + draw.gauss(0.0, noise)) / RATED * 1000),
            0x6078: round(self.torque / RATED * 1000),
            0x603F: self.error,
        }
        return values[index] if index in values else self.get(index)

    def _reads(self, *, index: int, subindex: int, od: Any) -> int | None:
        if index in self.quirks.get("stubborn", ()):
            return int(od.default)  # whatever was written
        if index in (0x6041, 0x6061, 0x6064, 0x606C, 0x6077, 0x6078, 0x603F):
            self._pass_time()  # a busy machine shows no moving axis at rest
            value = int(self._measured(index))
            self.on_read(index)
            return value
        return None

    def _writes(self, *, index: int, subindex: int, od: Any, data: bytes) -> None:
        if index in self.stiff:
            raise canopen.SdoAbortedError(0x06090030)
        if index == 0x6040:
            self.control(int.from_bytes(data, "little"))

    # The state machine (CiA 402-2, figure 7 and table 31)

    def become(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self.log.append(("state", state, self.angle))
            self.integral, self.reference, self.ramp = 0.0, self.rate, 0.0
            self.peak_friction *= state != "enabled"

    def control(self, word: int) -> None:  # noqa: C901 - a table of the standard
        with self._lock:
            self.log.append(("word", word))
            rises, self.last = word & 0x80 and not self.last & 0x80, word
            state = self.state
            if state == "fault":
                if rises:
                    self.error = 0
                    self.become("switch on disabled")
            elif state == "fault reaction":
                pass
            elif not word & 0x02:
                self.become("switch on disabled")
            elif not word & 0x04:
                if state in ("ready", "switched on"):
                    self.become("switch on disabled")
                elif state == "enabled" and "ignores quick stop" not in self.quirks:
                    option = self.get(0x605A)
                    self.become("quick stop" if option else "switch on disabled")
            elif not word & 0x01:
                if state in ("switch on disabled", "switched on", "enabled"):
                    self.become("ready")
            elif not word & 0x08:
                if state in ("ready", "enabled"):
                    self.become("switched on")
            elif state in ("switched on", "quick stop"):
                self.become("enabled")

    def fail(self, code: int) -> None:
        """A fault of its own: reaction, EMCY, and then the state fault."""
        with self._lock:
            self.error = code
            self.become("fault reaction" if self.state in ("enabled", "quick stop") else "fault")
        self.node.emcy.send(code, 1, b"")

    def _lost_heartbeat(self) -> None:
        self._beat = None
        if "no reaction" in self.quirks:
            return
        self.operational = self.operational and self.get(0x1029, 1) == 1
        if 0x6007 in self.node.object_dictionary and self.get(0x6007):
            self.fail(0x8130)

    # The axis

    def _ticks(self) -> None:
        while not self.closed:
            time.sleep(TICK)  # what it takes longer is a busy machine, and no silence
            with self._lock:
                timeout = (
                    self.get(0x1016, 1) & 0xFFFF if 0x1016 in self.node.object_dictionary else 0
                )
                if self._beat is not None:
                    self._beat += TICK * self.speed
                    if timeout and self._beat > timeout * 1e-3:
                        self._lost_heartbeat()
                self._since_sync += TICK
            self._pass_time()

    def _pass_time(self) -> None:
        """Of the axis, up to now, while no SYNC moves it."""
        with self._lock:
            now = time.monotonic()
            passed, self._then = min(now - self._then, 4 * TICK), now
            if self.state != "enabled":
                self._advance(passed * self.speed)
            elif self._since_sync > NO_SYNC:
                self._advance(passed)

    def _advance(self, duration: float) -> None:
        if self.state in OFF and max(map(abs, (self.torque, self.rate, self.bristle))) < NOTHING:
            return
        self._owed += duration
        steps = round(self._owed / STEP)
        self._owed -= steps * STEP
        for _ in range(steps):
            self.torque = self._drive()
            self._move()
            if self.moves != (abs(self.rate) > (0.5 if self.moves else 1.0) * STILL):
                self.moves = not self.moves
                self.log.append(("moves" if self.moves else "rest", self.angle))

    def _drive(self) -> float:
        """Torque of the next step."""
        limits = [i for i in (0x6072, 0x60E0, 0x60E1) if i in self.node.object_dictionary]
        most = min([5000, *map(self.get, limits)]) * 1e-3 * RATED
        unit = 60e3 / (2 * math.pi)
        if self.state in ("quick stop", "fault reaction"):
            self._slew(0.0, self.get(0x6085) / unit)
            if abs(self.rate) < STILL and self.reference == 0.0:
                stays = self.state == "quick stop" and self.get(0x605A) >= 5
                if not stays:
                    self.become("fault" if self.state == "fault reaction" else "switch on disabled")
                return 0.0
        elif self.state != "enabled":
            return 0.0
        elif self.get(0x6060) == 3:
            most_rate = self._fastest(unit)
            target = self.get(0x60FF) / unit
            self._slew(max(-most_rate, min(target, most_rate)), self.get(0x6083) / unit)
        else:
            return self._limited_torque(most, unit)
        return self._rate_loop(self.reference, most)

    def _fastest(self, unit: float) -> float:
        scales = {0x607F: unit, 0x6080: 60 / (2 * math.pi)}
        there = [self.get(i) / scales[i] for i in scales if i in self.node.object_dictionary]
        return min([1e3, *there])

    def _slew(self, target: float, slope: float) -> None:
        step = slope * STEP
        self.reference += max(-step, min(target - self.reference, step))

    def _rate_loop(self, reference: float, most: float) -> float:
        error = reference - self.rate
        self.integral = max(-most, min(self.integral + 200.0 * error * STEP, most))
        return max(-most, min(10.0 * error + self.integral, most))

    def _limited_torque(self, most: float, unit: float) -> float:
        """Torque mode: a rate loop takes over at the limit of speed."""
        target = self.get(0x6071) * 1e-3 * RATED
        step = self.get(0x6087) * 1e-3 * RATED * STEP
        self.ramp += max(-step, min(target - self.ramp, step))
        torque = max(-most, min(self.ramp, most))
        fastest = self._fastest(unit)
        if "no speed limit" in self.quirks:
            return torque
        way = math.copysign(1.0, torque)
        limit = 20.0 * (fastest - way * self.rate) + self.integral
        self.integral += 400.0 * (fastest - way * self.rate) * STEP
        self.integral = max(0.0, min(self.integral, abs(torque)))
        return way * max(-most, min(abs(torque), limit))

    def _move(self) -> None:
        """LuGre: bristles with a Stribeck curve, their damping and the viscous part implicit."""
        before = self.rate
        fall = math.exp(-((before / STRIBECK) ** 2))
        level = self.coulomb + (self.static - self.coulomb) * fall
        stiffness = self.static / PRESLIDING
        damping = 1.6 * math.sqrt(stiffness * self.inertia)
        # dz/dt = v (1 - sign(v) stiffness z / level)
        slip = 1.0 - math.copysign(1.0, before) * stiffness * self.bristle / level
        damping *= slip
        free = self.torque - stiffness * self.bristle
        self.rate = (before + STEP / self.inertia * free) / (
            1.0 + STEP / self.inertia * (damping + self.viscous)
        )
        self.bristle += STEP * (self.rate - stiffness * abs(self.rate) / level * self.bristle)
        rate = 0.5 * (before + self.rate)
        self.angle += rate * STEP
        friction = self.torque - self.inertia * (self.rate - before) / STEP
        self.peak_rate = max(self.peak_rate, abs(self.rate))
        if self.state == "enabled":
            self.peak_friction = max(self.peak_friction, abs(friction))
