"""The process that sees that whoever insists is obeyed, whatever the program hangs in.

Run by its path, with nothing but the standard library: `guardian.py PARENT`. The C handler of
Python writes each signal's number into our standard input, also while the program is inside a call
that never lets another of its threads run. We hand the numbers on to the program's watching thread
(standard output), and when the program has not ended soon after the second one, we end it.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time

NOTE = 0xFE
MAKING_SAFE = 0xFD
"""First bytes of what the program says itself, above all signal numbers: NOTE, its length (two
bytes) and a text, or just MAKING_SAFE."""
PIECE = 65536
"""bytes read at a time."""
STUCK = 1.5
"""s in which the program has to begin to leave once it was insisted."""
SAFE = 30.0
"""s that making the bench safe may take then."""
ASKING = (signal.SIGINT, signal.SIGTERM)
HANG_UP = getattr(signal, "SIGHUP", None)


class Asked:
    """Counts who asked the program to stop: a hang-up only asks, it does not insist."""

    def __init__(self) -> None:
        self.times = 0

    def add(self, number: int) -> None:
        """A signal came."""
        if number in ASKING or (number == HANG_UP and not self.times):
            self.times += 1


class Guardian:
    """What is known of the program; fed with the bytes of its pipe."""

    def __init__(self) -> None:
        self.note = b""
        self.deadline: float | None = None
        self._asked = Asked()
        self._left = b""

    def feed(self, data: bytes, now: float) -> bytes:
        """The signals in `data`, to be handed on."""
        data, signals = self._left + data, b""
        while data:
            if data[0] == NOTE:
                end = 3 + int.from_bytes(data[1:3])
                if len(data) < end:
                    break  # the rest is still to come
                self.note, data = data[3:end], data[end:]
                continue
            if data[0] == MAKING_SAFE:
                self.deadline = now + SAFE
            else:
                signals += data[:1]
                self._asked.add(data[0])
                if self._asked.times > 1 and self.deadline is None:
                    self.deadline = now + STUCK
            data = data[1:]
        self._left = data
        return signals


def main(parent: int) -> None:
    """Watch until the program has gone, or has to be ended. POSIX: Windows has no such signal."""
    guardian = Guardian()
    while True:
        due = guardian.deadline
        patience = None if due is None else max(0.0, due - time.monotonic())
        if not select.select([0], [], [], patience)[0]:
            os.kill(parent, signal.SIGKILL)
            os.write(2, b"\n" + guardian.note + b"\n")
            return
        data = os.read(0, PIECE)
        if not data:
            return
        signals = guardian.feed(data, time.monotonic())
        if signals:
            try:
                os.write(1, signals)
            except OSError:
                return


if __name__ == "__main__":
    main(int(sys.argv[1]))
