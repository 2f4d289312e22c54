"""Step check: a simulated trial repeated with half the step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import JsonValue

from campaign.recording import Array

STEP, CHANGE = "step_s", "change_at_half_the_step"
"""Keys in a trial's telemetry: step (s), and per channel the RMS of the change divided by the RMS
of the channel. For a scheme of second order the error is 4/3 of the change."""


class StepCheck:
    """Sums the squares of one trial's recorded channels and of their changes."""

    def __init__(self, step: float, names: Sequence[str]) -> None:
        """`names`: channel names in the order of the rows."""
        self._step = step
        self._names = tuple(names)
        self._squares = np.zeros(len(names))
        self._changes = np.zeros(len(names))

    def add(self, out: Array, half: Array) -> None:
        """Add the same samples at the step and at half of it, each of shape (channels, n)."""
        with np.errstate(over="ignore", invalid="ignore"):
            self._squares += np.sum(out * out, axis=1)
            self._changes += np.sum((out - half) ** 2, axis=1)

    def telemetry(self) -> dict[str, JsonValue]:
        """Telemetry of the trial, for channels that are not all zero."""
        moved = np.flatnonzero(self._squares > 0.0)
        with np.errstate(invalid="ignore"):
            change = np.sqrt(self._changes[moved] / self._squares[moved])
        return {
            STEP: self._step,
            CHANGE: {
                self._names[row]: float(f"{each:.3g}") if np.isfinite(each) else None
                for row, each in zip(moved, change, strict=True)
            },
        }
