"""What a forger does to a sealed run: changes something, and as much of its checksums as he cares.

Written from the format's description, with h5py and hashlib alone, so that the program's own code
cannot agree with itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

OUTSIDE = ("outcome/seal", "outcome/file_sha256")
"""What the seal does not bind: itself, the file's hash, and the note `not_kept`."""


def sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def canonical(tree: object) -> str:
    return json.dumps(tree, sort_keys=True, separators=(",", ":"))


def series_digest(samples: np.ndarray) -> str:
    """SHA-256 over the SHA-256 of each block of 32 768 samples."""
    raw = np.asarray(samples, "<f8").tobytes()
    size = 32_768 * 8
    blocks = [hashlib.sha256(raw[at : at + size]).digest() for at in range(0, len(raw), size)]
    return hashlib.sha256(b"".join(blocks)).hexdigest()


def text_of(file: h5py.Group, place: str) -> str:
    return file[place][()].decode()


def put_text(file: h5py.Group, place: str, text: str, *, honest: bool = False) -> None:
    """Put a text where one is or was; unless he is `honest`, with a checksum that fits it."""
    raw = text.encode()
    attributes = {"sha256": ""}
    if place in file:
        attributes = dict(file[place].attrs)
        del file[place]
    stored = np.array(raw, dtype=h5py.string_dtype("utf-8", max(1, len(raw))))
    file.create_dataset(place, data=stored).attrs.update(attributes)
    if not honest:
        file[place].attrs["sha256"] = sha256(text)


def put_integer(file: h5py.Group, place: str, value: int) -> None:
    """Put a whole number where one is, with a checksum that fits it."""
    del file[place]
    number = np.array(value, "<i8")
    file[place] = number
    file[place].attrs["sha256"] = hashlib.sha256(number.tobytes()).hexdigest()


def reseal(file: h5py.File) -> None:
    """Compute the seal anew, from all the texts there are."""
    run, texts = file["run"], {}

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name not in OUTSIDE and "not_kept/" not in name:
            whole = item.dtype.kind == "i"
            texts[name] = sha256(str(int(item[()])) if whole else item[()].decode())

    run.visititems(add)
    told = {"format": 3, "run": text_of(run, "entry_identifier"), "texts": texts}
    put_text(run, "outcome/seal", canonical(told))


def rehash(path: Path) -> None:
    """Compute the hash of the file anew."""
    with h5py.File(path) as file:
        place = file["run/outcome/file_sha256"].id.get_offset()
    content = bytearray(path.read_bytes())
    content[place : place + 64] = b"0" * 64
    content[place : place + 64] = hashlib.sha256(content).hexdigest().encode()
    path.write_bytes(content)


def put_record(file: h5py.File, entry: str, text: str) -> None:
    """Put another record where the one of `entry` is, and its digest into the journal."""
    before = text_of(file, f"{entry}/record/json")
    put_text(file, f"{entry}/record/json", text)
    index = text_of(file, "run/index/data").replace(before, text)
    put_text(file, "run/index/data", index)
    journal = text_of(file, "run/journal/data").replace(sha256(before), sha256(text))
    put_text(file, "run/journal/data", journal)


def change_record(file: h5py.File, entry: str, change: Callable[[dict[str, Any]], object]) -> None:
    """Change what a record says, and everything that tells of it but the file's hash."""
    tree = json.loads(text_of(file, f"{entry}/record/json"))
    change(tree)
    put_record(file, entry, canonical(tree))
    reseal(file)


def put_samples(file: h5py.File, place: str, **made: Any) -> None:
    """Put a series made some other way where one is, with its attributes."""
    attributes = {k: v for k, v in file[place].attrs.items() if k != "DIMENSION_LIST"}
    del file[place]
    file.create_dataset(place, **made).attrs.update(attributes)
