"""The file of one trial of a run in progress: packed samples and a record.

A trial file contains `MAGIC`, chunks of samples in the output format of HDF5's filters, a
`PackedTrial` as JSON, and its offset (8 bytes, little endian). Sealing copies chunks unchanged.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, NonNegativeInt

from campaign.archive.layout.storage import LARGEST_CHUNK

MAGIC = b"campaign trial 1\n"
POINTER = 8
"""Size of the last field of the file (bytes): the offset of its `PackedTrial`."""

Place = tuple[NonNegativeInt, NonNegativeInt]
"""Place of a chunk in a file: offset and size in bytes."""


class PackedSeries(BaseModel):
    """Places of the samples of a series.

    Attributes:
        chunk: samples of a chunk; zeros follow the last samples of the last one.
        shuffled: whether chunks passed the shuffle filter before deflate.
        chunks: in the order of time.
    """

    model_config = ConfigDict(frozen=True)

    name: str
    chunk: int = Field(gt=0, le=LARGEST_CHUNK)
    shuffled: bool
    chunks: tuple[Place, ...]


class PackedTrial(BaseModel):
    """A trial in its file.

    Attributes:
        record, trees: texts, as in a sealed run.
        not_kept: why only digests of its samples are kept; empty if the samples are.
        groups: `data`, and `preview` of a long recording.
    """

    model_config = ConfigDict(frozen=True)

    record: str
    trees: str
    not_kept: str = ""
    groups: dict[str, tuple[PackedSeries, ...]] = {}
