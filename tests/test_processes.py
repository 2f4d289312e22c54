"""Worker processes."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

TAKEN_TWICE = """
import resource
from campaign.processes import tune_memory
{keep}
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    parts = [b"x" * 20_000_000 for _ in range(3)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
faults()
print(faults())
"""


def faults_of_the_second_time(keep: str) -> int:
    """Pages that the system has to hand out for what was in memory before."""
    command = [sys.executable, "-c", TAKEN_TWICE.format(keep=keep)]
    return int(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="does nothing elsewhere")
def test_memory_of_a_trial_serves_the_next_one() -> None:
    pages = 60_000_000 // 4096
    assert faults_of_the_second_time("") > pages / 2
    assert faults_of_the_second_time("tune_memory()") < pages / 100
