"""The device of docs/developers/writing-a-backend.md: a TX-1 that moves as commanded."""

from __future__ import annotations

import socketserver
import threading
from typing import Any, Self


class Drive(socketserver.ThreadingTCPServer):
    """Listens on a free port; with a `fault` it stops after `good` lines of rates."""

    daemon_threads = True

    def __init__(self, fault: str = "", good: int = 3) -> None:
        super().__init__(("127.0.0.1", 0), _Line)
        self.fault, self.good = fault, good
        self.port = int(self.server_address[1])
        self.angle, self.rate_of_steps, self.on, self.lines = 0.0, 1.0, False, 0

    def answer(self, line: str) -> str:
        word, *values = line.split()
        if word == "ON":
            self.angle, self.rate_of_steps, self.on, self.lines = 0.0, float(values[0]), True, 0
            return "OK"
        if word == "OFF":
            self.on = False
            return "REST"
        self.lines += 1
        if self.fault and self.lines > self.good:
            return f"FAULT {self.fault}" if self.fault != "SILENCE" else ""
        assert self.on, "rates for a drive that is off"
        return " ".join(self._step(float(value)) for value in values)

    def _step(self, rate: float) -> str:
        self.angle += rate / self.rate_of_steps
        return f"{rate!r} {self.angle!r} 0.5"

    def __enter__(self) -> Self:
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.shutdown()
        self.server_close()


class _Line(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        drive: Any = self.server
        for line in self.rfile:
            answer = drive.answer(line.decode())
            if not answer:
                return  # hangs up
            self.wfile.write(answer.encode() + b"\n")
