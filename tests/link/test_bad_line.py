"""The line with faults does what it says: else nothing would be known of who survives it."""

from __future__ import annotations

import itertools
import socket

import pytest

from tests.link.bad_line import Block, Damage, Trouble, bad_line, schedule

TEXT = bytes(range(20))


def through(*blocks: Block, data: bytes = TEXT, step: int = 20) -> bytes:
    """What comes out of `data` that goes in in pieces of `step` bytes."""
    damage = Damage(iter(blocks))
    sent = b""
    for start in range(0, len(data), step):
        for item in damage.feed(data[start : start + step]):
            sent += item if isinstance(item, bytes) else b""
    return sent


@pytest.mark.parametrize("step", [1, 3, 20])
@pytest.mark.parametrize(
    ("trouble", "expected"),
    [
        (None, TEXT),
        (Trouble.DROP, TEXT[:5] + TEXT[9:]),
        (Trouble.DUPLICATE, TEXT[:9] + TEXT[5:]),
        (Trouble.SWAP, TEXT[:5] + TEXT[9:12] + TEXT[5:9] + TEXT[12:]),
        (Trouble.DELAY, TEXT),
        (Trouble.DRIBBLE, TEXT),
        (Trouble.DEAF, TEXT[:5]),
    ],
)
def test_bytes_five_to_eight(trouble: Trouble | None, expected: bytes, step: int) -> None:
    assert through(Block(5), Block(4, trouble), Block(3), step=step) == expected


def test_the_pauses() -> None:
    slow = Damage(iter([Block(2), Block(3, Trouble.DELAY, 0.25), Block(2, Trouble.DRIBBLE)]))
    steps = list(slow.feed(TEXT[:9]))
    assert steps[:3] == [TEXT[:2], 0.25, TEXT[2:5]]
    assert [step for step in steps[3:7] if isinstance(step, bytes)] == [b"\5", b"\6"]
    assert steps[-1] == TEXT[7:9]


def test_a_reset_comes_at_its_place() -> None:
    damage = Damage(iter([Block(5), Block(1, Trouble.RESET)]))
    assert list(damage.feed(TEXT[:5])) == [TEXT[:5]]
    with pytest.raises(ConnectionResetError):
        list(damage.feed(TEXT[5:]))


def test_a_seed_is_a_schedule_and_the_rates_are_kept() -> None:
    rates = {Trouble.DROP: 0.1, Trouble.SWAP: 0.02}

    def first(seed: int) -> list[Block]:
        return list(itertools.islice(schedule(seed, rates, 500), 5000))

    assert first(1) == first(1) != first(2)
    assert first(1)[0] == Block(500)
    dropped = sum(block.trouble is Trouble.DROP for block in first(1))
    assert 400 < dropped < 600  # 500 expected, standard deviation 21


def echo() -> socket.socket:
    server = socket.create_server(("127.0.0.1", 0))
    server.settimeout(30)
    return server


def connected(port: str) -> socket.socket:
    host, _, number = port.removeprefix("socket://").rpartition(":")
    return socket.create_connection((host, int(number)), timeout=30)


def test_over_sockets() -> None:
    """Dropped out, doubled back; then whoever comes again goes on in the same schedule."""
    with echo() as server:
        port = f"socket://127.0.0.1:{server.getsockname()[1]}"
        out = [Block(2), Block(2, Trouble.DROP), Block(4), Block(1, Trouble.RESET), Block(9)]
        back = [Block(3, Trouble.DUPLICATE)]
        with bad_line(port, out, back) as line:
            near = connected(line.port)
            far, _ = server.accept()
            far.settimeout(30)
            near.sendall(b"abcdefgh")
            assert _exactly(far, 6) == b"abefgh"
            far.sendall(b"xyz")
            assert _exactly(near, 6) == b"xyzxyz"
            near.sendall(b"!")
            assert _ended(near)
            assert _ended(far)
            again = connected(line.port)
            far2, _ = server.accept()
            far2.settimeout(30)
            again.sendall(b"abcd")
            assert _exactly(far2, 4) == b"abcd"
            for end in (near, far, again, far2):
                end.close()


def test_a_half_open_line_tells_nobody() -> None:
    with echo() as server:
        port = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with bad_line(port, [Block(2), Block(1, Trouble.DEAF)]) as line:
            near = connected(line.port)
            far, _ = server.accept()
            far.settimeout(30)
            near.sendall(b"abcd")
            assert _exactly(far, 2) == b"ab"
            far.sendall(b"still there")
            assert _exactly(near, 11) == b"still there"
            near.close()
            far.settimeout(0.3)
            with pytest.raises(TimeoutError):
                far.recv(1)
            far.close()


def _exactly(end: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = end.recv(count - len(data))
        assert more, data
        data += more
    return data


def _ended(end: socket.socket) -> bool:
    try:
        return end.recv(1) == b""
    except ConnectionResetError:
        return True
