"""Files that are broken, cut or made up: a message with the file's name, or what is in them."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import numpy as np
import pytest

from campaign.importing.interface import RecordingError
from campaign.importing.opening import open_recordings
from tests.importing.files import MADE

EACH, APART = 50, 8
"""Mutations of each file; fewer where a process is begun for each."""


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Cut, flipped, doubled, or with bytes of others in between."""
    at, end = sorted(chance.randrange(len(data)) for _ in range(2))
    match chance.randrange(5):
        case 0:
            return data[:at]
        case 1:
            flipped = bytearray(data)
            for _ in range(chance.randrange(1, 20)):
                flipped[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            return bytes(flipped)
        case 2:
            return data[:at] + data[end:]
        case 3:
            return data[:end] + data[at:]
        case _:
            return data[:at] + chance.randbytes(chance.randrange(1, 40)) + data[at:]


@pytest.mark.parametrize("name", MADE)
def test_a_broken_file_is_told_or_read(tmp_path: Path, name: str) -> None:
    MADE[name](tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    chance = random.Random(name)
    said = []
    for number in range(APART if name.endswith(".mat") and name != "v73.mat" else EACH):
        path = tmp_path / f"{number}-{name}"
        path.write_bytes(mutated(whole, chance))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of libraries that notice, too
                for table in open_recordings(path)[1]:
                    for block in table.read([k for k, c in enumerate(table.columns) if c.numeric]):
                        assert block.dtype == np.float64
        except RecordingError as error:
            said.append(str(error))
    assert said, "or nothing was broken"
    assert all(name in each for each in said)
