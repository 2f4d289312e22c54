"""The relay: a process that keeps the port, sends heartbeats by itself, and SAFE at the end."""

from __future__ import annotations

import socket
import subprocess
import sys

import pytest

from campaign.errors import UsageError
from campaign.link.connection import Connection, LineLostError
from campaign.link.port import open_port
from campaign.wire.codes import Kind
from campaign.wire.frames import Frame, FrameDecoder
from campaign.wire.messages import Heartbeat, decode


@pytest.fixture
def line() -> tuple[Connection, socket.socket]:
    """A connection, and the other end of its port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        connection = Connection(f"socket://127.0.0.1:{server.getsockname()[1]}", 115_200)
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


def test_when_the_parent_goes_it_sends_safe(line) -> None:
    connection, there = line
    heard = Heard(there)
    heard.next()
    connection._out.close()  # as when the host is killed
    while heard.next().kind != Kind.SAFE:
        pass


def test_a_line_that_is_cut_is_an_error_and_no_hang(line) -> None:
    connection, there = line
    there.close()

    def until_lost() -> None:
        while True:
            connection.receive(5.0)

    with pytest.raises(LineLostError):
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
