"""A recorder that records violations of the interface."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from campaign.recording import Array, ChannelInfo, Ending, Event, MemoryRecorder, Recording


class StrictRecorder:
    """Recorder that keeps samples like `MemoryRecorder`, and a text for each violation.

    It raises nothing while the backend runs: the backend might handle the exception as its own.

    Attributes:
        order: violations of the order of calls.
        shapes: violations of shape, type or time of blocks and events.
        blocks: number of appended blocks.
        sizes: samples per block without violation.
    """

    def __init__(self, on_block: Callable[[int], None] = lambda count: None) -> None:
        """`on_block` is called with the number of blocks after each block."""
        self.order: list[str] = []
        self.shapes: list[str] = []
        self.channels: tuple[ChannelInfo, ...] = ()
        self.blocks = 0
        self.sizes: list[int] = []
        self._started = False
        self._on_block = on_block
        self._memory = MemoryRecorder()

    def start(self, channels: tuple[ChannelInfo, ...]) -> None:
        if self._started:
            self.order.append("the channels were announced twice")
        if self.blocks:
            self.order.append("the channels were announced after samples")
        self._started = True
        self.channels = channels
        self._memory.start(channels)

    def append(self, time: Array, block: Array) -> None:
        self.blocks += 1
        if not self._started:
            self.order.append("samples came before the channels were announced")
        slip = self._slip(time, block)
        if slip:
            self.shapes.append(f"block {self.blocks}: {slip}")
        else:
            self.sizes.append(len(time))
            # A backend may reuse the array; the recorded samples must not change.
            self._memory.append(time.copy(), block.copy())
        self._on_block(self.blocks)

    def lost(self, time: Array) -> None:
        self.append(time, np.full((len(self.channels), len(time)), np.nan))

    def event(self, event: Event) -> None:
        if not (math.isfinite(event.time) and event.text.strip()):
            self.shapes.append(f"an event without a time or a text: {event}")
        self._memory.event(event)

    def recording(self, ending: Ending) -> Recording:
        """All blocks without a violation."""
        return self._memory.recording(ending)

    def _slip(self, time: Array, block: Array) -> str:
        for name, array in (("time", time), ("block", block)):
            if not isinstance(array, np.ndarray) or array.dtype != np.float64:
                return f"{name} is no array of float64"
        if time.ndim != 1:
            return f"time has the shape {time.shape}, not (n,)"
        if block.shape != (len(self.channels), len(time)):
            wanted = (len(self.channels), len(time))
            return f"the block has the shape {block.shape}, not (channels, n) = {wanted}"
        return ""
