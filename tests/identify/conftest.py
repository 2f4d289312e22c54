"""Recordings of a rig that was made up, imported as a laboratory would import them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode
from tests.estimation.rigs import Rig, random_rigs

RIG = """
schema = 3
name = "made up"

[axis]
name = "carriage"  # the only one
kind = "linear"
"""
MAPPING = """
schema = 2
title = "A rig that was made up"
published = "none"

[columns.own.time]
column = "t"
unit = "s"

[columns.own.relative_angle]
column = "x"
unit = "m"

[columns.own.reference]
column = "w"
unit = "m"

[columns.own.drive_torque]
column = "f"
unit = "N"
"""
TEST = """
[[test]]
name = "{name}"
kind = "motion"
bench = "./rig.toml"

[[test.recording]]
file = "{name}.csv"
"""
ACCEPT = 'accept = ["unrelated", "delay", "held"]\n'

Importer = Callable[..., Path]


def write(path: Path, rig: Rig, part: slice, shift: float = 0.0) -> None:
    """A text file of part of a recording; `shift`: dry friction more than it had (N)."""
    direction = np.sign(np.gradient(rig.angle))
    rows = np.column_stack(
        [rig.time[part], rig.angle[part], rig.wanted[part], (rig.force + shift * direction)[part]]
    )
    np.savetxt(path, rows, delimiter=",", header="t,x,w,f", comments="", fmt="%.9g")


@pytest.fixture(scope="session")
def rig() -> Rig:
    return random_rigs(3, seed=4, seconds=30.0)[1]


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory, rig: Rig) -> Path:
    """A run `rig` with tests `monday`, `tuesday`, and `worn` (10 % more dry friction)."""
    folder = tmp_path_factory.mktemp("identified")
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    more = 0.1 * rig.truth["coulomb_positive"]
    parts = {"monday": (slice(0, 15_000), 0.0), "tuesday": (slice(15_000, 30_000), 0.0),
             "worn": (slice(15_000, 30_000), more)}  # fmt: skip
    for name, (part, shift) in parts.items():
        write(folder / f"{name}.csv", rig, part, shift)
    mapping = MAPPING + "".join(TEST.format(name=name) for name in parts)
    (folder / "rig-mapping.toml").write_text(mapping, encoding="utf-8")
    code = import_recordings([str(folder / "rig-mapping.toml")], folder / "results")
    assert code is ExitCode.DONE
    return folder / "results"
