"""Whoever stops need not match versions: old and new ends of the line, both ways round."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.link.port import open_port
from campaign.wire.frames import FrameDecoder, encode_frame
from tests.link.controllers import controller
from tests.link.old_controller import ACK, SAFE, STATUS, OldController
from tests.system.user import SEA, campaign, write

ON = ("--backend", "serial", "--set", "backend.motion=emulated", "--yes")


def test_a_new_stop_on_an_old_controller_says_that_it_is_not_latched(tmp_path: Path) -> None:
    with OldController() as old:
        done = campaign(tmp_path, "stop", "--port", old.port)
    assert done.out == "safe now, not latched\n"
    assert "switch the drive on again" in done.err
    assert old.stops > 1


def test_a_run_asks_for_the_new_version(tmp_path: Path) -> None:
    write(tmp_path, SEA)
    with OldController() as old:
        done = campaign(tmp_path, "run", "protocol.toml", *ON, "--port", old.port, code=3)
    assert "speaks versions 1 to 1" in done.err
    assert "update its firmware" in done.err
    assert not list(tmp_path.glob("results/*"))
    assert old.stops == 0  # it is not ours, and nobody moved it


@pytest.mark.parametrize("body", [b"", b"whatever it holds"])
def test_an_old_stop_is_confirmed_by_a_new_controller_and_latches_it(
    tmp_path: Path, body: bytes
) -> None:
    with controller("--speed", "max", bench="simulink") as port:
        line, decoder = open_port(port, 115_200, exclusive=False), FrameDecoder()
        line.write(encode_frame(SAFE, 0, body))
        kinds: list[int] = []
        while not {ACK, STATUS} <= set(kinds):
            kinds += [frame.kind for frame in decoder.feed(line.read())]
        line.close()
        status = campaign(tmp_path, "status", "--port", port).out
        assert "stopped by an unnamed host" in status
