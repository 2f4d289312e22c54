"""A rehearsal controller as a process of its own, for tests across a real byte stream."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.system.user import begun


@contextmanager
def controller(*options: str, bench: str = "platform", pty: bool = False) -> Iterator[str]:
    """The port of a running `campaign device`."""
    line = ["--pty"] if pty else ["--tcp", "127.0.0.1:0"]
    process = begun(Path(__file__).parent, "device", "--bench", bench, *line, *options)
    with process:
        try:
            port = process.stdout.readline().strip()
            assert port, process.stderr.read()
            yield port
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=20)
