"""Writing the file of one trial: see `layout.packed_trial`."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from campaign.archive.layout.checksums import SeriesDigest
from campaign.archive.layout.files import keep_umask
from campaign.archive.layout.packed_trial import MAGIC, POINTER, PackedSeries, PackedTrial, Place
from campaign.archive.layout.storage import CHUNK, SAMPLE, pack, shuffling_helps
from campaign.recording import Array


class PackedFile:
    """A trial file during writing."""

    def __init__(self, path: Path) -> None:
        """Create the file. Raises OSError."""
        keep_umask()
        self._file = path.open("wb")
        self._digest = hashlib.sha256()
        self._size = 0
        self.put(MAGIC)

    def put(self, content: bytes) -> Place:
        """Append bytes; return their place. Raises OSError."""
        place = self._size, len(content)
        self._file.write(content)
        self._digest.update(content)
        self._size += len(content)
        return place

    def finish(self, trial: PackedTrial) -> tuple[str, int]:
        """Write the rest and close the file; return its SHA-256 and its size (bytes)."""
        start, _ = self.put(trial.model_dump_json(exclude_defaults=True).encode())
        self.put(start.to_bytes(POINTER, "little"))
        self._file.close()
        return self._digest.hexdigest(), self._size

    def close(self) -> None:
        """Close the file, unfinished."""
        with contextlib.suppress(OSError, AttributeError):  # the latter: opening failed
            self._file.close()

    def __del__(self) -> None:
        """Close the file of a trial with an abandoned thread."""
        self.close()


def copy_packed(source: Path, trial: PackedTrial, path: Path) -> tuple[str, int]:
    """Write a trial with its chunks in `source` as a trial file; return SHA-256 and size."""
    target = PackedFile(path)
    try:
        with source.open("rb") as file:

            def copied(place: Place) -> Place:
                file.seek(place[0])
                return target.put(file.read(place[1]))

            groups = {
                group: tuple(
                    each.model_copy(update={"chunks": tuple(map(copied, each.chunks))})
                    for each in series
                )
                for group, series in trial.groups.items()
            }
        return target.finish(trial.model_copy(update={"groups": groups}))
    finally:
        target.close()


class SampleColumns:
    """Series of equal length, compressed during recording; one chunk of each is in memory.

    Args:
        names: names of the series, in the order of the rows of `append`.
        file: destination of the chunks.
    """

    def __init__(self, names: Sequence[str], file: PackedFile, chunk: int = CHUNK) -> None:
        self._file = file
        self._names = tuple(names)
        self._buffer = np.empty((len(names), chunk), dtype=SAMPLE)
        self._filled = 0
        self._written = 0
        self._places: list[list[Place]] = [[] for _ in names]
        self._shuffled: list[bool] = []
        self._digests = [SeriesDigest() for _ in names]

    @property
    def length(self) -> int:
        """Number of samples appended so far."""
        return self._written + self._filled

    @property
    def series(self) -> tuple[PackedSeries, ...]:
        """Places of the samples; complete after `finish`."""
        chunk = max(1, min(self._written, self._buffer.shape[1]))
        columns = zip(self._names, self._shuffled, self._places, strict=True)
        return tuple(
            PackedSeries(name=name, chunk=chunk, shuffled=shuffled, chunks=tuple(places))
            for name, shuffled, places in columns
        )

    def append(self, rows: Sequence[Array]) -> list[Array]:
        """Add samples, one row per series; return the full chunks written, as new arrays."""
        total = len(rows[0])
        taken = 0
        chunks = []
        while taken < total:
            count = min(total - taken, self._buffer.shape[1] - self._filled)
            for row, samples in zip(self._buffer, rows, strict=True):
                row[self._filled : self._filled + count] = samples[taken : taken + count]
            self._filled += count
            taken += count
            if self._filled == self._buffer.shape[1]:
                chunks.append(self._buffer.copy())
                self._write_chunk()
        return chunks

    def finish(self) -> tuple[Array, list[str]]:
        """Write the rest; return it, shape (rows, m), and the digest of every series."""
        rest = self._buffer[:, : self._filled].copy()
        self._write_chunk()
        return rest, [digest.hexdigest() for digest in self._digests]

    def _write_chunk(self) -> None:
        for row, digest in zip(self._buffer, self._digests, strict=True):
            digest.update(row[: self._filled])
        self._put_chunk()
        self._written, self._filled = self._written + self._filled, 0

    def _put_chunk(self) -> None:
        if not self._shuffled:
            self._shuffled = [shuffling_helps(row[: self._filled]) for row in self._buffer]
        if not self._filled:
            return
        self._buffer[:, self._filled :] = 0.0
        # A short recording is one chunk of its own length.
        size = self._buffer.shape[1] if self._written else self._filled
        columns = zip(self._buffer, self._shuffled, self._places, strict=True)
        for row, shuffled, places in columns:
            places.append(self._file.put(pack(row[:size], shuffled)))
