"""The platform as a bench."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from campaign.cli.prepare import Request
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.comparison import run_comparison
from campaign.experiments import experiments
from campaign.experiments.interface import bench_of
from campaign.physics.bench import Bench
from campaign.protocol import load_protocol, make_plan
from campaign.resources import protocols_folder
from tests.analysed_once import analysed_once


@pytest.fixture(autouse=True, scope="package")
def analyses() -> Iterator[None]:
    """The same runs are compared by many tests."""
    with analysed_once(run_comparison):
        yield


@pytest.fixture(scope="session")
def platform(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    path = tmp_path_factory.mktemp("platform") / "one.toml"
    text = '[[test]]\nname = "errors"\nkind = "stabilization"\nbench = "platform"\n'
    path.write_text(text, encoding="utf-8")
    protocol = load_protocol(path, experiments(), shipped=protocols_folder())
    return bench_of(make_plan(protocol).trials[0])


PROTOCOL = """
title = "Before and after <b>the repair</b>"

[[test]]
name = "map"
kind = "velocity_map"
bench = "platform"
speeds = ["0.5 deg/s", "0.8 deg/s", "1.2 deg/s", "2 deg/s", "3 deg/s", "5 deg/s", "15 deg/s",
    "40 deg/s"]
warm_up_cycles = 0

[[test]]
name = "errors"
kind = "stabilization"
bench = "platform"
frequency = "0.5 Hz"
acceleration = "18 deg/s^2"
cycles = 2
settle_cycles = 1

[test.matrix]
compensation = ["none", "lugre"]
"""
STRONGER = "17.732 N m"
"""Coulomb friction of the load after the repair, in the positive direction: 10 % more."""


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs `before`, `again` (another seed), `after` (another friction) and `waves` (no map)."""
    folder = tmp_path_factory.mktemp("compared")
    path = folder / "repair.toml"
    path.write_text(PROTOCOL, encoding="utf-8")
    seeds = [f"{test}.seed={{}}" for test in ("map", "errors")]
    change = f'map.bench.friction.load.coulomb_torque="{STRONGER}"'
    for name, seed, more in (("before", 1, ()), ("again", 2, ()), ("after", 3, (change,))):
        settings = (*(each.format(seed) for each in seeds), *more)
        _run(path, folder / "results", name, settings)
    _run(path, folder / "results", "waves", (), only=("errors",))
    return folder / "results"


def _run(path: Path, results: Path, name: str, settings: tuple[str, ...], **more: Any) -> None:
    request = Request(str(path), more.get("only", ()), settings, "sim")
    before = set(results.glob("*.nxs"))
    assert run_protocol(request, results, RunOptions(workers=1)) == 0
    (made,) = set(results.glob("*.nxs")) - before
    made.rename(results / f"{name}.nxs")
