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
        self.log: list[str] = []  # all that was answered since `new`
        self._answer()

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
        if words[0] == "new":
            self.log.clear()
        print(*words, file=self._process.stdin, flush=True)
        lines = self._answer()
        self.log += lines
        return lines

    def _answer(self) -> list[str]:
        assert self._process.stdout
        lines = []
        while (line := self._process.stdout.readline()) != ".\n":
            assert line, "the program ended"
            lines.append(line.rstrip("\n"))
        return lines

    def messages(self, *words: object) -> list[wire.Message]:
        """What the device sends upon one command; each must be a good frame and message."""
        return [what for what in self.doings(*words) if not isinstance(what, str)]

    def doings(self, *words: object) -> list[wire.Message | str]:
        """What the device does upon one command, in its order: messages, and calls of hooks."""
        done: list[wire.Message | str] = []
        for line in self.do(*words):
            if line.startswith("sent "):
                [frame] = self._decoder.feed(bytes.fromhex(line[5:]))
                done.append(wire.decode(frame.kind, frame.body))
            else:
                done.append(line)
        return done

    def send(self, sequence: int, message: wire.Message) -> list[wire.Message]:
        """What the device answers."""
        return self.messages("receive", self.now, _frame(sequence, message))

    def upon(self, sequence: int, message: wire.Message) -> list[wire.Message | str]:
        """What the device does and answers, in its order."""
        return self.doings("receive", self.now, _frame(sequence, message))

    def wait(self, microseconds: int) -> list[wire.Message]:
        """What the device sends while time goes by."""
        self.now += microseconds
        return self.messages("tick", self.now)


def _frame(sequence: int, message: wire.Message) -> str:
    kind, body = wire.encode(message)
    return encode_frame(kind, sequence, body).hex()
