"""A noisy line: bytes lost, duplicated, swapped or changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from campaign.device.faults import BYTE_FAULTS, FaultName, FaultSpec


class ByteNoise:
    """One direction of a noisy line.

    The affected bytes depend on the seed and on the number of previous bytes, not on the division
    into chunks; only a swap at the end of a chunk uses the previous byte.
    """

    def __init__(self, rates: Mapping[FaultName, float], seed: Sequence[int]) -> None:
        self._rates = {name: rates[name] for name in BYTE_FAULTS if rates.get(name, 0.0) > 0.0}
        self._random = {
            name: np.random.Generator(np.random.PCG64([*seed, index]))
            for index, name in enumerate(BYTE_FAULTS)
        }
        self._left = {name: self._gap(name) for name in self._rates}

    def __call__(self, data: bytes) -> bytes:
        """Bytes that arrive of `data`."""
        hits = sorted(at for name in self._rates for at in self._hits(name, len(data)))
        if not hits:
            return data
        out = bytearray(data)
        for at, name, mask in reversed(hits):  # from the end: earlier positions stay valid
            _damage(out, at, name, mask)
        return bytes(out)

    def _gap(self, name: FaultName) -> int:
        """Number of unaffected bytes before the next affected one."""
        return int(self._random[name].geometric(self._rates[name])) - 1

    def _hits(self, name: FaultName, count: int) -> list[tuple[int, FaultName, int]]:
        """Position, fault and bit mask of each affected byte."""
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
    """Effect of the requested faults on the bytes between host and controller."""

    def __init__(self, faults: Sequence[FaultSpec], seed: int) -> None:
        self._faults = [fault for fault in faults if fault.rate > 0.0]
        self._seed = seed
        self._trial: int | None = None
        self._random = np.random.Generator(np.random.PCG64([seed, 2]))
        self._make()

    def enter(self, trial: int | None) -> None:
        """Set the running trial (its number since switching on), or None after its end."""
        if trial != self._trial and any(fault.trial is not None for fault in self._faults):
            self._trial = trial
            self._make()

    def received(self, data: bytes) -> bytes:
        """Bytes that arrive at the controller, of `data` from the host."""
        return self._in(data)

    def sent(self, data: bytes) -> bytes:
        """Bytes that arrive at the host, of `data` from the controller."""
        return self._out(data)

    def loses_block(self) -> bool:
        """Whether the next frame of records is lost."""
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
