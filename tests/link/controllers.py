"""A rehearsal controller as a process of its own, for tests across a real byte stream."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.system.user import command, environment


@contextmanager
def controller(*options: str, bench: str = "platform", pty: bool = False) -> Iterator[str]:
    """The port of a running `campaign device`."""
    line = ["--pty"] if pty else ["--tcp", "127.0.0.1:0"]
    with subprocess.Popen(
        command("device", "--bench", bench, *line, *options),
        cwd=Path(__file__).parent,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        stdin=subprocess.DEVNULL,
        text=True,
    ) as process:
        try:
            port = process.stdout.readline().strip()
            assert port, "the device did not start"
            yield port
        finally:
            process.terminate()
            process.wait(timeout=20)
