"""The worked example of the docs, as it stands there: on a stand-in everywhere, on the real data
where that is.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

import campaign
from campaign.cli.import_command import import_recordings
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode
from campaign.importing.guess import guess, mapping_text
from tests.importing import rig
from tests.importing.newcomer import completed
from tests.importing.newcomer import rig as rig_of
from tests.importing.wild import text, together

DOCS = Path(__file__).parents[2] / "docs" / "import.md"
DATA = Path(__file__).parents[3] / "shared" / "data" / "emps"
PUBLISHED = {"positive": (20.1440, 166.7061), "negative": (20.6277, 240.4236)}
"""Coulomb (N) and viscous friction (N s/m) of the direction-dependent model of the whole motion."""


def blocks() -> list[str]:
    return re.findall(r"```toml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.S)


def imported(folder: Path) -> Any:
    _, stand, mapping = blocks()
    (folder / "emps-rig.toml").write_text(stand, encoding="utf-8")
    (folder / "emps.toml").write_text(mapping, encoding="utf-8")
    code = import_recordings(
        [str(folder / "emps.toml")], folder / "results", RunOptions(report=True)
    )
    assert code is ExitCode.DONE
    return campaign.open(next((folder / "results").glob("*-emps.nxs")))


def stand_in(mass: float, coulomb: tuple[float, float], viscous: tuple[float, float], seed: int):
    """Trapezoidal moves of a rigid carriage with friction of each direction, measured; SI."""
    rng = np.random.default_rng(seed)
    time = np.arange(25_000) / 1000.0
    rate = np.zeros_like(time)
    start = 0
    for speed in (0.04, 0.08, 0.125) * 4:
        for sign in (1.0, -1.0):
            ramp, cruise = 100, round(0.06 / speed * 1000)
            up = np.linspace(0.0, 1.0, ramp)
            move = sign * speed * np.concatenate([up, np.ones(cruise), up[::-1], np.zeros(50)])
            stop = min(start + len(move), len(rate))
            rate[start:stop] = move[: stop - start]
            start = stop
    position = np.cumsum(rate) / 1000.0
    moving = np.sign(rate)
    way = (rate < 0).astype(int)
    friction = moving * np.choose(way, coulomb) + rate * np.choose(way, viscous)
    force = mass * np.gradient(rate, 0.001) + friction + rng.normal(0.0, 0.5, len(time))
    return {
        "t": time[:, None],
        "qm": np.round(position / 2e-7)[:, None] * 2e-7,
        "qg": position[:, None] + 1e-4 * rate[:, None],
        "vir": force[:, None] / 35.1507,
        "gtau": 35.1507,
    }


def findings(run: Any, test: str) -> dict[tuple[str, str], Any]:
    table = run.results.findings
    own = table[table.test == test]
    return {(row.quantity, row.direction): row for _, row in own.iterrows()}


@pytest.mark.slow
def test_a_stand_in_comes_out_as_it_was_made(tmp_path: Path):
    coulomb, viscous = (20.0, 22.0), (160.0, 240.0)
    for seed, name in enumerate(("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"), start=1):
        savemat(tmp_path / name, stand_in(95.0, coulomb, viscous, seed))
    run = imported(tmp_path)
    for test in ("estimation", "validation"):
        found = findings(run, test)
        for place, direction in enumerate(("positive", "negative")):
            row = found["coulomb_torque", direction]
            assert row.low <= coulomb[place] <= row.high
            assert row.unit == "N"
            row = found["viscous_friction", direction]
            assert row.low <= viscous[place] <= row.high
            assert row.unit == "N s/m"
    page = next((tmp_path / "results").glob("*-report")) / "report.html"
    text = page.read_text(encoding="utf-8")
    for word in (
        "Tracking error", "Friction over rate", "Position", "drive_torque: column &#39;vir&#39;",
        "relative_rate: derivative of relative_angle", "campaign import emps.toml",
    ):  # fmt: skip
        assert word in text
    marks = r"<style.*?</style>|<script.*?</script>|<[^>]+>"
    assert "deg" not in re.sub(marks, " ", text, flags=re.S)


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the EMPS files are not here")
def test_the_real_one(tmp_path: Path):
    for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"):
        (tmp_path / name).symlink_to(DATA / name)
    found = findings(imported(tmp_path), "estimation")
    for direction, (coulomb, viscous) in PUBLISHED.items():
        ours = (
            found["coulomb_torque", direction].value,
            found["viscous_friction", direction].value,
        )
        middle = 0.0826  # m/s; both models are of the same data, and meet in its middle
        assert ours[0] + ours[1] * middle == pytest.approx(coulomb + viscous * middle, rel=0.02)


def test_one_signal_per_file_as_it_stands_there(tmp_path: Path) -> None:
    """The mapping of the docs is the guessed one, completed; friction comes out as it was made."""
    m = rig.trapezoids(3)
    files = [tmp_path / "pos.t", tmp_path / "tau.t"]
    for file, values in zip(files, (m.q, m.tau), strict=True):
        text(together(m.t, values), "")(file)
    guessed = mapping_text(guess(files), tmp_path)
    units = {"relative_angle": "rad", "drive_torque": "N m"}
    mapping = blocks()[0]
    assert tomllib.loads(completed(guessed, units)) == tomllib.loads(mapping)
    (tmp_path / "rig.toml").write_text(rig_of(guessed), encoding="utf-8")
    (tmp_path / "mapping.toml").write_text(mapping, encoding="utf-8")
    code = import_recordings([str(tmp_path / "mapping.toml")], tmp_path / "results")
    assert code is ExitCode.DONE
    found = findings(campaign.open(next((tmp_path / "results").glob("*.nxs"))), "recorded")
    for direction in ("positive", "negative"):
        assert found["coulomb_torque", direction].value == pytest.approx(rig.COULOMB, rel=0.05)
