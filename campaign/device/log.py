"""Log of the emulated controller: one JSON object a line."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import IO


class DeviceLog:
    """Appends what happens, in the order in which it happened; without a file, nothing."""

    def __init__(self, file: Path | None) -> None:
        self._out: IO[str] | None = None
        if file is not None:
            self._out = file.open("a", encoding="utf-8", buffering=1)  # a line is never torn

    def __call__(self, event: str, **facts: str | int | float | bool | None) -> None:
        """Note `event`, such as `drive on`, with what belongs to it."""
        if self._out is not None:
            self._out.write(json.dumps({"at": time.time(), "event": event, **facts}) + "\n")

    def close(self) -> None:
        """Nothing more happens."""
        if self._out is not None:
            self._out.close()
            self._out = None
