"""Files that are broken, cut or made up: a message with the file's name, or what is in them."""

from __future__ import annotations

import os
import pickle
import random
import tracemalloc
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from campaign.importing.formats import open_recordings
from campaign.importing.guess import guess, mapping_text
from campaign.importing.interface import RecordingError
from tests.importing.files import MADE
from tests.importing.whole import whole

ALL, SOME, APART = 46, 12, 2
"""Mutations of each file: in all, and in every run; fewer of those that take a process each."""
LONGEST = 3000
"""Letters of a message at most, however broken the file is."""
_TOKENS = (
    b'"', b"\0", b"\xff\xfe", b"1e999", b",,,,", b";", b"\t", b"\r", b"\n\n", b"=1+1", b"\x1b[2J",
    b"-", b"nan", b"9" * 400, b"***End_of_Header***\n", b"Name\t", b"\xc3\x28", b"#", b"%",
)  # fmt: skip


def mutated(data: bytes, chance: random.Random) -> bytes:
    """Cut, flipped, doubled, emptied, or with bytes of others in between."""
    at, end = sorted(chance.randrange(len(data)) for _ in range(2))
    match chance.randrange(7):
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
        case 4:
            return data[:at] + chance.choice((b"\0", b"\xff")) * (end - at) + data[end:]
        case 5:
            return data[:at] + chance.choice(_TOKENS) * chance.randrange(1, 4) + data[at:]
        case _:
            return data[:at] + chance.randbytes(chance.randrange(1, 40)) + data[at:]


def read_all(path: Path) -> None:
    """Everything that a reader would: tables, their numbers, and a first guess at a mapping."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of libraries that notice, too
        for table in open_recordings(path)[1]:
            for block in table.read([k for k, c in enumerate(table.columns) if c.numeric]):
                assert block.dtype == np.float64
                assert not np.isinf(block).any() or path.suffix not in (".csv", ".txt", ".lvm")


def attack(folder: Path, name: str, seeds: range) -> Iterator[str]:
    """What was said of each broken copy; "" where it was read."""
    MADE[name](folder / name)
    whole = (folder / name).read_bytes()
    for seed in seeds:
        path = folder / f"{seed}-{name}"
        path.write_bytes(mutated(whole, random.Random(f"{name} {seed}")))
        said = ""
        try:
            read_all(path)
        except RecordingError as error:
            said = str(error)
        assert not said or name in said
        assert len(said) < LONGEST
        path.unlink()
        yield said


def apart(name: str) -> bool:
    return name.endswith((".mat", ".h5", ".xlsx", ".mf4", ".tdms"))


@pytest.mark.parametrize("name", MADE)
def test_a_broken_file_is_told_or_read(tmp_path: Path, name: str) -> None:
    said = list(attack(tmp_path, name, range(APART if apart(name) else SOME)))
    assert len(said) == (APART if apart(name) else SOME)


@pytest.mark.soak
@pytest.mark.parametrize("name", MADE)
def test_many_broken_files_are_told_or_read(tmp_path: Path, name: str) -> None:
    said = list(attack(tmp_path, name, range(1000, 1000 + ALL)))
    assert any(said), "or nothing was broken"


@pytest.mark.parametrize("name", ["plain.csv", "german.csv", "scope.csv", "old.lvm", "wide.txt"])
def test_a_guess_at_a_broken_file_is_one(tmp_path: Path, name: str) -> None:
    import tomllib

    MADE[name](tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    for seed in range(SOME):
        path = tmp_path / f"{seed}-{name}"
        path.write_bytes(mutated(whole, random.Random(f"guess {name} {seed}")))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                text = mapping_text(guess([path]), tmp_path)
        except RecordingError:
            continue
        assert tomllib.loads(text)["schema"] == 2


# What has brought readers of such files down


class _Runs:
    """Leaves a mark when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> object:
        return Path.touch, (self.mark,)


@pytest.mark.parametrize("name", MADE)
def test_nothing_beside_a_file_is_opened_and_nothing_in_it_is_run(tmp_path, name):
    """Some readers unpickle a `.pkl` beside the file."""
    MADE[name](tmp_path / name)
    mark = tmp_path / "mark"
    evil = pickle.dumps(_Runs(mark))
    for beside in (f"{name}.pkl", f"{Path(name).stem}.pkl", f"{Path(name).stem}.npy"):
        (tmp_path / beside).write_bytes(evil)
    read_all(tmp_path / name)
    assert not mark.exists()
    pickle.loads(evil)
    assert mark.exists(), "or it would have left no mark"


@pytest.mark.parametrize("suffix", [".csv", ".mat", ".h5", ".lvm", ".tdms", ".xlsx", ".mf4"])
def test_a_pickle_under_another_name_is_not_opened(tmp_path, suffix):
    mark = tmp_path / "mark"
    (tmp_path / f"a{suffix}").write_bytes(pickle.dumps(_Runs(mark)))
    with pytest.raises(RecordingError):
        read_all(tmp_path / f"a{suffix}")
    assert not mark.exists()


def test_a_long_run_of_separators_above_a_table_is_read_at_once(tmp_path):
    """A pattern would try them all at every one of them: hours for this line."""
    path = tmp_path / "a.csv"
    path.write_text("a:" + ";" * 900_000 + "x\n#" + " " * 900_000 + "x\nt,q\n0,1\n1,2\n")
    assert len(open_recordings(path)[1][0].columns) == 2


def test_a_number_beyond_all_numbers_is_none(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,q\n0,1\n1,1e999\n2,3\n3,4\n")
    with pytest.raises(RecordingError, match=r"a.csv:3:3: '1e999' is no number"):
        whole(open_recordings(path)[1][0])


def test_a_quote_that_never_ends(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('t,q\n0,1\n1,"' + "x" * 200_000 + "\n2,3\n3,4\n4,5\n5,6\n")
    with pytest.raises(RecordingError, match=r"a.csv:3:3: '\"x*"):
        whole(open_recordings(path)[1][0])


# Memory


def peak(path: Path) -> int:
    """Bytes that reading a file takes at its height."""
    tracemalloc.start()
    try:
        for table in open_recordings(path)[1]:
            for _ in table.read(range(len(table.columns))):
                pass
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def long_csv(path: Path, rows: int) -> Path:
    chunk = "".join(f"{k},{k * 7 % 1000 / 8},{k % 13 - 6}\n" for k in range(1000, 2000))
    with path.open("w") as file:
        file.write("t,angle,torque\n")
        for _ in range(rows // 1000):
            file.write(chunk)
    return path


def test_memory_does_not_grow_with_a_text(tmp_path, monkeypatch):
    monkeypatch.setattr("campaign.importing.rows.ROWS", 2000)
    small = peak(long_csv(tmp_path / "a.csv", 10_000))
    assert peak(long_csv(tmp_path / "b.csv", 100_000)) < 1.2 * small


def test_memory_does_not_grow_with_the_width_of_a_table(tmp_path, monkeypatch):
    monkeypatch.setattr("campaign.importing.rows.WHOLE", 1 << 16)
    monkeypatch.setattr("campaign.importing.rows.SAMPLE", 1 << 16)
    row = ",".join(["1.25"] * 500) + "\n"
    for name, rows in (("a.csv", 200), ("b.csv", 2000)):
        (tmp_path / name).write_text(row * rows)
    assert peak(tmp_path / "b.csv") < 1.2 * peak(tmp_path / "a.csv")


@pytest.mark.soak
def test_a_huge_text_is_read_in_little_memory(tmp_path):
    """`HUGE_ROWS=300000000` makes it 5 GB; counting every allocation takes its time."""
    path = long_csv(tmp_path / "huge.csv", int(os.environ.get("HUGE_ROWS", "3000000")))
    assert peak(path) < 100 * 2**20
