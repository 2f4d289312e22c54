"""Thousands of damaged archives: never wrong content, never a crash, always a message."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("resource", reason="limits the child's memory, which only Unix can")


@pytest.fixture
def archives(tmp_path, kit):
    """A sealed run and a killed one."""
    kit.run(tmp_path, [50, None, 300], name="run")
    kit.begin(tmp_path, 2, [40] * 2, name="killed")
    return tmp_path


def mutations(folder: Path, count: int, seed: int) -> dict[str, int]:
    script = Path(__file__).with_name("mutations.py")
    command = [sys.executable, str(script), str(folder), str(count), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"exit {done.returncode}: {done.stderr[-2000:]}"
    return {kind: int(n) for kind, n in (pair.split("=") for pair in done.stdout.split())}


@pytest.mark.slow
def test_a_damaged_archive_is_read_right_or_refused(archives):
    tally = mutations(archives, 60, 1)
    assert sum(tally.values()) == 60
    assert tally["refused"] > 5
    assert tally["listed"] > 5


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(10, 18))
def test_thousands_of_damaged_archives_are_read_right_or_refused(archives, seed):
    assert sum(mutations(archives, 400, seed).values()) == 400
