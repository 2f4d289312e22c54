"""The relay: a process that keeps the port, sends heartbeats by itself, and SAFE at the end."""

from __future__ import annotations

import io
import socket
import subprocess
import sys
import threading
import time

import pytest

from campaign.errors import UsageError
from campaign.link.connection import Connection
from campaign.link.errors import SilenceError
from campaign.link.port import open_port
from campaign.link.relay import Relay
from campaign.wire.codes import Fault, Kind, State
from campaign.wire.frames import Frame, FrameDecoder, encode_frame
from campaign.wire.messages import Ack, Bye, Heartbeat, Safe, Status, decode, encode

SESSION = 0x12345678


@pytest.fixture
def line() -> tuple[Connection, socket.socket]:
    """A connection, and the other end of its port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        connection = Connection(f"socket://127.0.0.1:{server.getsockname()[1]}", 115_200, SESSION)
        there, _ = server.accept()
    there.settimeout(10.0)
    yield connection, there
    there.close()
    connection.close()


class Heard:
    """What arrives at the controller's end."""

    def __init__(self, there: socket.socket) -> None:
        self._there, self._decoder = there, FrameDecoder()
        self._frames: list[Frame] = []

    def next(self) -> Frame:
        while not self._frames:
            data = self._there.recv(4096)
            assert data, "the line was closed"
            self._frames += self._decoder.feed(data)
        return self._frames.pop(0)

    def until_the_end(self) -> list[Frame]:
        """What comes until the line is closed."""
        frames, self._frames = self._frames, []
        while data := self._there.recv(4096):
            frames += self._decoder.feed(data)
        return frames


def test_heartbeats_go_on_by_themselves_and_say_what_is_wanted(line) -> None:
    connection, there = line
    heard = Heard(there)
    first = decode(heard.next().kind, heard.next().body)
    assert isinstance(first, Heartbeat)
    connection.wanted(5, 77)
    while True:
        beat = decode(Kind.HEARTBEAT, heard.next().body)
        if beat.trial == 5:
            break
    assert beat.next == 77
    assert beat.session == first.session == SESSION
    assert beat.counter > first.counter


def test_bytes_pass_both_ways_unchanged(line) -> None:
    connection, there = line
    everything = bytes(range(256)) * 40
    there.sendall(everything)
    came = b""
    while len(came) < len(everything):
        came += connection.receive(5.0)
    assert came == everything
    connection.write(b"\0hello there\0")
    came = b""
    while b"hello there" not in came:
        came += there.recv(4096)


def status(*, drive_on: bool, heartbeat: int = 1) -> bytes:
    """What a controller answers to SAFE."""
    message = Status(State.SAFE, Fault.NONE, True, drive_on, 1, 0.0, heartbeat, 0.0, 0, 0, 0, 0)
    kind, body = encode(message)
    return encode_frame(kind, 0, body)


ACKNOWLEDGED = encode_frame(Kind.ACK, 0, encode(Ack(0, Kind.SAFE, State.SAFE, 1))[1])


def last_words(frames: list[Frame]) -> list[Frame]:
    """What is no heartbeat."""
    return [frame for frame in frames if frame.kind != Kind.HEARTBEAT]


def leave(connection: Connection) -> None:
    connection._out.close()  # as when the host is killed


def test_when_the_parent_goes_it_sends_its_sessions_safe_until_confirmed_and_then_bye(line) -> None:
    connection, there = line
    heard = Heard(there)
    connection.holds(held=True)
    heard.next()
    leave(connection)
    while (frame := heard.next()).kind == Kind.HEARTBEAT:
        pass
    assert decode(frame.kind, frame.body) == Safe(SESSION)  # the holder's: it latches nothing
    there.sendall(status(drive_on=False))
    assert decode(Kind.SAFE, heard.next().body) == Safe(SESSION)  # it was said before it heard us
    there.sendall(ACKNOWLEDGED + status(drive_on=True))
    assert decode(Kind.SAFE, heard.next().body) == Safe(SESSION)  # that was no confirmation
    there.sendall(status(drive_on=False))
    *safes, bye = heard.until_the_end()
    assert {frame.kind for frame in last_words(safes)} <= {Kind.SAFE}
    assert decode(bye.kind, bye.body) == Bye(SESSION)
    assert connection._relay.wait(10.0) == 0


@pytest.mark.slow
def test_an_orphan_that_nobody_confirms_says_so_after_its_last_words(line) -> None:
    connection, there = line
    heard = Heard(there)
    connection.holds(held=True)
    heard.next()
    leave(connection)
    frames = heard.until_the_end()
    *safes, bye = last_words(frames)
    assert len(safes) > 20
    after = frames[frames.index(safes[0]) :]
    assert len(after) - len(last_words(after)) <= 1  # a heartbeat that was under way
    assert {decode(frame.kind, frame.body) for frame in safes} == {Safe(SESSION)}
    assert bye.kind == Kind.BYE
    assert connection._relay.wait(10.0) == 5


@pytest.mark.parametrize("holds", [(), (False,), (True, False)])
def test_a_relay_that_does_not_hold_the_controller_leaves_without_a_word(
    line, holds: tuple[bool, ...]
) -> None:
    """Its SAFE would be a stranger's, and stop whoever holds it."""
    connection, there = line
    heard = Heard(there)
    heard.next()
    for held in holds:
        connection.holds(held=held)
    leave(connection)
    assert last_words(heard.until_the_end()) == []
    assert connection._relay.wait(10.0) == 0


def test_closing_says_the_last_words_and_can_be_told_not_to(line) -> None:
    connection, there = line
    heard = Heard(there)
    heard.next()
    connection.holds(held=True)
    connection.close(last_words=False)
    assert last_words(heard.until_the_end()) == []


def test_a_line_that_is_cut_is_an_error_and_no_hang(line) -> None:
    connection, there = line
    there.close()

    def until_lost() -> None:
        while True:
            connection.receive(5.0)

    with pytest.raises(SilenceError, match="connection was lost"):
        until_lost()


def test_the_relay_needs_neither_numpy_nor_pydantic() -> None:
    code = (
        "import sys, campaign.link.relay; "
        "sys.exit(any(name in sys.modules for name in ('numpy', 'pydantic', 'serial')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_port_that_is_not_one_is_explained() -> None:
    for name in ("socket://", "socket://host", "socket://host:no"):
        with pytest.raises(UsageError, match="socket://HOST:PORT"):
            open_port(name, 115_200, exclusive=False)


def test_without_pyserial_the_message_says_how_to_get_it(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(UsageError, match=r"campaign\[serial\]"):
        open_port("/dev/ttyUSB0", 115_200, exclusive=False)


class ControllerAtHand:
    """A port whose controller answers every heartbeat with the counter that it heard last."""

    def __init__(self, others: int | None) -> None:
        """`others`: the counter of the host that holds it; None when it is ours."""
        self._others = others
        self._decoder = FrameDecoder()
        self._answers: list[bytes] = []
        self.heard: list[Kind] = []
        self._closed = False

    def read(self) -> bytes:
        if self._closed:
            raise OSError
        time.sleep(0.001)
        return self._answers.pop(0) if self._answers else b""

    def write(self, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            self.heard.append(Kind(frame.kind))
            message = decode(frame.kind, frame.body)
            if isinstance(message, Heartbeat):
                counter = message.counter if self._others is None else self._others
                self._answers.append(status(drive_on=False, heartbeat=counter))
            if isinstance(message, Safe):
                self._answers.append(ACKNOWLEDGED + status(drive_on=False))

    def close(self) -> None:
        self._closed = True


@pytest.mark.parametrize(("lapsed", "others"), [(True, 7), (True, None), (False, 7)])
def test_after_a_lapse_an_orphan_makes_sure_that_the_controller_is_not_anothers(
    lapsed: bool, others: int | None
) -> None:
    """A computer that slept may have lost it: SAFE would stop the run of whoever has it now."""
    port = ControllerAtHand(others)
    relay = Relay(port, io.BytesIO(), SESSION)
    relay._holds, relay._lapsed = True, lapsed
    reading = threading.Thread(target=relay._read, daemon=True)
    reading.start()
    assert relay.make_safe()
    port.close()
    reading.join()
    assert (Kind.SAFE in port.heard) == (not lapsed or others is None)
