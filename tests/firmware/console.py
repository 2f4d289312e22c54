"""The C reference on the other end of two pipes: see firmware/console.c."""

from __future__ import annotations

import subprocess
from pathlib import Path
from types import TracebackType

from campaign.wire import messages as wire
from campaign.wire.frames import FrameDecoder, encode_frame


class Console:
    """Commands in, lines out; for a device also messages in, messages out."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen(
            [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._decoder = FrameDecoder()
        self.now = 0  # microseconds

    def __enter__(self) -> Console:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: object, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.close()
        status = self._process.wait(timeout=60)
        self._process.stdout.close()
        assert kind is not None or status == 0

    def do(self, *words: object) -> list[str]:
        """What one command answers."""
        assert self._process.stdin
        assert self._process.stdout
        print(*words, file=self._process.stdin, flush=True)
        lines = []
        while (line := self._process.stdout.readline()) != ".\n":
            assert line, "the program ended"
            lines.append(line.rstrip("\n"))
        return lines

    def messages(self, *words: object) -> list[wire.Message]:
        """What the device sends upon one command; each must be a good frame and message."""
        found = []
        for line in self.do(*words):
            if line.startswith("sent "):
                [frame] = self._decoder.feed(bytes.fromhex(line[5:]))
                found.append(wire.decode(frame.kind, frame.body))
        return found

    def send(self, sequence: int, message: wire.Message) -> list[wire.Message]:
        """What the device answers."""
        kind, body = wire.encode(message)
        frame = encode_frame(kind, sequence, body)
        return self.messages("receive", self.now, frame.hex())

    def wait(self, microseconds: int) -> list[wire.Message]:
        """What the device sends while time goes by."""
        self.now += microseconds
        return self.messages("tick", self.now)
