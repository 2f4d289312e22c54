"""What the tests of the device in C have in common: a host, and ways into every state."""

from __future__ import annotations

from campaign.wire import messages as wire
from campaign.wire.messages import State

from .console import Console

PARAMETERS: dict[str, wire.Value] = {
    "task.mode": "rate",
    "task.duration": 1.5,
    "rehearsal.seed": -3,
    "task.values": (0.5, -1e-300, 3.0),
    "task.hold": True,
}
SETS = wire.parameter_messages(PARAMETERS)
CRC = wire.configuration_crc(wire.encode(message)[1] for message in SETS)
TRIAL = 7
OURS, OTHERS = 42, 43
"""Sessions: of the host that `bring_to` is, and of another one."""


def hello(session: int = OURS, host: str = "ada@lab-3") -> wire.Hello:
    return wire.Hello(2, 2, session, host)


def only(kind: type, found: list) -> list:
    return [message for message in found if isinstance(message, kind)]


def heartbeat(console: Console, counter: int = 1, following: int = 0) -> wire.Status:
    beat = wire.Heartbeat(counter, TRIAL, following, OURS)
    [status] = only(wire.Status, console.send(0, beat))
    return status


def bring_to(console: Console, state: State, records: int = 16, past: str = "") -> None:
    """A new device, led to `state`; the next command has the number `following(state)`."""
    console.do("new", records, *past.split())
    console.now = 0
    console.send(0, hello())
    heartbeat(console)
    commands = [SETS[0], wire.Arm(CRC), wire.Start(TRIAL), wire.Stop()]
    wanted = {State.CONFIGURED: 1, State.ARMED: 2, State.RUNNING: 3, State.ENDED: 4}
    for number, command in enumerate(commands[: wanted.get(state, 0)], start=1):
        [ack] = only(wire.Ack, console.send(number, command))
        assert ack.sequence == number
    if state is State.SAFE:
        console.send(0, wire.Safe(OURS))
    if state is State.FAULT:
        console.do("finish", 3, int(wire.Fault.DRIVE), "-")
    assert heartbeat(console).state is state


def following(state: State) -> int:
    """The number of the next command after `bring_to`."""
    order = [State.IDLE, State.CONFIGURED, State.ARMED, State.RUNNING, State.ENDED]
    return 1 + (order.index(state) if state in order else 0)


def take(console: Console, first: int, count: int = 2) -> list[wire.Message]:
    return console.messages("samples", first, count, bytes(count * 10).hex())


def asked(console: Console) -> tuple[wire.Status, wire.Latch, wire.Holder]:
    """What the device says of itself to anybody."""
    status, latch, holder = console.send(0, wire.Query())[:3]
    assert isinstance(status, wire.Status)
    assert isinstance(latch, wire.Latch)
    assert isinstance(holder, wire.Holder)
    return status, latch, holder
