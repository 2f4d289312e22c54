"""A noisy line: bytes lost, doubled, swapped or changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from campaign.device.faults import BYTE_FAULTS, FaultName, FaultSpec


class ByteNoise:
    """One direction of a bad line.

    Which bytes are met depends on the seed and on how many have passed, not on how they were
    divided into chunks; only a swap at a chunk's end is with the byte before it.
    """

    def __init__(self, rates: Mapping[FaultName, float], seed: Sequence[int]) -> None:
        self._rates = {name: rates[name] for name in BYTE_FAULTS if rates.get(name, 0.0) > 0.0}
        self._random = {
            name: np.random.Generator(np.random.PCG64([*seed, index]))
            for index, name in enumerate(BYTE_FAULTS)
        }
        self._left = {name: self._gap(name) for name in self._rates}

    def __call__(self, data: bytes) -> bytes:
        """What arrives of `data`."""
        hits = sorted(at for name in self._rates for at in self._hits(name, len(data)))
        if not hits:
            return data
        out = bytearray(data)
        for at, name, mask in reversed(hits):  # from the end: the places before stay right
            _damage(out, at, name, mask)
        return bytes(out)

    def _gap(self, name: FaultName) -> int:
        """How many bytes pass before the next one that is met."""
        return int(self._random[name].geometric(self._rates[name])) - 1

    def _hits(self, name: FaultName, count: int) -> list[tuple[int, FaultName, int]]:
        """Where, how, and with which change of bits."""
        hits, at = [], self._left[name]
        while at < count:
            hits.append((at, name, int(self._random[name].integers(1, 256))))
            at += 1 + self._gap(name)
        self._left[name] = at - count
        return hits


def _damage(out: bytearray, at: int, name: FaultName, mask: int) -> None:
    if at >= len(out):  # its byte was dropped
        return
    if name is FaultName.DROP:
        del out[at]
    elif name is FaultName.DUPLICATE:
        out.insert(at, out[at])
    elif name is FaultName.CORRUPT:
        out[at] ^= mask
    elif len(out) > 1:
        other = at + 1 if at + 1 < len(out) else at - 1
        out[at], out[other] = out[other], out[at]


class BadLine:
    """Everything that the asked-for faults do to what passes between host and controller."""

    def __init__(self, faults: Sequence[FaultSpec], seed: int) -> None:
        self._faults = [fault for fault in faults if fault.rate > 0.0]
        self._seed = seed
        self._trial: int | None = None
        self._random = np.random.Generator(np.random.PCG64([seed, 2]))
        self._make()

    def enter(self, trial: int | None) -> None:
        """A trial begins (its number since the controller was switched on), or has ended (None)."""
        if trial != self._trial and any(fault.trial is not None for fault in self._faults):
            self._trial = trial
            self._make()

    def received(self, data: bytes) -> bytes:
        """What arrives of what the host sent."""
        return self._in(data)

    def sent(self, data: bytes) -> bytes:
        """What arrives of what the controller sends."""
        return self._out(data)

    def loses_block(self) -> bool:
        """Whether the frame of records that is to be sent now never arrives."""
        rate = self._rates.get(FaultName.LOST_BLOCKS, 0.0)
        return rate > 0.0 and bool(self._random.random() < rate)

    def _make(self) -> None:
        self._rates: dict[FaultName, float] = {}
        for fault in self._faults:
            if fault.meets(self._trial):
                self._rates[fault.name] = min(1.0, self._rates.get(fault.name, 0.0) + fault.rate)
        place = 0 if self._trial is None else self._trial
        self._in = ByteNoise(self._rates, (self._seed, place, 0))
        self._out = ByteNoise(self._rates, (self._seed, place, 1))
