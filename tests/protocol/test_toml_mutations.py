"""Shipped protocols and benches, damaged: a plan, or an error that names the file and the place.

Never another exception, never a warning, and never more memory than a plan of moderate size takes.
"""

from __future__ import annotations

import random
import shutil
import sys
from pathlib import Path

import pytest

from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.protocol import load_protocol, make_plan

from .conftest import SHIPPED
from .toml_mutations import mutated

PROTOCOLS = tuple(sorted(file.name for file in SHIPPED.glob("*.toml")))
BENCHES = tuple(sorted(f"benches/{file.name}" for file in SHIPPED.glob("benches/*.toml")))
MOST_MEMORY = 400 * 2**20
"""bytes that a plan may take at its height; the largest allowed one has 100 000 trials."""
LONGEST = 2_000
"""Letters of a message at most, however long what it is about."""


def attack(shipped: Path, seed: int) -> str:
    """Load and plan with one file damaged; what came of it: `plan`, or the kind of the error."""
    chance = random.Random(seed)
    protocol = chance.choice(PROTOCOLS)
    victim = chance.choice([protocol, protocol, chance.choice(BENCHES)])
    whole = (shipped / victim).read_bytes()
    (shipped / victim).write_bytes(mutated(whole.decode(), chance))
    try:
        plan = make_plan(load_protocol(shipped / protocol, experiments(), shipped=shipped), seed=1)
    except ProtocolError as error:
        judge(error, shipped)
        return "refused"
    finally:
        (shipped / victim).write_bytes(whole)
    assert plan.trials
    return "plan"


def judge(error: ProtocolError, shipped: Path) -> None:
    """It says where and what, in a few lines."""
    assert error.problems
    for problem in error.problems:
        assert problem.file.is_relative_to(shipped)
        assert problem.message
        assert (problem.line > 0) == (problem.column > 0)
        assert len(problem.message) < LONGEST


def attacks(folder: Path, seeds: range) -> dict[str, int]:
    shipped = folder / "protocols"
    shutil.copytree(SHIPPED, shipped)
    came: dict[str, int] = {}
    before = peak_memory()
    for seed in seeds:
        try:
            result = attack(shipped, seed)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
        assert peak_memory() - before < MOST_MEMORY, seed
        came[result] = came.get(result, 0) + 1
    return came


def peak_memory() -> int:
    """bytes that this process had at its height; 0 where that cannot be had."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


@pytest.mark.slow
def test_damaged_protocols_and_benches(tmp_path: Path) -> None:
    came = attacks(tmp_path, range(60))
    assert came["refused"] > 18
    assert came["plan"] > 6


@pytest.mark.soak
@pytest.mark.parametrize("batch", range(25))
def test_damaged_protocols_and_benches_for_long(tmp_path: Path, batch: int) -> None:
    attacks(tmp_path, range(1000 + 200 * batch, 1200 + 200 * batch))
