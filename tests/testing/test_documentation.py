"""docs/developers/writing-a-backend.md: its backend passes the kit, and runs as a plug-in."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.recording import Fault, Outcome, SafeState
from campaign.testing import backend_checks
from tests.forks import MODULES, forks_of
from tests.testing.drive import Drive

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "developers" / "writing-a-backend.md").read_text()
CHECKS = backend_checks()


def block(kind: str) -> str:
    (found,) = re.findall(rf"^```{re.escape(kind)}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return str(found)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """The page's backend, installed as its own package with the page's entry point."""
    folder = tmp_path / "packages"
    about = folder / "tx1-1.0.dist-info"
    about.mkdir(parents=True)
    (folder / "tx1.py").write_text(block("python tx1.py"))
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: tx1\nVersion: 1.0\n")
    points = tomllib.loads(block("toml"))["project"]["entry-points"]
    lines = [f"{name} = {value}" for name, value in points["campaign.backends"].items()]
    (about / "entry_points.txt").write_text("[campaign.backends]\n" + "\n".join(lines) + "\n")
    return folder


@pytest.fixture
def tx1(package: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("tx1", package / "tx1.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "tx1", module)
    spec.loader.exec_module(module)
    return module


def told(drive: Drive, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The names of the page's test, made for a drive."""
    monkeypatch.setenv("DRIVE_PORT", str(drive.port))
    names: dict[str, Any] = {}
    exec(compile(block("python test"), "page", "exec"), names)
    return names


def test_it_is_short(tx1: ModuleType) -> None:
    assert len(block("python tx1.py").splitlines()) < 100


@pytest.mark.parametrize("name", CHECKS)
def test_it_passes_the_kit(name: str, tx1: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    with Drive() as drive, Drive("HOT") as hot:
        names = told(drive, monkeypatch)
        names["CASE"] = replace(
            names["CASE"], failing=lambda: tx1.BACKEND.open(tx1.DriveOptions(port=hot.port))
        )
        names["test_backend"](name)


@pytest.mark.parametrize(
    ("fault", "expected", "safe"),
    [
        ("HOT", Fault.OVER_TEMPERATURE, SafeState.CONFIRMED),
        ("ODD", Fault.DRIVE, SafeState.CONFIRMED),
        ("SILENCE", Fault.LOST_CONNECTION, SafeState.CONFIRMED),  # found again
    ],
)
def test_its_faults_have_names(
    tx1: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
    expected: Fault,
    safe: SafeState,
) -> None:
    from campaign.recording import MemoryRecorder

    with Drive(fault) as drive:
        trial = told(drive, monkeypatch)["TRIAL"]
        recorder = MemoryRecorder()
        with tx1.BACKEND.open(tx1.DriveOptions(port=drive.port)) as backend:
            ending = backend.execute(trial, recorder, lambda: False)
    assert (ending.outcome, ending.fault, ending.safe_state) == (Outcome.FAULT, expected, safe)
    assert len(recorder.recording(ending).time) == 300


PROTOCOL = """\
[[test]]
name = "home"
kind = "move"
bench = "simulink"
angle = "10 deg"
seed = 1
"""


def campaign(package: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(package), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return forks_of(MODULES).run(folder, *arguments, environment={**os.environ, "PYTHONPATH": path})


@pytest.mark.slow
def test_a_whole_run(package: Path, tmp_path: Path) -> None:
    (tmp_path / "home.toml").write_text(PROTOCOL)
    with Drive() as drive:
        backend = ("--backend", "tx1", "--set", f"backend.port={drive.port}")
        done = campaign(package, tmp_path, "run", "home.toml", *backend, "--yes", "--report")
    assert done.returncode == 0, done.stderr
    archive = find_run(tmp_path / "results")
    run = open_run(archive)
    assert run.header.backend == "tx1"
    assert run.safe_state is SafeState.CONFIRMED
    (trial,) = run.trials
    reached = trial.recording()["relative_angle"][-1]
    assert np.rad2deg(reached) == pytest.approx(10, rel=1e-3)


def test_what_it_cannot_do_is_refused_in_the_plan(package: Path, tmp_path: Path) -> None:
    sweep = '[test.matrix]\n"bench.friction.load.coulomb_torque" = ["20 N m", "26 N m"]\n'
    (tmp_path / "sweep.toml").write_text(PROTOCOL + sweep)
    done = campaign(package, tmp_path, "plan", "sweep.toml", "--backend", "tx1")
    assert done.returncode == 2
    assert "bench.friction.load.coulomb_torque" in done.stderr
